# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2: along the boundary to the line from start to goal, nearer to the goal (Lumelsky, Stepanov 1987).

Complete. The path is at most D + sum of n p / 2: an obstacle of perimeter p is met n times by the line. The goal
cannot be reached if the robot comes back to the hit point. For the report's own Bug 2 see ``motion_plan``.
"""
from __future__ import annotations

import math
from typing import Optional, Tuple

from m2wr_navigation.methods.boundary import HIT, BoundaryMethod, no_way
from m2wr_navigation.methods.method import Decision, View

NEARER = 0.2                # m: the leave point is nearer to the goal than the hit point by so much
ON_LINE = 0.1               # m


class Bug2(BoundaryMethod):
    """Bug 2 with any disc."""

    def restart(self) -> None:
        super().restart()
        self._start: Optional[Tuple[float, float]] = None
        self._hit_distance, self._offset = math.inf, 0.0

    def decide(self, view: View) -> Decision:
        if self._start is None:
            self._start = (view.x, view.y)
        return super().decide(view)

    def hit(self, view: View) -> None:
        self._hit_distance, self._offset = view.goal_distance, self._line_offset(view)

    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        assert self.circuit is not None
        offset = self._line_offset(view)
        crossed = offset * self._offset < 0.0 or abs(offset) < ON_LINE
        self._offset = offset
        if crossed and view.goal_distance < self._hit_distance - NEARER \
                and self.travel(view, view.goal_direction)[0] >= min(HIT, view.goal_distance):
            return self.leave(view, "on the line, {:.2f} m nearer than the hit point".format(
                self._hit_distance - view.goal_distance))
        return no_way(view, self.circuit) if closed else None

    def _line_offset(self, view: View) -> float:
        """Return the distance of the axle from the line, to its left [m]."""
        assert self._start is not None
        run, rise = self.goal[0] - self._start[0], self.goal[1] - self._start[1]
        length = max(math.hypot(run, rise), 1e-9)
        return float((run * (view.y - self._start[1]) - rise * (view.x - self._start[0])) / length)
