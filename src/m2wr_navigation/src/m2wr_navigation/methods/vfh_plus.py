# SPDX-License-Identifier: BSD-3-Clause
"""VFH+: the best opening of a polar histogram of the obstacles nearby (Ulrich, Borenstein 1998).

Each point adds a - b d^2 to the sectors that the robot, enlarged by a margin, cannot enter: asin(radius / d) to both
sides. Two thresholds make a sector free or blocked. The cost of a direction is 5 to the goal, 2 to the heading and 2 to
the previous direction, times the angles. m2wr turns on the spot, so that no sector is masked by its turning circle. Not
complete: there is no termination rule but patience.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List

import numpy as np

from m2wr_navigation.methods.method import COMMON, Decision, Method, View
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray

SECTORS = 72
WIDTH = 2.0 * math.pi / SECTORS         # rad
WIDE = 16                   # sectors: a wider opening has candidates at both sides
TO_GOAL, TO_HEADING, TO_PREVIOUS = 5.0, 2.0, 2.0


class VfhPlus(Method):
    """VFH+."""

    PARAMETERS = dict(COMMON, **{
        "window": Parameter(1.5, "m", 0.2, 2.5, "obstacles farther away do not count"),
        "threshold_low": Parameter(2.0, "", 0.0, 1000.0, "a sector below is free"),
        "threshold_high": Parameter(4.0, "", 0.0, 1000.0, "a sector above is blocked; between, it stays as it was"),
    })

    def restart(self) -> None:
        self._blocked: BoolArray = np.zeros(SECTORS, bool)
        self._previous = math.nan

    def decide(self, view: View) -> Decision:
        histogram = self._histogram(view)
        self._blocked = np.where(histogram > self.values["threshold_high"], True,
                                 np.where(histogram < self.values["threshold_low"], False, self._blocked))
        candidates = self._candidates(view.goal_direction)
        if not candidates:
            return Decision(0.0, 0.5 * self.values["max_vel_theta"], reason="no opening: the robot turns")
        before = view.yaw if math.isnan(self._previous) else self._previous
        costs = [TO_GOAL * _between(one, view.goal_direction) + TO_HEADING * _between(one, view.yaw)
                 + TO_PREVIOUS * _between(one, before) for one in candidates]
        self._previous = candidates[int(np.argmin(costs))]
        return self.steer(view, self._previous, "to an opening")

    def _histogram(self, view: View) -> FloatArray:
        """Return the sum of the weights in each sector (SECTORS,); sector 0 begins at the direction 0."""
        points, window = view.surroundings.points, self.values["window"]
        across, up = points[:, 0] - view.x, points[:, 1] - view.y
        far = np.hypot(across, up)
        near = far < min(window, view.goal_distance + self.radius)
        far, bearing = far[near], np.arctan2(up[near], across[near])
        weight = 1.0 - (far / (1.1 * window)) ** 2
        half = np.arcsin(np.minimum(self.radius / np.maximum(far, 1e-6), 1.0))
        centres = (np.arange(SECTORS) + 0.5) * WIDTH
        away = np.abs((centres[:, None] - bearing[None, :] + math.pi) % (2.0 * math.pi) - math.pi)
        return np.sum(np.where(away <= half[None, :], weight[None, :], 0.0), axis=1)

    def _candidates(self, goal: float) -> List[float]:
        """Return the directions that openings offer [rad]."""
        free = ~self._blocked
        if free.all():
            return [goal]
        found: List[float] = []
        begins = np.flatnonzero(free & ~np.roll(free, 1))
        for begin in begins.tolist():
            count = 1
            while free[(begin + count) % SECTORS]:
                count += 1
            right, left = begin * WIDTH, (begin + count) * WIDTH
            if count <= WIDE:
                found.append(0.5 * (right + left))
                continue
            margin = 0.5 * WIDE * WIDTH
            found += [right + margin, left - margin]
            if (goal - right - margin) % (2.0 * math.pi) <= left - right - 2.0 * margin:
                found.append(goal)      # between the candidates of both sides
        return found


def _between(one: float, two: float) -> float:
    """Return the angle between two directions [rad]."""
    return abs(math.remainder(one - two, 2.0 * math.pi))
