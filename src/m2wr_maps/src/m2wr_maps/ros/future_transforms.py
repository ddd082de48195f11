# SPDX-License-Identifier: BSD-3-Clause
"""What the stamps of transforms say: single ones far ahead of time, and whether time has jumped back."""
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


class LatestStamps:
    """The newest and the last stamp of each frame's transforms: together they say whether time has jumped back.

    Scans alone do not: two of them that arrive late look like a jump.
    """

    def __init__(self) -> None:
        self._newest: Dict[str, int] = {}       # [ns], by child frame
        self._last: Dict[str, int] = {}

    def put(self, child: str, stamp: genpy.Time) -> None:
        """Take a transform that is not static.

        Parameters
        ----------
        child : str
            Its child frame.
        stamp : genpy.Time
        """
        now = stamp.to_nsec()
        self._last[child] = now
        self._newest[child] = max(now, self._newest.get(child, now))

    def allow_jump(self) -> bool:
        """Return whether the last transform of a frame is older than one before, or there are no transforms."""
        return not self._last or any(self._newest[child] - last > 1e9 * JUMP for child, last in self._last.items())

    def forget(self) -> None:
        """Reset after a jump in time."""
        self._newest.clear()
        self._last.clear()
