# SPDX-License-Identifier: BSD-3-Clause
"""Detection of motion that odometry does not report, by a comparison of scans."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.scan_kernels import changed_sectors, profile

if TYPE_CHECKING:
    from m2wr_gmapping.frontend.scan import ScanReading

SECTORS = 36                # of a full circle: a laser that turns by a sector is noticed


class ViewMemory:
    """Tells whether the laser sees something else than at the last match, although the wheels do not turn.

    A robot that is carried or pushed, or whose wheels slip, moves without odometry. Then scans have to be matched.
    """

    def __init__(self) -> None:
        self._seen, self._now = np.zeros(SECTORS), np.zeros(SECTORS)

    def remember(self, reading: ScanReading) -> None:
        """Remember the scan of the newest match."""
        profile(reading.rays, self._seen)

    def has_changed(self, reading: ScanReading) -> bool:
        """Return whether a scan differs clearly from the remembered one."""
        profile(reading.rays, self._now)
        changed, present = changed_sectors(self._seen, self._now, tuning.TRACKING.sector_change)
        return bool(changed > tuning.TRACKING.affected_share * present)
