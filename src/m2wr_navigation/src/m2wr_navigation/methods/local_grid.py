# SPDX-License-Identifier: BSD-3-Clause
"""A costmap around the robot of the obstacle points that its laser saw."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.inflation_kernels import cost_table, inflate

if TYPE_CHECKING:
    from m2wr_navigation.methods.method import View

CELLS, RESOLUTION = 120, 0.05           # 6 x 6 m
SIDE = CELLS * RESOLUTION               # m
INFLATION = 1.0                         # m


def local_grid(view: View, radius: float, scaling: float) -> Costmap:
    """Return the costmap, in the odometry frame.

    Parameters
    ----------
    view : View
    radius : float
        A robot whose centre is so near to a point is in contact [m].
    scaling : float
        Decay of the costs beyond [1/m].
    """
    origin = np.array([view.x - 0.5 * SIDE, view.y - 0.5 * SIDE])
    costmap = Costmap.filled((CELLS, CELLS), RESOLUTION, origin, 0, "odom")
    cells = ((view.surroundings.points - origin) / RESOLUTION).astype(np.int64)
    cells = cells[((cells >= 0) & (cells < CELLS)).all(axis=1)]
    costmap.costs[cells[:, 1], cells[:, 0]] = LETHAL
    reach = int(math.ceil(INFLATION / RESOLUTION))
    inflate(costmap.costs, cost_table(reach, RESOLUTION, radius, scaling), reach, 0, CELLS, 0, CELLS, False)
    return costmap
