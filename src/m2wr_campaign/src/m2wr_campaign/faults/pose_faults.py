# SPDX-License-Identifier: BSD-3-Clause
"""Faults of what the robot knows of its pose."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional

from m2wr_campaign.faults.fault import Fault
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_campaign.faults.fault import Planar


def _moved(pose: Planar, before: Planar) -> Planar:
    """Return a pose in the frame of another one."""
    x, y, yaw = pose[0] - before[0], pose[1] - before[1], math.remainder(pose[2] - before[2], 2.0 * math.pi)
    cosine, sine = math.cos(before[2]), math.sin(before[2])
    return cosine * x + sine * y, cosine * y - sine * x, yaw


def _after(before: Planar, motion: Planar) -> Planar:
    """Return the pose after a motion in the frame of a pose."""
    cosine, sine = math.cos(before[2]), math.sin(before[2])
    return (before[0] + cosine * motion[0] - sine * motion[1], before[1] + sine * motion[0] + cosine * motion[1],
            math.remainder(before[2] + motion[2], 2.0 * math.pi))


class OdometryDrift(Fault):
    """The pose is dead reckoning with systematic errors, as of wheels unlike those that are configured."""

    PARAMETERS = {"distance": Parameter(1.02, "", 0.5, 2.0, "measured distance over the true one"),
                  "rotation": Parameter(1.0, "", 0.5, 2.0, "measured rotation over the true one"),
                  "turn": Parameter(0.01, "rad/m", -1.0, 1.0, "added to the heading with the distance")}
    MOVES_POSE = True

    _true: Optional[Planar] = None
    _told: Planar = (0.0, 0.0, 0.0)

    def pose(self, time: float, pose: Planar) -> Planar:
        if self._true is None:
            self._told = pose
        else:
            ahead, left, turn = _moved(pose, self._true)
            way = math.copysign(math.hypot(ahead, left), ahead)
            factor = self.values["distance"]
            self._told = _after(self._told, (factor * ahead, factor * left,
                                             self.values["rotation"] * turn + self.values["turn"] * way))
        self._true = pose
        return self._told


class PoseJump(Fault):
    """From one moment on the pose is off, as after a wrong match of a localization."""

    PARAMETERS = {"start": Parameter(10.0, "s", 0.0, 1e5, "simulated time of the jump"),
                  "x": Parameter(0.3, "m", -100.0, 100.0, "ahead, in the robot's frame"),
                  "y": Parameter(0.0, "m", -100.0, 100.0, "to the left"),
                  "yaw": Parameter(0.1, "rad", -math.pi, math.pi, "of the heading")}
    MOVES_POSE = True

    _at: Optional[Planar] = None
    _told: Planar = (0.0, 0.0, 0.0)

    def pose(self, time: float, pose: Planar) -> Planar:
        if time < self.values["start"]:
            return pose
        if self._at is None:
            self._at, self._told = pose, _after(pose, (self.values["x"], self.values["y"], self.values["yaw"]))
        return _after(self._told, _moved(pose, self._at))
