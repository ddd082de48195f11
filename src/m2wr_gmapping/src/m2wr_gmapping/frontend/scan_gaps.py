# SPDX-License-Identifier: BSD-3-Clause
"""Times in which scans are missing: what the robot did then is known from odometry only."""
from __future__ import annotations

import math

from m2wr_gmapping import tuning


class ScanGaps:
    """Notices missing scans, and how unusual that is.

    Attributes
    ----------
    surprise : float
        Negative logarithm of the probability of the longest interval without scans since :meth:`restart`, from how
        often scans were missing so far; 0 if no scan was missing.
    """

    def __init__(self) -> None:
        self.surprise = 0.0
        self._count, self._gaps, self._first, self._last = 0, 0, 0.0, 0.0
        self._steps = self._slips = 0

    def add(self, stamp: float) -> None:
        """Take note of a scan at a time [s]."""
        if self._count > 1:
            usual = (self._last - self._first) / (self._count - 1)
            longer = stamp - self._last - tuning.TRACKING.missing_scan * usual
            if longer > 0.0:
                self._gaps += 1
                # the share of such intervals, and an exponential distribution of their lengths
                if usual > 0.0:         # some logs give several scans one stamp
                    self.surprise = max(self.surprise, longer / usual - math.log(self._gaps / self._count))
        self._first = self._first if self._count else stamp
        self._last, self._count = stamp, self._count + 1

    def restart(self) -> None:
        """Forget the gaps noticed so far, but not how many they were."""
        self.surprise = 0.0

    def allow_turn(self, slipped: bool, still: float) -> bool:
        """Return whether the robot may have been turned in an unknown way since :meth:`restart`.

        Call this once for each processed scan: it counts them, and the slips.

        Scans must be missing while the wheels were at rest for long enough. That must be as improbable as a slip,
        together with a disagreement of laser and odometry afterwards.

        Parameters
        ----------
        slipped : bool
            Whether laser and odometry disagree.
        still : float
            Longest time between two scans in which the wheels were at rest [s].
        """
        self._steps += 1
        self._slips += slipped
        if not self.surprise > 0.0 or still < tuning.TURNS.half_turn:
            return False
        return self.surprise - (math.log(self._slips / self._steps) if slipped else 0.0) > tuning.SLIPS.cost
