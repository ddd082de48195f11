# SPDX-License-Identifier: BSD-3-Clause
"""Ties a process to the one that starts it.  A module of its own, because it is quick to import."""
from __future__ import annotations

import shutil

TYPE_CHECKING = False       # as in typing, whose import takes longer than the rest of this module
if TYPE_CHECKING:
    from typing import Iterable, List


def tied(words: Iterable[str]) -> List[str]:
    """Return a command that receives SIGTERM when the thread that started it ends, even by SIGKILL.

    Without the program setpriv (util-linux) the command is returned unchanged.
    """
    program = shutil.which("setpriv")
    return ([program, "--pdeathsig", "TERM"] if program else []) + list(words)
