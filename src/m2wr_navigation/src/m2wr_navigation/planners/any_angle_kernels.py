# SPDX-License-Identifier: BSD-3-Clause
"""Theta*: A* whose paths turn at any angle (Nash 2007), led by the potential of the grid."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.planners.heap_kernels import pop, push
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, Int32Array, Uint8Array

_DIAGONAL = math.sqrt(2.0)
_LONGEST = 100.0            # cells: longer lines are joined in the end; so the time for a cell has a limit
_CHANGE = 1.00001           # a line may be more expensive by this factor: rounding of 32-bit numbers
_LOW = 0.998                # the potential is a little above the cost of straight lines, and should not be
_GREEDY = 1.001             # paths may be more expensive by this factor, so that few cells beside them are visited


@kernel
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


@kernel
def _ahead(potential: Float32Array, row: int, column: int, target: Tuple[int, int], least: float) -> float:
    """Return the estimated cost from a cell to the target."""
    straight = math.hypot(row - target[0], column - target[1]) * least
    return _GREEDY * max(_LOW * potential[row, column], straight)


@kernel
def search(costs: Uint8Array, table: Float32Array, start: Tuple[int, int], target: Tuple[int, int],
           potential: Float32Array, total: Float32Array, parent: Int32Array) -> Tuple[Int32Array, int, bool]:
    """Search a path from a start to a target.

    A cell takes the parent of its predecessor where the straight line from there is free and not more expensive.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost of each value, in which 0 has the least; inf: blocked.
    start, target : (row, column)
        Free cells.
    potential : (H, W) float32
        Of :func:`wave_kernels.wave` from the target; inf: the cell is not entered.
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
    keys, items = np.empty(4096, np.float32), np.empty(4096, np.int32)
    visited = np.empty(4096, np.int32)
    total[start] = 0.0
    parent[start] = visited[0] = start[0] * columns + start[1]
    seen, waiting = 1, push(keys, items, 0, 0.0, start[0] * columns + start[1])
    while waiting > 0:
        key, item = keys[0], items[0]
        waiting = pop(keys, items, waiting)
        row, column = item // columns, item % columns
        if row == target[0] and column == target[1]:
            return visited, seen, True
        if key > (total[row, column] + _ahead(potential, row, column, target, table[0])) * _CHANGE:
            continue
        if waiting + 8 >= len(keys):
            keys = np.concatenate((keys, np.empty(len(keys), np.float32)))
            items = np.concatenate((items, np.empty(len(items), np.int32)))
        if seen + 8 >= len(visited):
            visited = np.concatenate((visited, np.empty(len(visited), np.int32)))
        above = parent[row, column]
        above_row, above_column = above // columns, above % columns
        here = table[costs[row, column]]
        for r in range(max(0, row - 1), min(rows, row + 2)):
            for c in range(max(0, column - 1), min(columns, column + 2)):
                if not potential[r, c] < np.inf:
                    continue
                crooked = r != row and c != column
                if crooked and not (table[costs[row, c]] < np.inf and table[costs[r, column]] < np.inf):
                    continue
                new = total[row, column] + 0.5 * (here + table[costs[r, c]]) * (_DIAGONAL if crooked else 1.0)
                origin = item
                if above != item and total[r, c] > new * 0.9 \
                        and math.hypot(r - above_row, c - above_column) < _LONGEST:
                    over = total[above_row, above_column] + straight_cost(
                        costs, table, above_row, above_column, r, c)
                    if over <= new * _CHANGE:
                        new, origin = over, above
                if new * _CHANGE < total[r, c]:
                    total[r, c], parent[r, c] = new, origin
                    visited[seen] = r * columns + c
                    seen += 1
                    key = new + _ahead(potential, r, c, target, table[0])
                    waiting = push(keys, items, waiting, key, r * columns + c)
    return visited, seen, False


@kernel
def straighten(costs: Uint8Array, table: Float32Array, corners: Int32Array) -> Int32Array:
    """Return the corners (M, 2) of a path without those that a straight line of no greater cost can leave out.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
    corners : (N, 2) int32
        Row and column; the lines between them are free.
    """
    kept, spent = np.empty_like(corners), np.zeros(len(corners))
    kept[0], count = corners[0], 1
    for k in range(1, len(corners)):
        row, column = corners[k]
        step = straight_cost(costs, table, kept[count - 1, 0], kept[count - 1, 1], row, column)
        while count > 1:
            over = straight_cost(costs, table, kept[count - 2, 0], kept[count - 2, 1], row, column)
            if not over <= (spent[count - 1] + step) * _CHANGE:
                break
            count, step = count - 1, over
        kept[count], spent[count], count = corners[k], step, count + 1
    return kept[:count].copy()
