# SPDX-License-Identifier: BSD-3-Clause
"""Account of scans: every scan that arrives is used or counted under the reason for which it is not."""
from __future__ import annotations

import threading
from typing import Dict

#: Reasons for which a scan is lost: a warning tells the user.
QUEUE_FULL, NO_TRANSFORM, OUT_OF_ORDER = "queue full", "no transform", "out of order"
TIME_JUMP, BAD_HEADER, REFUSED, UNREADABLE = "jump in time", "bad header", "refused", "unreadable"
#: Scans of the beginning, whose transform was never sent; scans passed over because others wait, none of which is due.
EARLY, PASSED_OVER = "before the first transform", "passed over"
#: Scans that a parameter leaves out, and those that still wait at the end.
THROTTLED, SETTLING, AT_END = "throttle_scans", "settle_time", "waiting at the end"
#: Reasons that the queue of scans gives.
DROPPED = (QUEUE_FULL, NO_TRANSFORM, OUT_OF_ORDER, TIME_JUMP, BAD_HEADER)


class ScanAccount:
    """Counts of scans; several threads may use it.

    Attributes
    ----------
    received : int
        All scans that have arrived.
    """

    def __init__(self) -> None:
        self.received = 0
        self._unused: Dict[str, int] = {}
        self._lock = threading.Lock()

    def leave_out(self, reason: str, count: int = 1) -> int:
        """Count scans that are not used.

        Parameters
        ----------
        reason : str
        count : int
            May be 0, which changes nothing.

        Returns
        -------
        int
            How many there are now for this reason.
        """
        with self._lock:
            found = self._unused.get(reason, 0) + count
            if found:
                self._unused[reason] = found
            return found

    def count(self, *reasons: str) -> int:
        """Return the number of scans that were not used for some reasons."""
        with self._lock:
            return sum(self._unused.get(reason, 0) for reason in reasons)

    @property
    def unused(self) -> Dict[str, int]:
        """Reason -> number of scans, in the order of the reasons' names."""
        with self._lock:
            return dict(sorted(self._unused.items()))

    def text(self) -> str:
        """Return how many scans are not used and why."""
        unused = self.unused
        reasons = ", ".join("{}: {}".format(*item) for item in unused.items())
        return "{} of {} scans not used{}".format(sum(unused.values()), self.received, reasons and " (%s)" % reasons)
