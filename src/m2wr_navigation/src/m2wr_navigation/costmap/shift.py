# SPDX-License-Identifier: BSD-3-Clause
"""Moving a grid below its content, for costmaps that follow the robot."""
from __future__ import annotations

import numpy as np

from m2wr_navigation.costmap.costmap import Costmap


def shifted(grid: Costmap, rows: int, columns: int, default: int) -> Costmap:
    """Return a grid whose origin has moved by whole cells; its content stays in place.

    Parameters
    ----------
    grid : Costmap
    rows, columns : int
        By which the origin moves, along y and x.
    default : int
        Cost of the cells that come in.
    """
    costs = np.full(grid.costs.shape, default, np.uint8)
    high, wide = grid.costs.shape
    if abs(rows) < high and abs(columns) < wide:
        costs[max(0, -rows):high - max(0, rows), max(0, -columns):wide - max(0, columns)] = grid.costs[
            max(0, rows):high - max(0, -rows), max(0, columns):wide - max(0, -columns)]
    origin = grid.origin + grid.resolution * np.array([columns, rows], float)
    return Costmap(costs, grid.resolution, origin, grid.frame)
