"""Whether the laser is level: odometry that knows of roll and pitch tells when a robot rocks."""
import math

import numpy as np

TILTED_SHARE = 0.3          # of a scan's end points that are lifted too far
MEMORY = 20.0               # time by which what is usual follows: a ramp, or a level that is a little off [s]


class LevelWatch:
    """Tells scans that were taken while the robot rocked from those that were not.

    A robot that brakes nods; its laser then looks at the floor, or at walls that lean where they lean. What counts is
    the slope against the usual one.

    Parameters
    ----------
    lift : float
        End points that much above or below where they would be else show something else [m].
    """

    def __init__(self, lift):
        self._lift = lift
        self._usual = np.zeros(2)
        self._stamp = None

    def tilted(self, slope, points, stamp):
        """Take in one scan; return whether it is tilted.

        Parameters
        ----------
        slope : (2,) float
            Rise of the laser's plane a metre, along its x and y.
        points : (2, H) float64
            End points of the scan, in that plane [m].
        stamp : float
            Time of the scan [s]; growing.
        """
        more = np.asarray(slope, float) - self._usual
        if self._stamp is not None:
            self._usual = self._usual + more * (1.0 - math.exp(-max(stamp - self._stamp, 0.0) / MEMORY))
        self._stamp = stamp
        if not more.any() or not points.shape[1]:
            return False
        lifted = np.abs(more[0] * points[0] + more[1] * points[1]) > self._lift
        return bool(lifted.mean() > TILTED_SHARE)
