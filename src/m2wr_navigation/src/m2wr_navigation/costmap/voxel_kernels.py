# SPDX-License-Identifier: BSD-3-Clause
"""Columns of voxels: points mark them, rays in space clear them, and their counts make the cost of a cell.

A column is one number. Bit z says that voxel z is not known to be free, bit 16 + z that it is marked: a voxel with the
first bit only is unknown. A ``box`` (5,) float64 is the place of the grid: x, y, z of its least corner, side of a cell,
height of a voxel [m]. ``rules`` (3,) int64 are the voxels of a column, the ``mark_threshold`` and the
``unknown_threshold``.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

from m2wr_navigation.costmap.cost_layout import FREE, LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray, Uint8Array, Uint32Array

UNKNOWN_COLUMN = 0xFFFF     # no voxel is known
EMPTY_COLUMN = 0            # all are free
_INSIDE = 1e-9              # cells: the upper faces of the grid belong to no voxel


@kernel
def _bits(value: int) -> int:
    """Return how many of sixteen bits are set."""
    value = value - ((value >> 1) & 0x5555)
    value = (value & 0x3333) + ((value >> 2) & 0x3333)
    value = (value + (value >> 4)) & 0x0F0F
    return (value + (value >> 8)) & 0x1F


@kernel
def _cost(column: int, rules: IndexArray) -> int:
    """Return the cost of a column: lethal, free or unknown, by the counts of its voxels."""
    marked = column >> 16
    if _bits(marked) > rules[1]:
        return LETHAL
    unknown = column & ~marked & ((1 << rules[0]) - 1)
    return FREE if _bits(unknown) <= rules[2] else NO_INFORMATION


@kernel
def _write(columns: Uint32Array, costs: Uint8Array, row: int, column: int, bits: int, rules: IndexArray,
           bounds: IndexArray) -> None:
    """Give a column other bits and the cost that follows; grow bounds (4,) if the cost changes."""
    columns[row, column] = bits
    cost = _cost(bits, rules)
    if cost != costs[row, column]:
        costs[row, column] = cost
        bounds[0], bounds[1] = min(bounds[0], row), max(bounds[1], row + 1)
        bounds[2], bounds[3] = min(bounds[2], column), max(bounds[3], column + 1)


@kernel
def mark(columns: Uint32Array, costs: Uint8Array, box: FloatArray, rules: IndexArray, points: FloatArray,
         sensor: FloatArray, obstacle_range: float, lowest: float, highest: float, bounds: IndexArray) -> int:
    """Mark the voxels of points. A column with more than ``mark_threshold`` of them is lethal; others keep their costs.

    Parameters
    ----------
    columns : (H, W) uint32
        Changed.
    costs : (H, W) uint8
        Changed.
    box : (5,) float64
        Place of the grid.
    rules : (3,) int64
        Voxels and thresholds.
    points : (N, 3) float64
        In the frame of the grid [m]. Those below the grid mark the lowest voxel, those above it nothing.
    sensor : (3,) float64
        Position of the sensor in this frame [m].
    obstacle_range : float
        Points at this distance from the sensor or farther are ignored [m].
    lowest, highest : float
        Points below or above are ignored [m].
    bounds : (4,) int64
        Grown to hold the changed cells: top, bottom, left, right, ends excluded.

    Returns
    -------
    int
        Number of points that were marked.
    """
    marked = 0
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        across, up, high = (x - box[0]) / box[3], (y - box[1]) / box[3], max((z - box[2]) / box[4], 0.0)
        if not (lowest <= z <= highest and 0.0 <= across < columns.shape[1] and 0.0 <= up < columns.shape[0]
                and high < rules[0]):
            continue
        if not (x - sensor[0]) ** 2 + (y - sensor[1]) ** 2 + (z - sensor[2]) ** 2 < obstacle_range * obstacle_range:
            continue
        row, column = int(up), int(across)
        bits = int(columns[row, column]) | 0x10001 << int(high)
        if _bits(bits >> 16) > rules[1]:
            _write(columns, costs, row, column, bits, rules, bounds)
        else:
            columns[row, column] = bits
        marked += 1
    return marked


@kernel
def _part(at: float, step: float, limit: float, begin: float, end: float) -> Tuple[float, float]:
    """Return the shares of a ray, within begin and end, between which a coordinate is within 0 and a limit."""
    if step == 0.0:
        return (begin, end) if 0.0 <= at < limit else (1.0, 0.0)
    first, last = -at / step, (limit - at) / step
    if first > last:
        first, last = last, first
    return max(begin, first), min(end, last)


@kernel
def _clear_line(columns: Uint32Array, costs: Uint8Array, rules: IndexArray, line: Tuple[float, ...], kept: int,
                bounds: IndexArray) -> None:
    """Free the voxels of a line from x, y, z by steps u, v, w [cells], except one of this flat index.

    One voxel for each step along the axis of most cells: the one that holds the line in the middle of the step.
    """
    x, y, z, u, v, w = line
    rows, wide = columns.shape
    begin, step = x, u
    if abs(v) > abs(step):
        begin, step = y, v
    if abs(w) > abs(step):
        begin, step = z, w
    count = abs(int(begin + step) - int(begin))
    side = 1.0 if step > 0.0 else -1.0
    for k in range(count + 1):
        share = 0.0 if k == 0 else 1.0 if k == count else (math.floor(begin) + k * side + 0.5 - begin) / step
        column = min(max(int(x + share * u), 0), wide - 1)
        row = min(max(int(y + share * v), 0), rows - 1)
        height = min(max(int(z + share * w), 0), rules[0] - 1)
        before = int(columns[row, column])
        after = before & ~(0x10001 << height)
        if after != before and (height * rows + row) * wide + column != kept:
            _write(columns, costs, row, column, after, rules, bounds)


@kernel
def _voxel(x: float, y: float, z: float, columns: Uint32Array, rules: IndexArray) -> int:
    """Return the flat index of the voxel that holds a place [cells]; -1 outside."""
    rows, wide = columns.shape
    if not (0.0 <= x < wide and 0.0 <= y < rows and 0.0 <= z < rules[0]):
        return -1
    return (int(z) * rows + int(y)) * wide + int(x)


@kernel
def clear(columns: Uint32Array, costs: Uint8Array, box: FloatArray, rules: IndexArray, points: FloatArray,
          sensor: FloatArray, reach: float, gap: float, ends: FloatArray, bounds: IndexArray) -> int:
    """Free the voxels between a sensor and points; the part of a ray that lies in the grid counts.

    Parameters
    ----------
    columns : (H, W) uint32
        Changed.
    costs : (H, W) uint8
        Changed.
    box : (5,) float64
        Place of the grid.
    rules : (3,) int64
        Voxels and thresholds.
    points : (N, 3) float64
        In the frame of the grid [m]. Those that are not finite give no ray.
    sensor : (3,) float64
        Position of the sensor in this frame, which may be outside of the grid [m].
    reach : float
        Greatest distance from the sensor that is cleared [m].
    gap : float
        Rays end so far before their points [m]; above 0 they never clear the voxel of their point either.
    ends : (N, 3) float64
        Written: where the rays end [m].
    bounds : (4,) int64
        Grown to hold the changed cells: top, bottom, left, right, ends excluded.

    Returns
    -------
    int
        Number of rays, which is that of the ends.
    """
    rows, wide, rays = columns.shape[0], columns.shape[1], 0
    x, y, z = (sensor[0] - box[0]) / box[3], (sensor[1] - box[1]) / box[3], (sensor[2] - box[2]) / box[4]
    for k in range(points.shape[0]):
        a, b, c = points[k, 0] - sensor[0], points[k, 1] - sensor[1], points[k, 2] - sensor[2]
        distance = math.sqrt(a * a + b * b + c * c)
        if not (math.isfinite(distance) and distance > 0.0):
            continue
        u, v, w = a / box[3], b / box[3], c / box[4]
        begin, end = _part(x, u, wide - _INSIDE, 0.0, min(distance - gap, reach) / distance)
        begin, end = _part(y, v, rows - _INSIDE, begin, end)
        begin, end = _part(z, w, rules[0] - _INSIDE, begin, end)
        if not begin <= end:
            continue
        kept = _voxel(x + u, y + v, z + w, columns, rules) if gap > 0.0 else -1
        length = end - begin
        _clear_line(columns, costs, rules, (x + begin * u, y + begin * v, z + begin * w, length * u, length * v,
                                            length * w), kept, bounds)
        ends[rays, 0], ends[rays, 1], ends[rays, 2] = sensor[0] + end * a, sensor[1] + end * b, sensor[2] + end * c
        rays += 1
    return rays


@kernel
def restate(columns: Uint32Array, costs: Uint8Array, rules: IndexArray, bounds: IndexArray) -> None:
    """Write the costs of all columns of which something is known, after a change of the thresholds.

    Parameters
    ----------
    columns : (H, W) uint32
    costs : (H, W) uint8
        Changed.
    rules : (3,) int64
        Voxels and thresholds.
    bounds : (4,) int64
        Grown to hold the changed cells: top, bottom, left, right, ends excluded.
    """
    for row in range(columns.shape[0]):
        for column in range(columns.shape[1]):
            if columns[row, column] != UNKNOWN_COLUMN:
                _write(columns, costs, row, column, int(columns[row, column]), rules, bounds)
