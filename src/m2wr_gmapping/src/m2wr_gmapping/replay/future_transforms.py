# SPDX-License-Identifier: BSD-3-Clause
"""Detection of single transforms far ahead of time: one of them would remove all others from a buffer."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict, Set

if TYPE_CHECKING:
    import genpy

JUMP = 1.0      # stamps older by more than this are a jump back in time, if the next ones are too [s]


class FarAhead:
    """Finds single transforms with a stamp far ahead; a second one means that time has advanced.

    Parameters
    ----------
    limit : float
        Greatest difference to the transform before of the same frame [s].
    """

    def __init__(self, limit: float) -> None:
        self._limit = int(1e9 * limit)
        self._newest: Dict[str, int] = {}       # stamp [ns], by child frame
        self._suspects: Set[str] = set()

    def has(self, child: str, stamp: genpy.Time) -> bool:
        """Return whether the next transform should be ignored.

        Parameters
        ----------
        child : str
            Its child frame.
        stamp : genpy.Time
        """
        now = stamp.secs * 10**9 + stamp.nsecs
        before = self._newest.get(child)
        if before is not None and now - before > self._limit and child not in self._suspects:
            self._suspects.add(child)
            return True
        self._suspects.discard(child)
        self._newest[child] = now
        return False

    def forget(self) -> None:
        """Reset after a jump in time."""
        self._newest.clear()
        self._suspects.clear()
