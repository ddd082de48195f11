# SPDX-License-Identifier: BSD-3-Clause
"""Loops over cells: frontier cells, their groups, what can be seen from a place."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, IndexArray, Int32Array, Uint8Array


@kernel
def frontier_groups(costs: Uint8Array, distance: Float32Array) -> Tuple[Int32Array, int]:
    """Group the unknown cells beside reachable ones.

    A frontier cell is unknown and has a reachable cell among its four neighbours (Yamauchi 1997). Neighbouring
    frontier cells, diagonal ones too, are one group.

    Parameters
    ----------
    costs : (H, W) uint8
    distance : (H, W) float32
        From the robot; inf: not reachable.

    Returns
    -------
    groups : (H, W) int32
        Number of the group of each frontier cell, from 1 on; 0: none.
    count : int
        Of groups.
    """
    rows, columns = costs.shape
    groups = np.zeros((rows, columns), np.int32)
    for row in range(rows):
        for column in range(columns):
            if costs[row, column] == NO_INFORMATION and (
                    (row > 0 and distance[row - 1, column] < np.inf)
                    or (row + 1 < rows and distance[row + 1, column] < np.inf)
                    or (column > 0 and distance[row, column - 1] < np.inf)
                    or (column + 1 < columns and distance[row, column + 1] < np.inf)):
                groups[row, column] = -1
    stack = np.empty((rows * columns, 2), np.int32)
    count = 0
    for row in range(rows):
        for column in range(columns):
            if groups[row, column] != -1:
                continue
            count += 1
            groups[row, column] = count
            stack[0, 0], stack[0, 1], height = row, column, 1
            while height > 0:
                height -= 1
                r, c = stack[height, 0], stack[height, 1]
                for near_row in range(max(0, r - 1), min(rows, r + 2)):
                    for near_column in range(max(0, c - 1), min(columns, c + 2)):
                        if groups[near_row, near_column] == -1:
                            groups[near_row, near_column] = count
                            stack[height, 0], stack[height, 1] = near_row, near_column
                            height += 1
    return groups, count


@kernel
def nearest_passable(costs: Uint8Array, row: int, column: int, limit: int, reach: int) -> Tuple[int, int]:
    """Return the nearest cell with a cost of at most ``limit``, or (-1, -1).

    Parameters
    ----------
    costs : (H, W) uint8
    row, column : int
        Where to begin.
    limit : int
    reach : int
        Half the side of the square that is searched [cells].
    """
    best, found_row, found_column = np.inf, -1, -1
    for r in range(max(0, row - reach), min(costs.shape[0], row + reach + 1)):
        for c in range(max(0, column - reach), min(costs.shape[1], column + reach + 1)):
            away = (r - row) ** 2 + (c - column) ** 2
            if away < best and costs[r, c] <= limit:
                best, found_row, found_column = away, r, c
    return found_row, found_column


@kernel
def visible(costs: Uint8Array, row: int, column: int, reach: float, rays: int, seen: Uint8Array,
            through_unknown: bool) -> int:
    """Mark the cells that a laser at the centre of a cell sees.

    Rays are sampled every half cell, and end in the first lethal cell.

    Parameters
    ----------
    costs : (H, W) uint8
    row, column : int
    reach : float
        Range of the laser [cells].
    rays : int
        In a full circle.
    seen : (H, W) uint8
        1: marked. Changed.
    through_unknown : bool
        Whether unknown cells let a ray pass; otherwise it ends in front of them.

    Returns
    -------
    int
        Number of unknown cells among the new marks.
    """
    rows, columns = costs.shape
    new = 0
    for ray in range(rays):
        angle = 2.0 * math.pi * ray / rays
        up, across = 0.5 * math.sin(angle), 0.5 * math.cos(angle)
        for step in range(int(2.0 * reach) + 1):
            r, c = int(row + 0.5 + step * up), int(column + 0.5 + step * across)
            if not (0 <= r < rows and 0 <= c < columns):
                break
            cost = costs[r, c]
            if cost == NO_INFORMATION and not through_unknown:
                break
            if seen[r, c] == 0:
                seen[r, c] = 1
                new += cost == NO_INFORMATION
            if cost == LETHAL:
                break
    return new


@kernel
def sight_counts(costs: Uint8Array, cells: IndexArray, reach: float, rays: int) -> Int32Array:
    """Count, for each cell, from how many of some cells it is in sight, through known space without obstacles.

    Parameters
    ----------
    costs : (H, W) uint8
    cells : (N, 2) int64
        Row and column; a cell may itself be unknown.
    reach : float
        Of a look [cells].
    rays : int
        In a full circle.

    Returns
    -------
    (H, W) int32
    """
    rows, columns = costs.shape
    counts, last = np.zeros((rows, columns), np.int32), np.full((rows, columns), -1, np.int32)
    for number in range(len(cells)):
        for ray in range(rays):
            angle = 2.0 * math.pi * ray / rays
            up, across = 0.5 * math.sin(angle), 0.5 * math.cos(angle)
            for step in range(int(2.0 * reach) + 1):
                r, c = int(cells[number, 0] + 0.5 + step * up), int(cells[number, 1] + 0.5 + step * across)
                if not (0 <= r < rows and 0 <= c < columns):
                    break
                if costs[r, c] >= LETHAL and (r != cells[number, 0] or c != cells[number, 1]):
                    break
                if last[r, c] != number:
                    last[r, c] = number
                    counts[r, c] += 1
    return counts


@kernel
def count_unknown(costs: Uint8Array, cells: IndexArray, reach: int) -> int:
    """Return how many unknown cells are in the smallest rectangle around some cells, widened.

    Parameters
    ----------
    costs : (H, W) uint8
    cells : (N, 2) int64
        Row and column; may be outside.
    reach : int
        By which the rectangle is widened to each side [cells].
    """
    top, left = cells[0, 0], cells[0, 1]
    bottom, right = top, left
    for place in range(1, len(cells)):
        top, bottom = min(top, cells[place, 0]), max(bottom, cells[place, 0])
        left, right = min(left, cells[place, 1]), max(right, cells[place, 1])
    count = 0
    for row in range(max(0, top - reach), min(costs.shape[0], bottom + reach + 1)):
        for column in range(max(0, left - reach), min(costs.shape[1], right + reach + 1)):
            count += costs[row, column] == NO_INFORMATION
    return count
