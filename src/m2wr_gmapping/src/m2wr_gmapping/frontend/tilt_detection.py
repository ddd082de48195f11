# SPDX-License-Identifier: BSD-3-Clause
"""Whether the laser is level: odometry that knows of roll and pitch tells when a robot rocks."""
import math

import numpy as np

TILTED_SHARE = 0.3          # of a scan's end points that are lifted too far
MAX_TILTED_DISTANCE = 1.0                 # a robot that rocks while it drives is level again within so much way [m]
MAX_SLOPE = 0.2              # no ramp rises more than that a metre: the robot has tipped over, or leans on a wall
MEMORY = 10.0               # way in which what is usual follows: a ramp, or a level that is a little off [m]


class TiltDetector:
    """Tells scans that were taken while the robot rocked from those that were not.

    A robot that brakes nods; its laser then looks at the floor, or at walls that lean where they lean. What counts is
    the slope against the usual one, which follows where a robot drives on and stays tilted. Nods are not usual however
    many there are: they all lead the same way, and would make level scans tilted ones. Nor is what lasts while the
    robot stays where it is, or is too steep: it leans against something.

    Parameters
    ----------
    lift : float
        End points that much above or below where they would be else show something else [m].
    reach : float
        No end point lies farther away [m].

    Attributes
    ----------
    rocks : bool
        Whether the newest scan was tilted, and the robot does not stay so.
    """

    def __init__(self, lift, reach):
        self._lift, self._reach = lift, reach
        self._reference = 0.0, 0.0
        self._tilted_distance = 0.0                         # with all scans tilted, and none of them too much
        self._excess, self._is_tilted = (0.0, 0.0), False
        self.is_rocking = False

    def is_tilted(self, slope, points, distance):
        """Take in one scan; return whether it is tilted.

        Parameters
        ----------
        slope : (2,) float
            Rise of the laser's plane a metre, along its x and y.
        points : (2, H) float64
            End points of the scan, in that plane [m].
        distance : float
            Way since the scan before [m].
        """
        usual_x, usual_y = self._reference
        more_x, more_y = self._excess = slope[0] - usual_x, slope[1] - usual_y
        is_tilted = False
        if (more_x or more_y) and points.shape[1]:
            lifted = np.abs(more_x * points[0] + more_y * points[1]) > self._lift
            is_tilted = float(lifted.mean()) > TILTED_SHARE
        tipped = math.hypot(slope[0], slope[1]) > MAX_SLOPE
        self._tilted_distance = self._tilted_distance + distance if is_tilted and not tipped else 0.0
        self.is_rocking = is_tilted and self._tilted_distance < MAX_TILTED_DISTANCE
        if not self.is_rocking:
            share = 1.0 - math.exp(-distance / MEMORY)
            self._reference = usual_x + more_x * share, usual_y + more_y * share
        self._is_tilted = is_tilted
        return is_tilted

    def level_part(self, reading):
        """Return what the newest scan, a ScanReading, shows at the height of the laser; all of it if it is tilted."""
        if self._is_tilted or math.hypot(*self._excess) * self._reach <= self._lift:
            return reading
        return reading.level_part(self._excess, self._lift)
