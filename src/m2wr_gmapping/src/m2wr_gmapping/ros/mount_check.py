# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of the estimated mount of the laser with the one in the robot's model."""
from __future__ import annotations

import math
from typing import List, Mapping, Sequence, Set

from m2wr_gmapping import tuning

LEAST_OFFSET, LEAST_YAW = tuning.CALIBRATION.reported     # [m, rad]


class MountCheck:
    """Tells once if the laser is mounted otherwise than the model says, by yaw and by position.

    Parameters
    ----------
    base, laser : str
        Frames of the transform in the model, for the text.
    """

    def __init__(self, base: str, laser: str) -> None:
        self._transform = "{} -> {}".format(base, laser)
        self._told: Set[str] = set()

    def messages(self, calibration: Mapping[str, float]) -> List[str]:
        """Return a sentence for each difference that is certain now and was not told before.

        Parameters
        ----------
        calibration : dict of str to float
            Of ``Mapper.calibration``; may be empty.
        """
        found = []
        if self._is_new("yaw", calibration, ("laser_yaw",), LEAST_YAW):
            yaw, deviation = (math.degrees(calibration["laser_yaw" + ending]) for ending in ("", "_deviation"))
            found.append("laser yaw is estimated {:.1f} degree off the mount in the model: correct the transform {} by "
                         "{:+.1f} degree (standard deviation {:.1f})".format(abs(yaw), self._transform, yaw, deviation))
        if self._is_new("position", calibration, ("laser_x", "laser_y"), LEAST_OFFSET):
            x, y = (100.0 * calibration[name] for name in ("laser_x", "laser_y"))
            found.append("laser position is estimated {:.1f} cm off the mount in the model: correct the transform {} "
                         "by x {:+.1f} cm, y {:+.1f} cm (standard deviations {:.1f} and {:.1f}), or odometry is not "
                         "that of the middle of the axle".format(
                             math.hypot(x, y), self._transform, x, y, 100.0 * calibration["laser_x_deviation"],
                             100.0 * calibration["laser_y_deviation"]))
        return found

    def _is_new(self, what: str, calibration: Mapping[str, float], names: Sequence[str], least: float) -> bool:
        """Return whether one of the named values is certain to differ, for the first time."""
        if not calibration or what in self._told:
            return False
        differs = any(abs(calibration[name]) > max(least, tuning.MATCHING.certain * calibration[name + "_deviation"])
                      for name in names)
        if differs:
            self._told.add(what)
        return differs
