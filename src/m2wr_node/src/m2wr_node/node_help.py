# SPDX-License-Identifier: BSD-3-Clause
"""The option ``-h`` of nodes that take their settings from parameters only."""
from __future__ import annotations

import argparse
from typing import Dict, Optional, Sequence


def answer_help(name: str, purpose: str, parameters: Dict[str, str], arguments: Optional[Sequence[str]] = None) -> None:
    """Print a help text and exit with 0 where ``-h`` or ``--help`` is given; otherwise do nothing.

    Parameters
    ----------
    name : str
        Of the executable.
    purpose : str
        One sentence.
    parameters : dict of str to str
        Private parameter, without ``~`` -> what it is, with its unit and default.
    arguments : sequence of str, optional
        Words after the executable's name; by default those of this process.

    Raises
    ------
    SystemExit
        After the help text.
    """
    width = max(map(len, parameters))
    listed = "\n".join("  %s  %s" % (("_%s:=" % parameter).ljust(width + 3), text)
                       for parameter, text in parameters.items())
    parser = argparse.ArgumentParser(
        prog=name, usage="%(prog)s [-h] [_PARAMETER:=VALUE ...] [NAME:=NEW_NAME ...]", description=purpose,
        epilog="parameters:\n" + listed, allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_known_args(arguments)
