# SPDX-License-Identifier: BSD-3-Clause
"""Potential of a grid: the cost of the best path from each cell to a target, by fast marching.

The Eikonal equation ``|grad T| = h`` with h, the cost of a cell, is solved cell by cell in the order of T (Sethian
1996). The queue has bands of half the least cost. A cell whose potential is lowered again enters it again, so the order
within a band does not matter, and no cell is ever dropped.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.planners.block_layout import BLOCK
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Int32Array, Uint8Array

_MOST_INSIDE = 3                        # half-cell steps of a path within one cell
_CHANGE = np.float32(1.0 - 1e-6)        # a potential that is lowered by less is kept: rounding of 32-bit numbers
_HALF, _TWO, _INF, _STAYS = np.float32(0.5), np.float32(2.0), np.float32(np.inf), np.float32(-1.0)
_BITS, _COLUMN = 32, 2 ** 32 - 1        # a cell in the queue: row << _BITS | column
_AT_ONCE = 128                          # cells between two looks at the room in the queue


@kernel
def _solve(near: np.float32, other: np.float32, cost: np.float32, quadratic: bool) -> np.float32:
    """Return the potential of a cell by the lower neighbours along its two axes."""
    apart = abs(near - other)
    if not quadratic or not apart < cost:
        return min(near, other) + cost
    return _HALF * (near + other + np.float32(math.sqrt(_TWO * cost * cost - apart * apart)))


@kernel
def _value(potential: Float32Array, row: int, column: int) -> np.float32:
    if 0 <= row < potential.shape[0] and 0 <= column < potential.shape[1]:
        return potential[row, column]
    return _INF


@kernel
def _offer(costs: Uint8Array, table: Float32Array, potential: Float32Array, allowed: Uint8Array, row: int, column: int,
           across: int, along: int, first: bool, second: bool, here: np.float32, quadratic: bool) -> np.float32:
    """Lower the potential of a neighbour of a cell with the potential ``here``; return it, or -1 if it stays.

    The other axis of the neighbour is (across, along): (0, 1) or (1, 0). On it are a first and a second cell, or not.
    """
    before = potential[row, column]
    if before <= here:
        return _STAYS
    other = potential[row - across, column - along] if first else _INF
    if second:
        other = min(other, potential[row + across, column + along])
    new = _solve(here, other, table[costs[row, column]], quadratic)
    if not new < before * _CHANGE or (allowed.shape[0] > 0 and allowed[row // BLOCK, column // BLOCK] == 0):
        return _STAYS
    potential[row, column] = new
    return new


@kernel
def _put(queue: IndexArray, counts: IndexArray, band: int, row: int, column: int) -> None:
    """Add a cell to the queue, in the place of its band."""
    place = band & (len(counts) - 1)
    queue[place, counts[place]] = (row << _BITS) | column
    counts[place] += 1


@kernel
def _bands(table: Float32Array) -> Tuple[np.float32, int]:
    """Return the width of a band, and how many of them are in use at once: a power of two."""
    width = _HALF * table[0]
    greatest = np.float32(0.0)
    for value in range(256):
        if table[value] < _INF:
            greatest = max(greatest, table[value])
    count = 4
    while count < int(greatest / width) + 3:
        count *= 2
    return width, count


@kernel
def wave(costs: Uint8Array, table: Float32Array, target: Tuple[int, int], start: Tuple[int, int],
         potential: Float32Array, allowed: Uint8Array, quadratic: bool) -> Tuple[Int32Array, int, bool]:
    """Compute the potential from a target outwards until the start is reached.

    The four neighbours of a cell are written one by one: in a loop over them, the processor foresees none of the
    branches, and the search takes three times as long.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost to cross a cell of each value; inf: blocked.
    target, start : (row, column)
        Neither is crossed if it is blocked. A start of (-1, -1) is never reached: all connected cells get a potential.
    potential : (H, W) float32
        inf before, changed.
    allowed : (h, w) uint8
        0: no cell of this block of BLOCK x BLOCK cells is entered; (0, 0): all are.
    quadratic : bool
        Whether the equation is solved with both neighbours; otherwise with the better one (4-connected distance).

    Returns
    -------
    visited : (N,) int32
        Indices of the cells whose potential was changed, with repetitions.
    count : int
        How many of them are used.
    reached : bool
    """
    rows, columns = costs.shape
    width, bands = _bands(table)
    inverse = np.float32(1.0) / width
    room = 8 * _AT_ONCE
    queue, counts = np.empty((bands, room), np.int64), np.zeros(bands, np.int64)    # circular: cells of each band
    visited = np.empty(4096, np.int32)
    potential[target] = 0.0
    _put(queue, counts, 0, target[0], target[1])
    visited[0], seen, level, idle = target[0] * columns + target[1], 1, 0, 0
    watched = start[0] >= 0
    while idle < bands:                         # as many empty bands: nothing waits
        place, taken = level & (bands - 1), 0
        idle = 0 if counts[place] > 0 else idle + 1
        lowest = level * width
        while taken < counts[place]:
            if counts.max() + 4 * _AT_ONCE > room:
                wider = np.empty((bands, 2 * room), np.int64)
                wider[:, :room] = queue
                queue, room = wider, 2 * room
            if seen + 4 * _AT_ONCE > len(visited):
                visited = np.concatenate((visited, np.empty(len(visited), np.int32)))
            last = min(taken + _AT_ONCE, counts[place])
            for k in range(taken, last):
                item = queue[place, k]
                row, column = item >> _BITS, item & _COLUMN
                here = potential[row, column]
                if here < lowest:
                    continue                    # it has been taken in a lower band
                down, up, right, left = row + 1 < rows, row > 0, column + 1 < columns, column > 0
                if down:
                    new = _offer(costs, table, potential, allowed, row + 1, column, 0, 1, left, right, here, quadratic)
                    if new >= 0.0:
                        _put(queue, counts, max(int(new * inverse), level), row + 1, column)
                        visited[seen] = (row + 1) * columns + column
                        seen += 1
                if up:
                    new = _offer(costs, table, potential, allowed, row - 1, column, 0, 1, left, right, here, quadratic)
                    if new >= 0.0:
                        _put(queue, counts, max(int(new * inverse), level), row - 1, column)
                        visited[seen] = (row - 1) * columns + column
                        seen += 1
                if right:
                    new = _offer(costs, table, potential, allowed, row, column + 1, 1, 0, up, down, here, quadratic)
                    if new >= 0.0:
                        _put(queue, counts, max(int(new * inverse), level), row, column + 1)
                        visited[seen] = row * columns + column + 1
                        seen += 1
                if left:
                    new = _offer(costs, table, potential, allowed, row, column - 1, 1, 0, up, down, here, quadratic)
                    if new >= 0.0:
                        _put(queue, counts, max(int(new * inverse), level), row, column - 1)
                        visited[seen] = row * columns + column - 1
                        seen += 1
            taken = last
        counts[place] = 0
        level += 1
        if watched and potential[start] < level * width:
            return visited, seen, True
    return visited, seen, watched and potential[start] < _INF


@kernel
def restore(potential: Float32Array, visited: Int32Array, count: int) -> None:
    """Set the potential of visited cells back to inf.

    Parameters
    ----------
    potential : (H, W) float32
        Changed.
    visited : (N,) int32
    count : int
        How many of them are used.
    """
    flat = potential.ravel()
    for k in range(count):
        flat[visited[k]] = np.inf


@kernel
def _slope(potential: Float32Array, row: int, column: int) -> Tuple[float, float]:
    """Return the downward unit direction (along the rows, along the columns) at a cell; 0, 0 at a blocked one."""
    here = potential[row, column]
    if not here < np.inf:
        return 0.0, 0.0
    down, up = _value(potential, row - 1, column), _value(potential, row + 1, column)
    left, right = _value(potential, row, column - 1), _value(potential, row, column + 1)
    rise = (here - up if up < here else 0.0) if up < down else (down - here if down < here else 0.0)
    run = (here - right if right < here else 0.0) if right < left else (left - here if left < here else 0.0)
    length = math.hypot(rise, run)
    return (0.0, 0.0) if length == 0.0 else (rise / length, run / length)


@kernel
def _lowest_neighbour(potential: Float32Array, row: int, column: int) -> Tuple[int, int]:
    """Return the neighbour of eight with the lowest potential; no diagonal passes a cell without potential."""
    best, best_row, best_column = potential[row, column], row, column
    for r in range(row - 1, row + 2):
        for c in range(column - 1, column + 2):
            value = _value(potential, r, c)
            if value < best and _value(potential, r, column) < np.inf and _value(potential, row, c) < np.inf:
                best, best_row, best_column = value, r, c
    return best_row, best_column


@kernel
def descend(potential: Float32Array, start: Tuple[int, int], target: Tuple[int, int], gradient: bool) -> FloatArray:
    """Return a path from the start down to the target, in cells: (row, column) with centres at whole numbers.

    Parameters
    ----------
    potential : (H, W) float32
        Of :func:`wave`; both cells have a finite one.
    start, target : (row, column)
    gradient : bool
        Whether the path follows the gradient in half-cell steps; otherwise it goes from cell to cell.

    Returns
    -------
    (N, 2) float64
    """
    path = np.empty((1024, 2), np.float64)
    count = 1
    y, x = float(start[0]), float(start[1])
    path[0, 0], path[0, 1] = y, x
    row, column = start
    lowest, inside = potential[start], 0
    while abs(row - target[0]) > 1 or abs(column - target[1]) > 1:
        if count + 2 >= len(path):
            path = np.concatenate((path, np.empty((len(path), 2), np.float64)))
        moved = False
        if gradient:
            rise, run = _blended_slope(potential, y, x)
            length = math.hypot(rise, run)
            if length > 1e-3:
                to_y, to_x = y + 0.5 * rise / length, x + 0.5 * run / length
                to_row, to_column = int(math.floor(to_y + 0.5)), int(math.floor(to_x + 0.5))
                value = _value(potential, to_row, to_column)
                crossed = to_row != row and to_column != column and not (
                    _value(potential, to_row, column) < np.inf and _value(potential, row, to_column) < np.inf)
                same = to_row == row and to_column == column
                moved = value < np.inf and not crossed and (value < lowest or (same and inside < _MOST_INSIDE))
        if not moved:
            to_row, to_column = _lowest_neighbour(potential, row, column)
            if to_row == row and to_column == column:
                break
            to_y, to_x = float(to_row), float(to_column)
        inside = inside + 1 if to_row == row and to_column == column else 0
        y, x, row, column = to_y, to_x, to_row, to_column
        lowest = min(lowest, potential[row, column])
        path[count, 0], path[count, 1] = y, x
        count += 1
    path[count, 0], path[count, 1] = float(target[0]), float(target[1])
    return path[:count + 1].copy()


@kernel
def _blended_slope(potential: Float32Array, y: float, x: float) -> Tuple[float, float]:
    """Return the bilinear mean of the directions at the four cells around a point."""
    row, column = int(math.floor(y)), int(math.floor(x))
    share_y, share_x = y - row, x - column
    rise = run = 0.0
    for k in range(4):
        r, c = row + (k >> 1), column + (k & 1)
        weight = (share_y if k >> 1 else 1.0 - share_y) * (share_x if k & 1 else 1.0 - share_x)
        if weight > 0.0 and 0 <= r < potential.shape[0] and 0 <= c < potential.shape[1]:
            a, b = _slope(potential, r, c)
            rise, run = rise + weight * a, run + weight * b
    return rise, run


@kernel
def connected(costs: Uint8Array, table: Float32Array, start: Tuple[int, int]) -> Tuple[Uint8Array, int]:
    """Return which cells (H, W) uint8 are connected with a start through cells that are not blocked, and their number.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        inf: blocked.
    start : (row, column)
        May be blocked.
    """
    rows, columns = costs.shape
    found = np.zeros((rows, columns), np.uint8)
    todo = np.empty(rows * columns, np.int32)
    todo[0] = start[0] * columns + start[1]
    found[start] = 1
    first, last = 0, 1
    while first < last:
        row, column = todo[first] // columns, todo[first] % columns
        first += 1
        for side in range(4):
            r = row + (1 if side == 0 else -1 if side == 1 else 0)
            c = column + (1 if side == 2 else -1 if side == 3 else 0)
            if 0 <= r < rows and 0 <= c < columns and found[r, c] == 0 and table[costs[r, c]] < np.inf:
                found[r, c] = 1
                todo[last] = r * columns + c
                last += 1
    return found, last
