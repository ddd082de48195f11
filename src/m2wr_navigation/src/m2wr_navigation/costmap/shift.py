# SPDX-License-Identifier: BSD-3-Clause
"""Moving a grid below its content, for costmaps that follow the robot."""
from __future__ import annotations

from typing import Any

import numpy as np

from m2wr_navigation.costmap.costmap import Costmap


def shifted_cells(cells: Any, rows: int, columns: int, default: int) -> Any:
    """Return an array (H, W) whose first cell has moved by whole cells; its content stays in place.

    Parameters
    ----------
    cells : (H, W) of any type
    rows, columns : int
        By which the first cell moves.
    default : int
        Value of the cells that come in.
    """
    found, (high, wide) = np.full_like(cells, default), cells.shape
    if abs(rows) < high and abs(columns) < wide:
        found[max(0, -rows):high - max(0, rows), max(0, -columns):wide - max(0, columns)] = cells[
            max(0, rows):high - max(0, -rows), max(0, columns):wide - max(0, -columns)]
    return found


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
    costs = shifted_cells(grid.costs, rows, columns, default)
    origin = grid.origin + grid.resolution * np.array([columns, rows], float)
    return Costmap(costs, grid.resolution, origin, grid.frame)
