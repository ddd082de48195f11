# SPDX-License-Identifier: BSD-3-Clause
"""Detection of scans of a tilted laser, by the roll and pitch of odometry."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_gmapping import tuning

if TYPE_CHECKING:
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import FloatArray


class TiltDetector:
    """Detects scans that were taken while the robot pitched or rolled.

    A braking robot pitches, and its laser may see the floor or other parts of inclined walls. The slope is compared
    with a reference slope, which adapts while the robot drives and stays tilted, as on a ramp. Short pitching does not
    change the reference, however often it happens. Nor does a tilt of a stopped robot, or one that is too steep for a
    ramp.

    Parameters
    ----------
    lift : float
        Greatest vertical displacement of an end point that is accepted [m].
    reach : float
        Greatest range of an end point [m].

    Attributes
    ----------
    is_rocking : bool
        Whether the newest scan was tilted, and the robot is expected to become level again.
    """

    def __init__(self, lift: float, reach: float) -> None:
        self._lift, self._reach = lift, reach
        self._reference = 0.0, 0.0
        self._tilted_distance = 0.0                         # travelled with all scans tilted, none of them too steeply
        self._excess, self._is_tilted = (0.0, 0.0), False
        self.is_rocking = False

    def is_tilted(self, slope: Tuple[float, float], points: FloatArray, distance: float) -> bool:
        """Add one scan.

        Parameters
        ----------
        slope : (2,) float
            Rise of the laser's plane along its x and y [m/m].
        points : (2, H) float64
            End points of the scan, in that plane [m].
        distance : float
            Distance travelled since the scan before [m].

        Returns
        -------
        bool
            Whether the scan is tilted.
        """
        usual_x, usual_y = self._reference
        more_x, more_y = self._excess = slope[0] - usual_x, slope[1] - usual_y
        is_tilted = False
        if (more_x or more_y) and points.shape[1]:
            lifted = np.abs(more_x * points[0] + more_y * points[1]) > self._lift
            is_tilted = float(lifted.mean()) > tuning.TRACKING.affected_share
        tipped = math.hypot(slope[0], slope[1]) > tuning.TRACKING.steepest
        self._tilted_distance = self._tilted_distance + distance if is_tilted and not tipped else 0.0
        self.is_rocking = is_tilted and self._tilted_distance < tuning.TRACKING.tilted_distance
        if not self.is_rocking:
            share = 1.0 - math.exp(-distance / tuning.TRACKING.slope_memory)
            self._reference = usual_x + more_x * share, usual_y + more_y * share
        self._is_tilted = is_tilted
        return is_tilted

    def level_part(self, reading: ScanReading) -> ScanReading:
        """Return the part of the newest scan at the height of the laser, or all of it if the scan is tilted."""
        if self._is_tilted or math.hypot(*self._excess) * self._reach <= self._lift:
            return reading
        return reading.level_part(self._excess, self._lift)
