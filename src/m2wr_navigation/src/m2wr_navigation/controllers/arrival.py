# SPDX-License-Identifier: BSD-3-Clause
"""When a robot counts as being at its goal: so that a turn to the goal's heading does not lose the position again."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

SLACK = 0.5                 # share of the tolerance by which a robot that has arrived may be moved by its turn
MOST_ARRIVALS = 3           # then the turn itself moves the robot farther than the tolerance


class Arrival:
    """Decides between driving to the goal and turning to its heading.

    A robot whose base frame is not between its wheels is moved by a turn on the spot. With one distance for both
    decisions it would turn, leave the tolerance, drive back, turn, and so on.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin with a new goal."""
        self._inside, self._latched = False, False
        self._arrivals = 0

    def look(self, pose: FloatArray, goal: FloatArray, tolerance: float, latch: bool) -> bool:
        """Return whether only the heading counts now.

        Parameters
        ----------
        pose, goal : (3,) float64
            In one frame [m, m, rad].
        tolerance : float
            ``xy_goal_tolerance`` [m].
        latch : bool
            ``latch_xy_goal_tolerance``: once arrived is enough.
        """
        away = math.hypot(goal[0] - pose[0], goal[1] - pose[1])
        was_inside, self._inside = self._inside, away <= (1.0 + SLACK if self._inside else 1.0) * tolerance
        if self._inside and not was_inside:
            self._arrivals += 1
            self._latched = self._latched or latch or self._arrivals >= MOST_ARRIVALS
        return self._inside or self._latched
