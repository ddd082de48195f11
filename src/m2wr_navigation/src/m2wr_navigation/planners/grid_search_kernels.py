# SPDX-License-Identifier: BSD-3-Clause
"""A* on the eight neighbours of a cell, and Theta*, whose path turns at any angle."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np
from numba import njit

from m2wr_navigation.planners.block_layout import BLOCK
from m2wr_navigation.planners.heap_kernels import pop, push

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import Float32Array, Int32Array, Uint8Array

DIAGONAL = math.sqrt(2.0)


@njit(cache=True, nogil=True, error_model='numpy')
def straight_cost(costs: Uint8Array, table: Float32Array, row: int, column: int, last_row: int,
                  last_column: int) -> float:
    """Return the cost of the straight line between the centres of two cells; inf if it meets a blocked cell.

    The line visits every cell that it crosses; through a corner of cells it needs both neighbours. The cost is the
    length times the mean cost of the cells.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost of each value; inf: blocked.
    row, column, last_row, last_column : int
        Cells within the grid.
    """
    rows, columns = abs(last_row - row), abs(last_column - column)
    down, right = 1 if last_row > row else -1, 1 if last_column > column else -1
    total = 0.5 * table[costs[row, column]]
    cells = 0.5
    error = rows - columns              # sign: whether the line crosses a horizontal or a vertical side next
    at_row, at_column = row, column
    while at_row != last_row or at_column != last_column:
        if error > 0:
            at_row += down
            error -= 2 * columns
        elif error < 0:
            at_column += right
            error += 2 * rows
        else:
            if not (table[costs[at_row + down, at_column]] < np.inf
                    and table[costs[at_row, at_column + right]] < np.inf):
                return np.inf
            at_row += down
            at_column += right
            error += 2 * rows - 2 * columns
        cost = table[costs[at_row, at_column]]
        if not cost < np.inf:
            return np.inf
        last = at_row == last_row and at_column == last_column
        total += 0.5 * cost if last else cost
        cells += 0.5 if last else 1.0
    return math.hypot(rows, columns) * total / cells


@njit(cache=True, nogil=True, error_model='numpy')
def _octile(rows: int, columns: int) -> float:
    return max(rows, columns) + (DIAGONAL - 1.0) * min(rows, columns)


@njit(cache=True, nogil=True, error_model='numpy')
def search(costs: Uint8Array, table: Float32Array, start: Tuple[int, int], target: Tuple[int, int],
           allowed: Uint8Array, any_angle: bool, total: Float32Array,
           parent: Int32Array) -> Tuple[Int32Array, int, bool]:
    """Search the cheapest path from a start to a target.

    An edge costs its length times the mean cost of its two cells. With ``any_angle`` a cell takes the parent of its
    predecessor where the straight line from there is free and not more expensive (Theta*, Nash 2007).

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost of each value, in which 0 has the least; inf: blocked.
    start, target : (row, column)
        Free cells.
    allowed : (h, w) uint8
        0: no cell of this block is entered; (0, 0): all are.
    any_angle : bool
    total : (H, W) float32
        inf before; changed: cost from the start.
    parent : (H, W) int32
        Written where ``total`` is: index of the cell before.

    Returns
    -------
    visited : (N,) int32
        Indices of the cells whose total was changed, with repetitions.
    count : int
        How many of them are used.
    found : bool
    """
    rows, columns = costs.shape
    limited = allowed.shape[0] > 0
    keys, items = np.empty(4096, np.float32), np.empty(4096, np.int32)
    visited = np.empty(4096, np.int32)
    least = table[0]
    total[start] = 0.0
    parent[start] = visited[0] = start[0] * columns + start[1]
    seen, waiting = 1, push(keys, items, 0, 0.0, start[0] * columns + start[1])
    while waiting > 0:
        key, item = keys[0], items[0]
        waiting = pop(keys, items, waiting)
        row, column = item // columns, item % columns
        if row == target[0] and column == target[1]:
            return visited, seen, True
        ahead = _ahead(any_angle, abs(row - target[0]), abs(column - target[1])) * least
        if key > (total[row, column] + ahead) * 1.00001:
            continue
        if waiting + 8 >= len(keys):
            keys = np.concatenate((keys, np.empty(len(keys), np.float32)))
            items = np.concatenate((items, np.empty(len(items), np.int32)))
        if seen + 8 >= len(visited):
            visited = np.concatenate((visited, np.empty(len(visited), np.int32)))
        above = parent[row, column]
        here = table[costs[row, column]]
        for r in range(max(0, row - 1), min(rows, row + 2)):
            for c in range(max(0, column - 1), min(columns, column + 2)):
                cost = table[costs[r, c]]
                if not cost < np.inf or (limited and allowed[r // BLOCK, c // BLOCK] == 0):
                    continue
                crooked = r != row and c != column
                if crooked and not (table[costs[row, c]] < np.inf and table[costs[r, column]] < np.inf):
                    continue
                new = total[row, column] + 0.5 * (here + cost) * (DIAGONAL if crooked else 1.0)
                origin = item
                if any_angle and above != item and total[r, c] > new * 0.9:
                    over = total[above // columns, above % columns] + straight_cost(
                        costs, table, above // columns, above % columns, r, c)
                    if over <= new * 1.00001:
                        new, origin = over, above
                if new < total[r, c] * 0.99999:
                    total[r, c], parent[r, c] = new, origin
                    visited[seen] = r * columns + c
                    seen += 1
                    ahead = _ahead(any_angle, abs(r - target[0]), abs(c - target[1])) * least
                    waiting = push(keys, items, waiting, new + ahead, r * columns + c)
    return visited, seen, False


@njit(cache=True, nogil=True, error_model='numpy')
def _ahead(any_angle: bool, rows: int, columns: int) -> float:
    return math.hypot(rows, columns) if any_angle else _octile(rows, columns)


@njit(cache=True, nogil=True, error_model='numpy')
def path_back(parent: Int32Array, start: Tuple[int, int], target: Tuple[int, int]) -> Int32Array:
    """Return the cells (N, 2) from the start to the target, row and column.

    Parameters
    ----------
    parent : (H, W) int32
        Of :func:`search`.
    start, target : (row, column)
    """
    columns = parent.shape[1]
    first, at = start[0] * columns + start[1], target[0] * columns + target[1]
    count = 1
    while at != first:
        at = parent[at // columns, at % columns]
        count += 1
    path = np.empty((count, 2), np.int32)
    at = target[0] * columns + target[1]
    for k in range(count - 1, -1, -1):
        path[k, 0], path[k, 1] = at // columns, at % columns
        at = parent[at // columns, at % columns]
    return path
