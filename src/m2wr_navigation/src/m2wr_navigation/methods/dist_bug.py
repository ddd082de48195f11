# SPDX-License-Identifier: BSD-3-Clause
"""DistBug: leave as soon as the free way towards the goal leads nearer than any place before (Kamon, Rivlin 1997).

Complete. The condition is d(goal) - F <= d_min - step, where F is the free way towards the goal in sight. The goal
cannot be reached if the robot comes back to the hit point.
"""
from __future__ import annotations

import math
from typing import Optional

from m2wr_navigation.methods.boundary import HIT, BoundaryMethod, no_way
from m2wr_navigation.methods.method import Decision, View

STEP = 0.3                  # m: progress that a new leave point has to make at least


class DistBug(BoundaryMethod):
    """DistBug."""

    def restart(self) -> None:
        super().restart()
        self._least = math.inf

    def hit(self, view: View) -> None:
        self._least = view.goal_distance

    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        assert self.circuit is not None
        free = self.travel(view, view.goal_direction)[0]
        seen = min(free, self.values["sight"] - self.radius, view.goal_distance)
        if free >= min(HIT, view.goal_distance) and view.goal_distance - seen <= self._least - STEP \
                or seen >= view.goal_distance:
            return self.leave(view, "the free way leads nearer to the goal than any place before")
        self._least = min(self._least, view.goal_distance)
        return no_way(view, self.circuit) if closed else None
