# SPDX-License-Identifier: BSD-3-Clause
"""Ties a process to the one that starts it.  Apart from the rest, so that who needs only this starts quickly."""
from __future__ import annotations

import shutil

TYPE_CHECKING = False       # as typing has it, whose import takes longer than all the rest
if TYPE_CHECKING:
    from typing import Iterable, List


def tied(words: Iterable[str]) -> List[str]:
    """Return a command that is told to end (SIGTERM) when the thread that starts it is gone, even by SIGKILL.

    Without the program setpriv (util-linux) the command is what it was.
    """
    program = shutil.which("setpriv")
    return ([program, "--pdeathsig", "TERM"] if program else []) + list(words)
