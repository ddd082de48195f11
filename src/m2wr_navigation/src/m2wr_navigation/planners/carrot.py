# SPDX-License-Identifier: BSD-3-Clause
"""``carrot_planner/CarrotPlanner``: straight to the goal, or as near to it as the robot can stand on that line."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import INSCRIBED
from m2wr_navigation.parameters import Parameter
from m2wr_navigation.planners.planner import Plan, Planner, PlanningError, cell_of

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray


class Carrot(Planner):
    """carrot_planner. The goal is moved towards the robot, in steps, until its cell is free."""

    PARAMETERS = {
        "step_size": Parameter(0.0, "m", 0.0, 100.0, "step along the line; 0: the resolution of the map", False),
        "min_dist_from_robot": Parameter(0.1, "m", 0.0, 100.0, "a nearer goal is not taken", False),
    }

    def search(self, costmap: Costmap, start: FloatArray, goal: FloatArray, tolerance: float) -> Plan:
        cell_of(costmap, start, "start")
        cell_of(costmap, goal, "goal")
        step = self.values["step_size"] or costmap.resolution
        away = start[:2] - goal[:2]
        length = float(np.hypot(*away))
        for k in range(int(math.floor(length / step)) + 1):
            target = goal[:2] + (away * (k * step / length) if length > 0.0 else 0.0)
            if length - k * step < self.values["min_dist_from_robot"] and k > 0:
                break
            cost = costmap.cost_at(*target)
            if cost is not None and cost < INSCRIBED:
                return Plan(np.array([[*start[:2], start[2]], [*target, goal[2]]]))
        raise PlanningError("no cell on the line from the goal ({:.2f}, {:.2f}) to the robot ({:.2f}, {:.2f}) is "
                            "free".format(goal[0], goal[1], start[0], start[1]))
