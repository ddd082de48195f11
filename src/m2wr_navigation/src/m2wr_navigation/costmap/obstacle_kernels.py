# SPDX-License-Identifier: BSD-3-Clause
"""Marking of obstacle points and clearing of the cells between the sensor and them."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import FREE, LETHAL
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray, Uint8Array


STRAIGHT = 0.97             # cosine of the angle between two parts of a surface: 14 degrees
MOST_WALLS = 200_000        # cells that a scan keeps


@kernel
def _extend(bounds: IndexArray, row: int, column: int) -> None:
    """Grow bounds (top, bottom, left, right), ends excluded, to hold a cell."""
    bounds[0], bounds[1] = min(bounds[0], row), max(bounds[1], row + 1)
    bounds[2], bounds[3] = min(bounds[2], column), max(bounds[3], column + 1)


@kernel
def mark(costs: Uint8Array, resolution: float, origin: FloatArray, points: FloatArray, sensor: FloatArray,
         obstacle_range: float, lowest: float, highest: float, bounds: IndexArray) -> int:
    """Make the cells of points lethal.

    Parameters
    ----------
    costs : (H, W) uint8
        Changed.
    resolution : float
        [m]
    origin : (2,) float64
        Corner of cell (0, 0) [m].
    points : (N, 3) float64
        In the frame of the grid [m].
    sensor : (3,) float64
        Position of the sensor in this frame [m].
    obstacle_range : float
        Points at this distance from the sensor or farther are ignored [m].
    lowest, highest : float
        Points below or above are ignored [m].
    bounds : (4,) int64
        Grown to hold the marked cells: top, bottom, left, right, ends excluded.

    Returns
    -------
    int
        Number of points that were marked.
    """
    marked = 0
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        if not lowest <= z <= highest:
            continue
        square = (x - sensor[0]) ** 2 + (y - sensor[1]) ** 2 + (z - sensor[2]) ** 2
        if not square < obstacle_range * obstacle_range:
            continue
        across, up = (x - origin[0]) / resolution, (y - origin[1]) / resolution
        if not (0.0 <= across < costs.shape[1] and 0.0 <= up < costs.shape[0]):
            continue
        row, column = int(up), int(across)
        costs[row, column] = LETHAL
        _extend(bounds, row, column)
        marked += 1
    return marked


@kernel
def _clear_line(costs: Uint8Array, row: int, column: int, last_row: int, last_column: int, share: float) -> None:
    """Free the cells of Bresenham's line; at most ``share`` of it, the end cell excluded."""
    rows, columns = last_row - row, last_column - column
    steps_row, steps_column = abs(rows), abs(columns)
    down = 1 if rows >= 0 else -1
    right = 1 if columns >= 0 else -1
    steps = max(steps_row, steps_column)
    count = min(steps, int(share * steps))
    error = steps // 2
    for _ in range(count):
        costs[row, column] = FREE
        if steps_column >= steps_row:
            column += right
            error += steps_row
            if error >= steps:
                row += down
                error -= steps
        else:
            row += down
            error += steps_column
            if error >= steps:
                column += right
                error -= steps


@kernel
def _clip(at: float, to: float, limit: float) -> float:
    """Return the share of the way from ``at`` (inside) to ``to`` that stays within 0 and ``limit``."""
    if to < 0.0:
        return at / (at - to)
    if to > limit:
        return (limit - at) / (to - at)
    return 1.0


@kernel
def clear(costs: Uint8Array, resolution: float, origin: FloatArray, points: FloatArray, sensor: FloatArray,
          raytrace_range: float, bounds: IndexArray) -> int:
    """Free the cells between a sensor and points, the cells of the points excluded.

    Parameters
    ----------
    costs : (H, W) uint8
        Changed.
    resolution : float
        [m]
    origin : (2,) float64
        Corner of cell (0, 0) [m].
    points : (N, 3) float64
        In the frame of the grid [m]; their heights are not used. Points outside the grid clear up to its edge.
    sensor : (3,) float64
        Position of the sensor in this frame [m].
    raytrace_range : float
        Greatest distance that is cleared, rounded up to whole cells [m].
    bounds : (4,) int64
        Grown to hold the lines: top, bottom, left, right, ends excluded.

    Returns
    -------
    int
        Number of lines; 0 if the sensor is outside the grid.
    """
    columns, rows = costs.shape[1], costs.shape[0]
    across, up = (sensor[0] - origin[0]) / resolution, (sensor[1] - origin[1]) / resolution
    if not (0.0 <= across < columns and 0.0 <= up < rows):
        return 0
    row, column = int(up), int(across)
    _extend(bounds, row, column)
    reach = math.ceil(raytrace_range / resolution)
    lines = 0
    for k in range(points.shape[0]):
        to_across, to_up = (points[k, 0] - origin[0]) / resolution, (points[k, 1] - origin[1]) / resolution
        if not (math.isfinite(to_across) and math.isfinite(to_up)):
            continue
        inside = min(_clip(across, to_across, columns - 1e-6), _clip(up, to_up, rows - 1e-6))
        last_column = min(max(int(across + inside * (to_across - across)), 0), columns - 1)
        last_row = min(max(int(up + inside * (to_up - up)), 0), rows - 1)
        length = math.hypot(last_column - column, last_row - row)
        share = 1.0 if length <= reach else reach / length
        _clear_line(costs, row, column, last_row, last_column, share)
        _extend(bounds, row + int(share * (last_row - row)), column + int(share * (last_column - column)))
        lines += 1
    return lines


@kernel
def _is_surface(points: FloatArray, k: int, sensor: FloatArray, reach: float, widest: float, near: float) -> bool:
    """Return whether points k and k + 1, of neighbouring beams, are on one surface: close, or in line with another."""
    x, y = points[k, 0] - sensor[0], points[k, 1] - sensor[1]
    to_x, to_y = points[k + 1, 0] - sensor[0], points[k + 1, 1] - sensor[1]
    if not (math.hypot(x, y) < reach and math.hypot(to_x, to_y) < reach
            and abs(math.atan2(x * to_y - y * to_x, x * to_x + y * to_y)) <= widest):
        return False
    across, up = to_x - x, to_y - y
    length = math.hypot(across, up)
    if length <= near:
        return True
    for other in (k - 1, k + 1):
        if 0 <= other and other + 1 < points.shape[0]:
            beside, above = points[other + 1, 0] - points[other, 0], points[other + 1, 1] - points[other, 1]
            if across * beside + up * above > STRAIGHT * length * math.hypot(beside, above):
                return True
    return False


@kernel
def surface_cells(costs: Uint8Array, resolution: float, origin: FloatArray, points: FloatArray, sensor: FloatArray,
                  reach: float, increment: float) -> IndexArray:
    """Return the lethal cells on surfaces that a scan sees, which its beams along these surfaces must not free.

    A beam that is nearly parallel to a wall crosses cells that the wall only fills in part, or passes them by less
    than a cell; its neighbours end on the same wall.

    Parameters
    ----------
    costs : (H, W) uint8
    resolution : float
        [m]
    origin : (2,) float64
        Corner of cell (0, 0) [m].
    points : (N, 3) float64
        Ends of the beams that hit something, in their order, in the frame of the grid [m].
    sensor : (3,) float64
        Position of the sensor in this frame [m].
    reach, increment : float
        Range within which points count [m], and the angle between two beams [rad].

    Returns
    -------
    (M, 2) int64
        Row and column; cells can occur more than once. At most MOST_WALLS.
    """
    widest, near = 1.5 * abs(increment), 2.0 * resolution
    found, count = np.empty((MOST_WALLS, 2), np.int64), 0
    for k in range(points.shape[0] - 1):
        if not _is_surface(points, k, sensor, reach, widest, near):
            continue
        across, up = points[k + 1, 0] - points[k, 0], points[k + 1, 1] - points[k, 1]
        steps = 1 + int(2.0 * math.hypot(across, up) / resolution)
        for step in range(steps + 1):
            at_x = (points[k, 0] + step / steps * across - origin[0]) / resolution
            at_y = (points[k, 1] + step / steps * up - origin[1]) / resolution
            if not (0.0 <= at_x < costs.shape[1] and 0.0 <= at_y < costs.shape[0]):
                continue
            for row in range(max(0, int(at_y) - 1), min(costs.shape[0], int(at_y) + 2)):
                for column in range(max(0, int(at_x) - 1), min(costs.shape[1], int(at_x) + 2)):
                    if costs[row, column] == LETHAL and count < MOST_WALLS:
                        found[count, 0], found[count, 1] = row, column
                        count += 1
    return found[:count].copy()
