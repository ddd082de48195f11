# SPDX-License-Identifier: BSD-3-Clause
"""Times in which scans are missing: what the robot did then is known from odometry only."""
from __future__ import annotations

from m2wr_gmapping import tuning


class ScanGaps:
    """Notices missing scans.

    Attributes
    ----------
    noticed : bool
        Whether scans were missing since :meth:`restart`.
    """

    def __init__(self) -> None:
        self.noticed = False
        self._count, self._first, self._last = 0, 0.0, 0.0

    def add(self, stamp: float) -> None:
        """Take note of a scan at a time [s]."""
        if self._count > 1:
            usual = (self._last - self._first) / (self._count - 1)
            self.noticed |= stamp - self._last > tuning.TRACKING.missing_scan * usual
        self._first = self._first if self._count else stamp
        self._last, self._count = stamp, self._count + 1

    def restart(self) -> None:
        """Forget the gaps noticed so far."""
        self.noticed = False
