# SPDX-License-Identifier: BSD-3-Clause
"""A* on the eight neighbours of a cell."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.planners.block_layout import BLOCK
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, IndexArray, Int32Array, Uint8Array

_DIAGONAL, _RISE = np.float32(math.sqrt(2.0)), np.float32(math.sqrt(2.0) - 1.0)
_HALF, _INF = np.float32(0.5), np.float32(np.inf)
_CHANGE = np.float32(1.0 - 1e-6)        # a path that is better by less is not taken: rounding of 32-bit numbers
_AT_ONCE = 64                           # cells between two looks at the room in the queue


@kernel
def _octile(rows: int, columns: int) -> np.float32:
    high, low = max(rows, columns), min(rows, columns)
    return np.float32(high) + _RISE * np.float32(low)


@kernel
def _reach(total: Float32Array, parent: Int32Array, allowed: Uint8Array, row: int, column: int, new: np.float32,
           origin: int) -> bool:
    """Take a path to a cell, if it is better than that before; return whether it was."""
    if not new < total[row, column] * _CHANGE or (allowed.shape[0] > 0 and allowed[row // BLOCK, column // BLOCK] == 0):
        return False
    total[row, column], parent[row, column] = new, origin
    return True


@kernel
def _expand(costs: Uint8Array, table: Float32Array, allowed: Uint8Array, row: int, column: int, total: Float32Array,
            parent: Int32Array, better: IndexArray) -> int:
    """Offer a cell's path to its eight neighbours; write those that took it, row and column; return how many.

    The neighbours are written one by one: in a loop over them, the processor foresees none of the branches, and the
    search takes several times as long.
    """
    rows, columns = costs.shape
    origin, here = row * columns + column, total[row, column]
    half = _HALF * table[costs[row, column]]
    up = _HALF * table[costs[row - 1, column]] if row > 0 else _INF
    down = _HALF * table[costs[row + 1, column]] if row + 1 < rows else _INF
    left = _HALF * table[costs[row, column - 1]] if column > 0 else _INF
    right = _HALF * table[costs[row, column + 1]] if column + 1 < columns else _INF
    count = 0
    if up < _INF:
        if _reach(total, parent, allowed, row - 1, column, here + half + up, origin):
            better[count, 0], better[count, 1], count = row - 1, column, count + 1
        if left < _INF:
            crooked = here + _DIAGONAL * (half + _HALF * table[costs[row - 1, column - 1]])
            if _reach(total, parent, allowed, row - 1, column - 1, crooked, origin):
                better[count, 0], better[count, 1], count = row - 1, column - 1, count + 1
        if right < _INF:
            crooked = here + _DIAGONAL * (half + _HALF * table[costs[row - 1, column + 1]])
            if _reach(total, parent, allowed, row - 1, column + 1, crooked, origin):
                better[count, 0], better[count, 1], count = row - 1, column + 1, count + 1
    if down < _INF:
        if _reach(total, parent, allowed, row + 1, column, here + half + down, origin):
            better[count, 0], better[count, 1], count = row + 1, column, count + 1
        if left < _INF:
            crooked = here + _DIAGONAL * (half + _HALF * table[costs[row + 1, column - 1]])
            if _reach(total, parent, allowed, row + 1, column - 1, crooked, origin):
                better[count, 0], better[count, 1], count = row + 1, column - 1, count + 1
        if right < _INF:
            crooked = here + _DIAGONAL * (half + _HALF * table[costs[row + 1, column + 1]])
            if _reach(total, parent, allowed, row + 1, column + 1, crooked, origin):
                better[count, 0], better[count, 1], count = row + 1, column + 1, count + 1
    if left < _INF and _reach(total, parent, allowed, row, column - 1, here + half + left, origin):
        better[count, 0], better[count, 1], count = row, column - 1, count + 1
    if right < _INF and _reach(total, parent, allowed, row, column + 1, here + half + right, origin):
        better[count, 0], better[count, 1], count = row, column + 1, count + 1
    return count


@kernel
def search(costs: Uint8Array, table: Float32Array, start: Tuple[int, int], target: Tuple[int, int],
           allowed: Uint8Array, total: Float32Array, parent: Int32Array) -> Tuple[Int32Array, int, bool]:
    """Search the cheapest path from a start to a target: A* on eight neighbours with the octile heuristic.

    An edge costs its length times the mean cost of its two cells. The queue has bands of half the least cost. A cell
    whose path becomes better enters it again, so the order within a band does not matter.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost of each value, in which 0 has the least; inf: blocked.
    start, target : (row, column)
        Free cells.
    allowed : (h, w) uint8
        0: no cell of this block is entered; (0, 0): all are.
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
    columns, least = costs.shape[1], table[0]
    width, bands = _bands(table)
    inverse = np.float32(1.0) / width
    room = 8 * _AT_ONCE
    queue, counts = np.empty((bands, room), np.int64), np.zeros(bands, np.int64)    # circular: cells of each band
    visited, better = np.empty(4096, np.int32), np.empty((8, 2), np.int64)
    total[start] = 0.0
    parent[start] = visited[0] = start[0] * columns + start[1]
    level = int(_octile(abs(start[0] - target[0]), abs(start[1] - target[1])) * least * inverse)
    queue[level & (bands - 1), 0], counts[level & (bands - 1)] = visited[0], 1
    seen, idle = 1, 0
    while idle < bands and not total[target] < level * width:       # as many empty bands: nothing waits
        place, taken = level & (bands - 1), 0
        idle = 0 if counts[place] > 0 else idle + 1
        lowest = level * width * _CHANGE
        while taken < counts[place]:
            if counts.max() + 8 * _AT_ONCE > room:
                wider = np.empty((bands, 2 * room), np.int64)
                wider[:, :room] = queue
                queue, room = wider, 2 * room
            if seen + 8 * _AT_ONCE > len(visited):
                visited = np.concatenate((visited, np.empty(len(visited), np.int32)))
            last = min(taken + _AT_ONCE, counts[place])
            for k in range(taken, last):
                row, column = queue[place, k] // columns, queue[place, k] % columns
                ahead = _octile(abs(row - target[0]), abs(column - target[1])) * least
                if total[row, column] + ahead < lowest:
                    continue                                        # it has been taken in a lower band
                for found in range(_expand(costs, table, allowed, row, column, total, parent, better)):
                    r, c = better[found, 0], better[found, 1]
                    key = total[r, c] + _octile(abs(r - target[0]), abs(c - target[1])) * least
                    band = max(int(key * inverse), level) & (bands - 1)
                    queue[band, counts[band]] = visited[seen] = r * columns + c
                    counts[band] += 1
                    seen += 1
            taken = last
        counts[place] = 0
        level += 1
    return visited, seen, total[target] < _INF


@kernel
def _bands(table: Float32Array) -> Tuple[np.float32, int]:
    """Return the width of a band of the queue, and how many are in use at once: a power of two."""
    width = _HALF * table[0]
    greatest = table[0]
    for value in range(256):
        if table[value] < _INF:
            greatest = max(greatest, table[value])
    count = 4
    while count < int(_DIAGONAL * (greatest + table[0]) / width) + 3:
        count *= 2
    return width, count


@kernel
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
