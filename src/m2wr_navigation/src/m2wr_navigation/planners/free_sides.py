# SPDX-License-Identifier: BSD-3-Clause
"""Room for the width of a robot that cannot drive to the side.

Costs keep the origin of the base frame at the inscribed radius from obstacles. Where the footprint is not centred about
the origin, that is less than half its width: a robot with its axle near its front end has 4 cm, and is 20 cm wide.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import INSCRIBED
from m2wr_navigation.costmap.inflation_kernels import GREATEST_RADIUS, cost_table, inflate

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray


def with_free_sides(costmap: Costmap, goal: FloatArray) -> Costmap:
    """Return a costmap in which cells within ``costmap.beside`` of lethal ones are inscribed, too, but not at the goal.

    At its goal the robot may stand with its front nearer to a wall than half its width.

    Parameters
    ----------
    costmap : Costmap
        Not changed.
    goal : (3,) float64
        [m, m, rad]
    """
    changed = costmap.copy()
    radius = min(int(math.ceil(costmap.beside / costmap.resolution)), GREATEST_RADIUS)
    table = cost_table(radius, costmap.resolution, costmap.beside, 0.0)
    table[table < INSCRIBED] = 0
    inflate(changed.costs, table, radius, 0, costmap.rows, 0, costmap.columns, False)
    cell = costmap.cell(goal[0], goal[1])
    if cell is not None:
        top, left = max(0, cell[0] - radius), max(0, cell[1] - radius)
        window = np.s_[top:cell[0] + radius + 1, left:cell[1] + radius + 1]
        rows, columns = np.indices(costmap.costs[window].shape)
        near = (rows + top - cell[0]) ** 2 + (columns + left - cell[1]) ** 2 <= radius * radius
        changed.costs[window][near] = costmap.costs[window][near]
    return changed
