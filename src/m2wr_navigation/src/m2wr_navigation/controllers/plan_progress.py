# SPDX-License-Identifier: BSD-3-Clause
"""How far a robot has come along its plan."""
from __future__ import annotations

from typing import TYPE_CHECKING, Optional

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

SEARCHED = 2.0              # m: length of the plan in which the nearest pose is searched


class PlanProgress:
    """Remembers the pose of the plan that the robot has passed; it only advances.

    The nearest pose of the whole plan will not do: a plan may come back beside itself, with a wall between.
    """

    def __init__(self) -> None:
        self._passed = 0

    def reset(self) -> None:
        """Begin again: a new plan begins at the robot."""
        self._passed = 0

    def advance(self, plan: FloatArray, pose: FloatArray, reach: float) -> Optional[int]:
        """Return the index of the nearest pose on the part of the plan that comes next.

        A robot that has left the plan, round an obstacle, takes it up where it comes within reach again.

        Parameters
        ----------
        plan : (N, 3) float64
            The same one since :meth:`reset`, in a frame that may have moved [m, m, rad].
        pose : (3,) float64
            Of the robot [m, m, rad].
        reach : float
            Distance from the robot in which the plan is searched [m].

        Returns
        -------
        int or None
            None: no pose that was not passed yet is within reach.
        """
        start = min(self._passed, len(plan) - 1)
        away = np.hypot(plan[start:, 0] - pose[0], plan[start:, 1] - pose[1])
        near = np.flatnonzero(away <= reach)
        if not len(near):
            return None
        first = int(near[0])
        along = np.cumsum(np.hypot(*np.diff(plan[start + first:, :2], axis=0).T))
        last = first + int(np.searchsorted(along, SEARCHED)) + 2
        self._passed = start + first + int(np.argmin(away[first:last]))
        return self._passed
