# SPDX-License-Identifier: BSD-3-Clause
"""Ties a process to the one that starts it.  A module of its own, because it is quick to import."""
from __future__ import annotations

import os
import shutil

TYPE_CHECKING = False       # as in typing, whose import takes longer than the rest of this module
if TYPE_CHECKING:
    from typing import Iterable, List


# The signal is asked for after the start; a starter that has ended by then would never send it.
_IF_PARENT_RUNS = 'test "$PPID" = "$0" || exit 143; exec "$@"'


def tied(words: Iterable[str]) -> List[str]:
    """Return a command that receives SIGTERM when the thread that started it ends, even by SIGKILL.

    The command does not start at all if this process has ended before.  Without the program setpriv (util-linux) the
    command is returned unchanged.
    """
    program = shutil.which("setpriv")
    guard = [program, "--pdeathsig", "TERM", "sh", "-c", _IF_PARENT_RUNS, str(os.getpid())] if program else []
    return guard + list(words)
