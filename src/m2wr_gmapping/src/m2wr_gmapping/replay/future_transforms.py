# SPDX-License-Identifier: BSD-3-Clause
"""Transforms that are far ahead of time: one of them would push all others out of a buffer."""

JUMP = 1.0      # stamps that much older than those before are a jump back in time, if the next ones are so too [s]


class FarAhead:
    """Finds single transforms whose stamp is far ahead; where a second one follows, time has really gone on.

    Parameters
    ----------
    limit : float
        What is that much later than the one before of the same frame is far ahead [s].
    """

    def __init__(self, limit):
        self._limit = int(1e9 * limit)
        self._newest, self._suspects = {}, set()

    def has(self, child, stamp):
        """Whether the next transform to come, of frame ``child`` at ``stamp`` (genpy.Time), is to be left out."""
        now = stamp.secs * 10**9 + stamp.nsecs
        before = self._newest.get(child)
        if before is not None and now - before > self._limit and child not in self._suspects:
            self._suspects.add(child)
            return True
        self._suspects.discard(child)
        self._newest[child] = now
        return False

    def forget(self):
        """Begin anew: time has jumped."""
        self._newest.clear()
        self._suspects.clear()
