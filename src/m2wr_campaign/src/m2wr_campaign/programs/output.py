# SPDX-License-Identifier: BSD-3-Clause
"""What a program under test wrote: finds the error that explains why it gave no result."""
from __future__ import annotations

import os
import re

LONGEST = 200               # characters
_ERROR = re.compile(r"^(?:[A-Za-z_][\w.]*(?:Error|Exception)\b|RLException|ResourceNotFound).*$", re.MULTILINE)
_LINE = re.compile(r'File "([^"\n]+)", line (\d+)')


def last_error(text: str) -> str:
    """Return the last error in the output of a Python program, as the end of a sentence; empty if there is none.

    Parameters
    ----------
    text : str
    """
    errors = list(_ERROR.finditer(text))
    if not errors:
        return ""
    places = _LINE.findall(text[:errors[-1].start()])
    where = " ({}, line {})".format(os.path.basename(places[-1][0]), places[-1][1]) if places else ""
    return "; it wrote: {}{}".format(errors[-1].group().strip()[:LONGEST], where)
