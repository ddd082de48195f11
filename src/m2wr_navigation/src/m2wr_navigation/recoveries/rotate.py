# SPDX-License-Identifier: BSD-3-Clause
"""``rotate_recovery/RotateRecovery``: a full turn on the spot, so that the sensors see all around."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping

import numpy as np

from m2wr_navigation.parameters import Parameter
from m2wr_navigation.recoveries.collisions import collides, is_turn_free
from m2wr_navigation.recoveries.recovery import Recovery, Step

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation
    from m2wr_navigation.recoveries.recovery import Costmaps

STALLED = 0.1, 4.0          # rad, s: a robot that turns less in this time cannot turn
AHEAD = 1.0                 # rad: part of the turn that must be free


class Rotate(Recovery):
    """Turns to the left; to the right where the left is blocked. Ends with the reason if neither works."""

    PARAMETERS = {
        "sim_granularity": Parameter(0.017, "rad", 0.001, 1.0, "step in which the turn is checked for obstacles"),
        "frequency": Parameter(20.0, "Hz", 0.0, 100.0, "accepted, without effect: commands have the controller's rate"),
        "acc_lim_theta": Parameter(3.2, "rad/s^2", 0.01, 100.0, "angular acceleration to stop"),
        "max_vel_theta": Parameter(1.0, "rad/s", 0.01, 20.0, "greatest rate"),
        "min_in_place_vel_theta": Parameter(0.4, "rad/s", 0.0, 20.0, "least rate"),
        "yaw_goal_tolerance": Parameter(0.1, "rad", 0.001, 3.0, "angle that may be missing at the end"),
    }

    def __init__(self, name: str, values: Mapping[str, Any], costmaps: Costmaps) -> None:
        super().__init__(name, values, costmaps)
        self._turned = self._marked = 0.0
        self._yaw = self._since = 0.0
        self._sense, self._reversed = 1.0, False

    def begin(self, situation: Situation) -> None:
        self._turned = self._marked = 0.0
        self._yaw, self._since = float(situation.pose[2]), situation.stamp
        self._sense, self._reversed = 1.0, False

    def step(self, situation: Situation) -> Step:
        yaw = float(situation.pose[2])
        self._turned += math.remainder(yaw - self._yaw, 2.0 * math.pi)
        self._yaw = yaw
        left = 2.0 * math.pi - abs(self._turned)
        if left <= self.values["yaw_goal_tolerance"]:
            return Step(None, True)
        if abs(self._turned - self._marked) > STALLED[0]:
            self._marked, self._since = self._turned, situation.stamp
        elif situation.stamp - self._since > STALLED[1]:
            return Step(None, True, "{} ends: the robot has turned less than {:g} rad in {:g} s".format(
                self.name, *STALLED))
        if not self._is_free(situation, self._sense, min(left, AHEAD)):
            if self._reversed or not self._is_free(situation, -self._sense, AHEAD):
                return Step(None, True, "{} ends: the robot at ({:.2f}, {:.2f}) would collide in both senses".format(
                    self.name, situation.pose[0], situation.pose[1]))
            self._sense, self._turned, self._marked, self._reversed = -self._sense, 0.0, 0.0, True
            left = 2.0 * math.pi
        rate = math.sqrt(2.0 * self.values["acc_lim_theta"] * left)
        rate = min(max(rate, self.values["min_in_place_vel_theta"]), self.values["max_vel_theta"])
        return Step(np.array([0.0, 0.0, self._sense * rate]), False)

    def _is_free(self, situation: Situation, sense: float, angle: float) -> bool:
        """Return whether the footprint meets no obstacle in a turn by an angle [rad]."""
        return not collides(situation, *situation.pose) and is_turn_free(
            situation, sense * angle, self.values["sim_granularity"])
