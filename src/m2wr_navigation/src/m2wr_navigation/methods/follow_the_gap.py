# SPDX-License-Identifier: BSD-3-Clause
"""Follow the gap: to the middle of the widest gap ahead, the more the nearer the obstacles are (Sezer, Gokasan 2012).

direction = (alpha / d_min * gap + goal) / (alpha / d_min + 1), with angles from the heading. Not complete: there is no
termination rule but patience.
"""
from __future__ import annotations

import math
from typing import Tuple

import numpy as np

from m2wr_navigation.methods.method import COMMON, Decision, Method, View
from m2wr_navigation.parameters import Parameter

FIELD = np.radians(np.arange(-90.0, 91.0, 3.0))        # the laser sees ahead
_LEAST = 0.02               # m: least distance that counts


class FollowTheGap(Method):
    """Follow the gap."""

    PARAMETERS = dict(COMMON, **{
        "alpha": Parameter(0.5, "m", 0.0, 100.0, "weight of the gap against the goal"),
        "gap_depth": Parameter(1.0, "m", 0.1, 2.0, "a gap is so deep, for the disc of the robot"),
    })

    def decide(self, view: View) -> Decision:
        goal = math.remainder(view.goal_direction - view.yaw, 2.0 * math.pi)
        if self.is_goal_free(view, self.values["gap_depth"]):
            return self.steer(view, view.goal_direction, "towards the goal")
        gap, width = self._widest_gap(view)
        if width == 0:
            return Decision(0.0, math.copysign(0.5 * self.values["max_vel_theta"], goal), reason="no gap: it turns")
        least = max(view.surroundings.nearest(view.x, view.y)[0] - self.radius, _LEAST)
        weight = self.values["alpha"] / least
        return self.steer(view, view.yaw + (weight * gap + goal) / (weight + 1.0), "to the gap")

    def _widest_gap(self, view: View) -> Tuple[float, int]:
        """Return the middle of the widest gap, from the heading [rad], and its width in directions; 0: none."""
        lengths = view.surroundings.free_travel(view.x, view.y, view.yaw + FIELD, self.radius)[0]
        best, begin, width = 0, 0, 0
        for k, is_open in enumerate((lengths >= self.values["gap_depth"]).tolist() + [False]):
            if is_open:
                width += 1
                continue
            if width > best:
                best, begin = width, k - width
            width = 0
        return (float(0.5 * (FIELD[begin] + FIELD[begin + best - 1])), best) if best else (0.0, 0)
