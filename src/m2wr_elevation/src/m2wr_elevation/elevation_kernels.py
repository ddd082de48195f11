# SPDX-License-Identifier: BSD-3-Clause
"""Kernels of the elevation map: points into heights, and heights into slope, step and roughness.

Grids are (rows, columns), rows along y from the least y on, columns along x; unknown cells are nan.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

from m2wr_navigation.planners.heap_kernels import pop, push
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]
    Floats = NDArray[Any]

_GATE = 3.0             # standard deviations within which a point is of the same height as its cell
_FADED = 4              # times in a row that a cell is seen far below its height before it takes the lower one


@kernel
def fuse(points: Floats, pose: Values, mount: Values, noise: Values, corner: Values, cell: float, height: Values,
         variance: Values, misses: NDArray[np.int64]) -> int:
    """Fuse a cloud of points into the heights of the cells, each by a Kalman filter of one dimension.

    The variance of a point is that of its range along the ray, and of roll and pitch by its distance, see Fankhauser,
    Bloesch and Hutter, "Probabilistic terrain mapping for mobile robots with uncertain localization", RA-L 2018.  A
    point above the gate of a cell replaces its height, because cells with a step keep the upper side; points below are
    ignored until the cell was seen lower several clouds in a row.

    Parameters
    ----------
    points : (n, 3) float
        In the frame of the sensor [m]; those with nan are left out.
    pose : (12,) float64
        Of the sensor in the map: rotation, row by row, then position.
    mount : (3,) float64
        Place of the robot's axis of rotation in the map [m], for the effect of errors of its orientation.
    noise : (3,) float64
        Standard deviations: of ranges [m], of roll and pitch [rad], of the least height [m].
    corner : (2,) float64
        Least x and y of the map [m].
    cell : float
        Size of a cell [m].
    height, variance : (rows, columns) float64
        Changed; [m], [m^2].
    misses : (rows, columns) int64
        Changed; how often in a row a cell was seen lower.

    Returns
    -------
    int
        Number of points in the map.
    """
    rows, columns = height.shape
    top = np.full((rows, columns), -math.inf)       # of this cloud
    used = 0
    for index in range(points.shape[0]):
        px, py, pz = points[index, 0], points[index, 1], points[index, 2]
        if not (abs(px) + abs(py) + abs(pz) < math.inf):
            continue
        dx = pose[0] * px + pose[1] * py + pose[2] * pz
        dy = pose[3] * px + pose[4] * py + pose[5] * pz
        dz = pose[6] * px + pose[7] * py + pose[8] * pz
        x, y, z = dx + pose[9], dy + pose[10], dz + pose[11]
        column, row = int(math.floor((x - corner[0]) / cell)), int(math.floor((y - corner[1]) / cell))
        if row < 0 or row >= rows or column < 0 or column >= columns:
            continue
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        if distance <= 0.0:
            continue
        away = (x - mount[0]) * (x - mount[0]) + (y - mount[1]) * (y - mount[1])
        along = noise[0] * dz / distance
        measured = along * along + noise[1] * noise[1] * away + noise[2] * noise[2]
        used += 1
        if z > top[row, column]:
            top[row, column] = z
        known = height[row, column]
        if math.isnan(known):
            height[row, column], variance[row, column], misses[row, column] = z, measured, 0
            continue
        gap = z - known
        if gap * gap <= _GATE * _GATE * (variance[row, column] + measured):
            gain = variance[row, column] / (variance[row, column] + measured)
            height[row, column] = known + gain * gap
            variance[row, column] *= 1.0 - gain
            misses[row, column] = 0
        elif gap > 0.0:
            height[row, column], variance[row, column], misses[row, column] = z, measured, 0
    for row in range(rows):
        for column in range(columns):
            if top[row, column] > -math.inf and height[row, column] - top[row, column] \
                    > _GATE * math.sqrt(variance[row, column]) + noise[2]:
                misses[row, column] += 1
                if misses[row, column] > _FADED:
                    height[row, column], misses[row, column] = top[row, column], 0
                    variance[row, column] = noise[0] * noise[0]
    return used


@kernel
def gaps(points: Floats, pose: Values, corner: Values, cell: float, height: Values, slope: float, found: Values) -> int:
    """Write how far points are above the ground, and the slope of the ground there, where it is not steep.

    Parameters
    ----------
    points, pose, corner, cell, height
        As for :func:`fuse`.
    slope : float
        Greatest difference of heights of a cell and its four neighbours, which are all known [m].
    found : (n, 3) float64
        Written: gap [m], slope along x and y.

    Returns
    -------
    int
        How many were written.
    """
    rows, columns = height.shape
    count = 0
    for index in range(points.shape[0]):
        px, py, pz = points[index, 0], points[index, 1], points[index, 2]
        if not (abs(px) + abs(py) + abs(pz) < math.inf):
            continue
        x = pose[0] * px + pose[1] * py + pose[2] * pz + pose[9]
        y = pose[3] * px + pose[4] * py + pose[5] * pz + pose[10]
        column, row = int(math.floor((x - corner[0]) / cell)), int(math.floor((y - corner[1]) / cell))
        if row < 1 or row >= rows - 1 or column < 1 or column >= columns - 1:
            continue
        here = height[row, column]
        right, left = height[row, column + 1], height[row, column - 1]
        above, below = height[row + 1, column], height[row - 1, column]
        if abs(right - here) < slope and abs(left - here) < slope and abs(above - here) < slope \
                and abs(below - here) < slope:
            along, up = 0.5 * (right - left) / cell, 0.5 * (above - below) / cell
            ground = here + along * (x - corner[0] - (column + 0.5) * cell) + up * (y - corner[1] - (row + 0.5) * cell)
            found[count, 0] = pose[6] * px + pose[7] * py + pose[8] * pz + pose[11] - ground
            found[count, 1], found[count, 2] = along, up
            count += 1
    return count


@kernel
def shift(old: Values, down: int, right: int, new: Values) -> None:
    """Copy a grid whose corner moved by some cells; cells that were outside stay as ``new`` has them.

    Parameters
    ----------
    old, new : (rows, columns) float64
    down, right : int
        Cells by which the corner moved along y and x.
    """
    rows, columns = old.shape
    for row in range(max(0, -down), min(rows, rows - down)):
        for column in range(max(0, -right), min(columns, columns - right)):
            new[row, column] = old[row + down, column + right]


@kernel
def traverse(height: Values, cell: float, reach: int, least: int, slope: Values, step: Values, rough: Values) -> None:
    """Write slope, step and roughness of each known cell, from the cells in a disc around it.

    The plane that fits best gives the slope and, by what is left, the roughness; the step is the greatest difference of
    heights of two neighbours in the disc, after Wermelinger et al., "Navigation planning for legged robots in
    challenging terrain", IROS 2016.

    Parameters
    ----------
    height : (rows, columns) float64
        [m]
    cell : float
        [m]
    reach : int
        Radius of the disc [cells].
    least : int
        Known cells in the disc; fewer give no value.
    slope, step, rough : (rows, columns) float64
        Written: [rad], [m], [m]; nan where unknown.
    """
    rows, columns = height.shape
    edge = np.full((rows, columns), 0.0)            # greatest difference to the right and upper neighbours
    for row in range(rows):
        for column in range(columns):
            here = height[row, column]
            if math.isnan(here):
                continue
            if column + 1 < columns and not math.isnan(height[row, column + 1]):
                edge[row, column] = abs(height[row, column + 1] - here)
            if row + 1 < rows and not math.isnan(height[row + 1, column]):
                edge[row, column] = max(edge[row, column], abs(height[row + 1, column] - here))
    for row in range(rows):
        for column in range(columns):
            slope[row, column] = step[row, column] = rough[row, column] = math.nan
            if math.isnan(height[row, column]):
                continue
            count = 0
            sx = sy = sz = sxx = sxy = syy = sxz = syz = szz = highest = 0.0
            for i in range(max(0, row - reach), min(rows, row + reach + 1)):
                for j in range(max(0, column - reach), min(columns, column + reach + 1)):
                    x, y = float(j - column), float(i - row)
                    if x * x + y * y > reach * reach or math.isnan(height[i, j]):
                        continue
                    z = height[i, j] - height[row, column]
                    count += 1
                    sx, sy, sz = sx + x, sy + y, sz + z
                    sxx, sxy, syy = sxx + x * x, sxy + x * y, syy + y * y
                    sxz, syz, szz = sxz + x * z, syz + y * z, szz + z * z
                    highest = max(highest, edge[i, j])
            if count < least:
                continue
            sxx, sxy, syy = sxx - sx * sx / count, sxy - sx * sy / count, syy - sy * sy / count
            sxz, syz, szz = sxz - sx * sz / count, syz - sy * sz / count, szz - sz * sz / count
            size = sxx * syy - sxy * sxy
            if size <= 1e-9:
                continue
            a, b = (sxz * syy - syz * sxy) / size, (syz * sxx - sxz * sxy) / size
            rest = max(szz - a * sxz - b * syz, 0.0)
            slope[row, column] = math.atan(math.sqrt(a * a + b * b) / cell)
            step[row, column], rough[row, column] = highest, math.sqrt(rest / count)


@kernel
def cheapest(cost: Values, goal: Tuple[int, int], reached: Values) -> None:
    """Write the least cost from each cell to a goal, by Dijkstra's algorithm with a binary heap on eight neighbours.

    Parameters
    ----------
    cost : (rows, columns) float64
        Of a cell, for each cell of way; infinite: impassable.
    goal : (int, int)
        Row and column.
    reached : (rows, columns) float64
        Written; infinite where there is no way.
    """
    rows, columns = cost.shape
    for row in range(rows):
        for column in range(columns):
            reached[row, column] = math.inf
    room = 8 * rows * columns + 8
    keys, cells = np.empty(room), np.empty(room, np.int64)
    count = 1
    keys[0], cells[0] = 0.0, goal[0] * columns + goal[1]
    reached[goal[0], goal[1]] = 0.0
    while count > 0:
        key, here = keys[0], cells[0]
        count = pop(keys, cells, count)
        row, column = here // columns, here % columns
        if key > reached[row, column]:
            continue
        for down in range(-1, 2):
            for right in range(-1, 2):
                i, j = row + down, column + right
                if (down == 0 and right == 0) or i < 0 or j < 0 or i >= rows or j >= columns:
                    continue
                way = math.sqrt(float(down * down + right * right))
                new = key + 0.5 * way * (cost[row, column] + cost[i, j])
                if new < reached[i, j]:
                    reached[i, j] = new
                    count = push(keys, cells, count, new, i * columns + j)
