# SPDX-License-Identifier: BSD-3-Clause
"""Costs below a footprint, and the cells inside a polygon."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_navigation.costmap.cost_layout import LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Uint8Array

IN_COLLISION, IN_UNKNOWN, OUTSIDE = -1, -2, -3


@kernel
def line_cost(costs: Uint8Array, row: int, column: int, last_row: int, last_column: int) -> int:
    """Return the greatest cost on Bresenham's line between two cells, both included; negative: see outline_cost.

    Parameters
    ----------
    costs : (H, W) uint8
    row, column : int
        First cell, within the grid.
    last_row, last_column : int
        Last cell, within the grid.
    """
    down = 1 if last_row >= row else -1
    right = 1 if last_column >= column else -1
    rows, columns = abs(last_row - row), abs(last_column - column)
    error = columns - rows
    greatest = 0
    while True:
        cost = int(costs[row, column])
        if cost == LETHAL:
            return IN_COLLISION
        if cost == NO_INFORMATION:
            return IN_UNKNOWN
        greatest = max(greatest, cost)
        if row == last_row and column == last_column:
            return greatest
        twice = 2 * error
        if twice > -rows:
            error -= rows
            column += right
        if twice < columns:
            error += columns
            row += down


@kernel
def outline_cost(costs: Uint8Array, resolution: float, origin: FloatArray, footprint: FloatArray, x: float, y: float,
                 yaw: float) -> int:
    """Return the greatest cost below the outline of a footprint, as ``CostmapModel::footprintCost``.

    Parameters
    ----------
    costs : (H, W) uint8
    resolution : float
        [m]
    origin : (2,) float64
        Corner of cell (0, 0) [m].
    footprint : (K, 2) float64
        Corners in the base frame [m].
    x, y, yaw : float
        Pose of the base in the frame of the grid [m, m, rad].

    Returns
    -------
    int
        0 to 253; IN_COLLISION if a cell is lethal, IN_UNKNOWN if one is unknown, OUTSIDE if a corner is off the grid.
    """
    cosine, sine = math.cos(yaw), math.sin(yaw)
    count = footprint.shape[0]
    row = column = 0
    greatest = 0
    for k in range(count + 1):
        a, b = footprint[k % count, 0], footprint[k % count, 1]
        across = (x + cosine * a - sine * b - origin[0]) / resolution
        up = (y + sine * a + cosine * b - origin[1]) / resolution
        if not (0.0 <= across < costs.shape[1] and 0.0 <= up < costs.shape[0]):
            return OUTSIDE
        next_row, next_column = int(up), int(across)
        if k > 0:
            cost = line_cost(costs, row, column, next_row, next_column)
            if cost < 0:
                return cost
            greatest = max(greatest, cost)
        row, column = next_row, next_column
    return greatest


@kernel
def fill_polygon(costs: Uint8Array, resolution: float, origin: FloatArray, corners: FloatArray, value: int) -> int:
    """Write a value into the cells whose centres lie in a polygon.

    Parameters
    ----------
    costs : (H, W) uint8
        Changed.
    resolution : float
        [m]
    origin : (2,) float64
        Corner of cell (0, 0) [m].
    corners : (K, 2) float64
        In the frame of the grid [m]. The polygon need not be convex.
    value : int
        0 to 255

    Returns
    -------
    int
        Number of the cells.
    """
    low, high = corners[0, 1], corners[0, 1]
    left, right = corners[0, 0], corners[0, 0]
    for k in range(corners.shape[0]):
        low, high = min(low, corners[k, 1]), max(high, corners[k, 1])
        left, right = min(left, corners[k, 0]), max(right, corners[k, 0])
    first = max(0, int(math.floor((low - origin[1]) / resolution)))
    last = min(costs.shape[0] - 1, int(math.floor((high - origin[1]) / resolution)))
    begin = max(0, int(math.floor((left - origin[0]) / resolution)))
    end = min(costs.shape[1] - 1, int(math.floor((right - origin[0]) / resolution)))
    filled = 0
    for row in range(first, last + 1):
        y = origin[1] + (row + 0.5) * resolution
        for column in range(begin, end + 1):
            x = origin[0] + (column + 0.5) * resolution
            inside = False
            before = corners.shape[0] - 1
            for k in range(corners.shape[0]):
                if (corners[k, 1] > y) != (corners[before, 1] > y):
                    share = (y - corners[k, 1]) / (corners[before, 1] - corners[k, 1])
                    if x < corners[k, 0] + share * (corners[before, 0] - corners[k, 0]):
                        inside = not inside
                before = k
            if inside:
                costs[row, column] = value
                filled += 1
    return filled
