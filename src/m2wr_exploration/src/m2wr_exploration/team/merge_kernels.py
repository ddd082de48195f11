# SPDX-License-Identifier: BSD-3-Clause
"""Loops over the cells of maps that are placed on each other."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Complex64Array, Float32Array, FloatArray, IndexArray, Uint8Array


@kernel
def paint(target: Uint8Array, resolution: float, origin: FloatArray, source: Uint8Array, source_resolution: float,
          source_origin: FloatArray, pose: FloatArray) -> None:
    """Draw a map into another one; of two known costs the greater one stays.

    A cell takes what is under its centre. Lethal cells are also drawn one by one, so that no wall gets holes.

    Parameters
    ----------
    target : (H, W) uint8
        Changed.
    resolution : float
        [m]
    origin : (2,) float64
        Of its corner [m].
    source : (h, w) uint8
    source_resolution : float
        [m]
    source_origin : (2,) float64
        [m]
    pose : (3,) float64
        Of the source's frame in that of the target [m, m, rad].
    """
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    for row in range(target.shape[0]):
        for column in range(target.shape[1]):
            x = origin[0] + (column + 0.5) * resolution - pose[0]
            y = origin[1] + (row + 0.5) * resolution - pose[1]
            r = int(math.floor((cosine * y - sine * x - source_origin[1]) / source_resolution))
            c = int(math.floor((cosine * x + sine * y - source_origin[0]) / source_resolution))
            if 0 <= r < source.shape[0] and 0 <= c < source.shape[1]:
                cost = source[r, c]
                if cost != NO_INFORMATION and (target[row, column] == NO_INFORMATION or cost > target[row, column]):
                    target[row, column] = cost
    for r in range(source.shape[0]):
        for c in range(source.shape[1]):
            if source[r, c] == LETHAL:
                x = source_origin[0] + (c + 0.5) * source_resolution
                y = source_origin[1] + (r + 0.5) * source_resolution
                row = int(math.floor((pose[1] + sine * x + cosine * y - origin[1]) / resolution))
                column = int(math.floor((pose[0] + cosine * x - sine * y - origin[0]) / resolution))
                if 0 <= row < target.shape[0] and 0 <= column < target.shape[1]:
                    target[row, column] = LETHAL


@kernel
def find_free_sides(cells: IndexArray, free: BoolArray, radius: int, reach: int, sides: Float32Array) -> Float32Array:
    """Find on which side of obstacles it is free.

    Parameters
    ----------
    cells : (N, 2) int64
        Rows and columns of the obstacles.
    free : (H, W) bool
    radius : int
        Of the disc around an obstacle in which free cells count [cells].
    reach : int
        To which the cells around obstacles take the side of the nearest one [cells].
    sides : (H, W, 2) float32
        Set around obstacles.

    Returns
    -------
    (N, 2) float32
        Mean direction of the free cells around each obstacle; length 1 at the edge of a half plane.
    """
    found = np.zeros((len(cells), 2), np.float32)
    nearest = np.full(free.shape, reach * reach + 1, np.int64)
    whole = 0.0
    for down in range(-radius, radius + 1):
        for right in range(-radius, radius + 1):
            if down * down + right * right <= radius * radius:
                whole += 0.5 * abs(down)
    for number in range(len(cells)):
        row, column = cells[number, 0], cells[number, 1]
        for r in range(max(0, row - radius), min(free.shape[0], row + radius + 1)):
            for c in range(max(0, column - radius), min(free.shape[1], column + radius + 1)):
                if free[r, c] and (r - row) ** 2 + (c - column) ** 2 <= radius * radius:
                    found[number, 0] += (c - column) / whole
                    found[number, 1] += (r - row) / whole
        for r in range(max(0, row - reach), min(free.shape[0], row + reach + 1)):
            for c in range(max(0, column - reach), min(free.shape[1], column + reach + 1)):
                away = (r - row) ** 2 + (c - column) ** 2
                if away < nearest[r, c]:
                    nearest[r, c] = away
                    sides[r, c] = found[number]
    return found


@kernel
def _between(field: Float32Array, row: float, column: float) -> float:
    """Return the value between the centres of four cells, of which those beyond the edge are like those at it."""
    top, left = int(math.floor(row)), int(math.floor(column))
    down, right = row - top, column - left
    last, end = field.shape[0] - 1, field.shape[1] - 1
    low, high = min(max(top, 0), last), min(max(top + 1, 0), last)
    near, far = min(max(left, 0), end), min(max(left + 1, 0), end)
    return ((1.0 - down) * ((1.0 - right) * field[low, near] + right * field[low, far])
            + down * ((1.0 - right) * field[high, near] + right * field[high, far]))


@kernel
def agreement(points: FloatArray, normals: Float32Array, field: Float32Array, sides: Float32Array, resolution: float,
              origin: FloatArray, pose: FloatArray) -> Tuple[float, int, int]:
    """Compare the obstacles of one map with another one.

    Obstacles whose free sides are opposite are the two faces of one wall: they tell nothing.

    Parameters
    ----------
    points : (N, 2) float64
        Obstacles of the one [m].
    normals : (N, 2) float32
        Direction of the free side of each; length 1, less where several sides are free.
    field : (H, W) float32
        Of the other: 0 to 1 near its obstacles, negative where it is free, 0 where it is unknown.
    sides : (H, W, 2) float32
        That of the nearest obstacle.
    resolution : float
        [m]
    origin : (2,) float64
        [m]
    pose : (3,) float64
        Of the points' frame in that of the field [m, m, rad].

    Returns
    -------
    score : float
        Sum of the field at the points.
    agreeing, contradicting : int
        Points near obstacles, and in free space.
    """
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    score, agreeing, contradicting = 0.0, 0, 0
    for number in range(len(points)):
        x, y = points[number, 0], points[number, 1]
        v = (pose[1] + sine * x + cosine * y - origin[1]) / resolution
        u = (pose[0] + cosine * x - sine * y - origin[0]) / resolution
        row, column = int(math.floor(v)), int(math.floor(u))
        if not (0 <= row < field.shape[0] and 0 <= column < field.shape[1]):
            continue
        value, share = field[row, column], 1.0
        if value > 0.0:
            p, q = normals[number, 0], normals[number, 1]
            along = (cosine * p - sine * q) * sides[row, column, 0] + (sine * p + cosine * q) * sides[row, column, 1]
            share = min(1.0, max(0.0, 1.0 + 2.0 * along))
        agreeing += value > 0.1 and share > 0.5
        contradicting += value < 0.0
        score += share * _between(field, v - 0.5, u - 0.5)
    return score, agreeing, contradicting


@kernel
def _coarse_cell(point: FloatArray, middle: FloatArray, cosine: float, sine: float, cell: float) -> Tuple[int, int]:
    """Return row and column of a point [m] after a rotation about the middle, which is at the corner of cell (0, 0)."""
    x, y = point[0] - middle[0], point[1] - middle[1]
    return int(math.floor((sine * x + cosine * y) / cell)), int(math.floor((cosine * x - sine * y) / cell))


@kernel
def draw_coarse(image: Complex64Array, points: FloatArray, free: FloatArray, middle: FloatArray, yaw: float,
                cell: float) -> None:
    """Draw a rotated map on coarse cells; what is beyond an edge appears at the opposite one.

    Parameters
    ----------
    image : (S, S) complex64
        Zero before. Afterwards the imaginary part is 1 in cells with an obstacle. The real part, the field, is 1 there,
        0.5 beside them, else -1 in free and 0 in unknown cells. The middle of the map is in the corner.
    points, free : (N, 2), (M, 2) float64
        Centres of occupied and of free cells [m].
    middle : (2,) float64
        The map is rotated about it [m].
    yaw : float
        [rad]
    cell : float
        [m]
    """
    cosine, sine, size = math.cos(yaw), math.sin(yaw), len(image)
    for number in range(len(free)):
        row, column = _coarse_cell(free[number], middle, cosine, sine, cell)
        image[row % size, column % size] = -1.0
    for number in range(len(points)):
        row, column = _coarse_cell(points[number], middle, cosine, sine, cell)
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                image[(row + down) % size, (column + right) % size] = 0.5
    for number in range(len(points)):
        row, column = _coarse_cell(points[number], middle, cosine, sine, cell)
        image[row % size, column % size] = 1.0 + 1.0j
