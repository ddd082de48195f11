# SPDX-License-Identifier: BSD-3-Clause
"""Potential of a grid: the cost of the best path from each cell to a target, by fast marching.

The Eikonal equation ``|grad T| = h`` with h, the cost of a cell, is solved cell by cell in the order of T (Sethian
1996). The queue has bands of half the least cost. A cell whose potential is lowered again enters it again, so the order
within a band does not matter.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np
from numba import njit

from m2wr_navigation.planners.block_layout import BLOCK

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import Float32Array, FloatArray, Int32Array, Uint8Array

_MOST_INSIDE = 3                        # half-cell steps of a path within one cell
_CHANGE = np.float32(1.0 - 1e-5)        # a potential that is lowered by less is kept: rounding of 32-bit numbers


@njit(cache=True, nogil=True, error_model='numpy')
def _solve(potential: Float32Array, row: int, column: int, rows: int, columns: int, cost: float,
           quadratic: bool) -> float:
    """Return the potential of a cell by those of its four neighbours."""
    across = along = np.float32(np.inf)
    if column > 0:
        across = potential[row, column - 1]
    if column + 1 < columns:
        across = min(across, potential[row, column + 1])
    if row > 0:
        along = potential[row - 1, column]
    if row + 1 < rows:
        along = min(along, potential[row + 1, column])
    low, high = min(across, along), max(across, along)
    apart = high - low
    if not quadratic or not apart < cost:
        return float(low + cost)
    return float(0.5 * (low + high + math.sqrt(2.0 * cost * cost - apart * apart)))


@njit(cache=True, nogil=True, error_model='numpy')
def wave(costs: Uint8Array, table: Float32Array, target: Tuple[int, int], start: Tuple[int, int],
         potential: Float32Array, allowed: Uint8Array, quadratic: bool) -> Tuple[Int32Array, int, bool]:
    """Compute the potential from a target outwards until the start is reached.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost to cross a cell of each value; inf: blocked.
    target, start : (row, column)
        The start may be blocked. A start of (-1, -1) is never reached: all connected cells get a potential.
    potential : (H, W) float32
        inf before, changed.
    allowed : (h, w) uint8
        0: no cell of this block of BLOCK x BLOCK cells is entered; (0, 0): all are.
    quadratic : bool
        Whether the equation is solved with both neighbours; otherwise with the better one (4-connected distance).

    Returns
    -------
    visited : (N,) int32
        Indices of the cells whose potential was changed, with repetitions, and one cell in reserve.
    count : int
        How many of them are used.
    reached : bool
    """
    rows, columns = costs.shape
    limited = allowed.shape[0] > 0
    greatest = np.float32(0.0)
    for value in range(256):
        if table[value] < np.inf:
            greatest = max(greatest, table[value])
    width = 0.5 * table[0]
    buckets = int(greatest / width) + 3
    heads = np.full(buckets, -1, np.int32)      # circular: of lists of waiting cells with potentials in the same band
    items, following = np.empty(4096, np.int32), np.empty(4096, np.int32)
    visited = np.empty(4096, np.int32)
    used, spare = 1, -1
    potential[target] = 0.0
    items[0], following[0], heads[0] = target[0] * columns + target[1], -1, 0
    visited[0], seen, waiting, level = items[0], 1, 1, 0
    watched = start[0] >= 0
    while waiting > 0:
        entry = heads[level % buckets]
        if entry < 0:
            level += 1
            if watched and potential[start] < level * width:
                return visited, seen, True
            continue
        item, heads[level % buckets] = items[entry], following[entry]
        following[entry], spare = spare, entry
        waiting -= 1
        row, column = item // columns, item % columns
        here = potential[row, column]
        if here < level * width:
            continue                            # it has been taken at a lower potential
        if seen + 4 >= len(visited):
            visited = np.concatenate((visited, np.empty(len(visited), np.int32)))
        if used + 4 >= len(items):
            items = np.concatenate((items, np.empty(len(items), np.int32)))
            following = np.concatenate((following, np.empty(len(following), np.int32)))
        for side in range(4):
            r = row + (1 if side == 0 else -1 if side == 1 else 0)
            c = column + (1 if side == 2 else -1 if side == 3 else 0)
            if not (0 <= r < rows and 0 <= c < columns) or potential[r, c] <= here:
                continue
            if limited and allowed[r // BLOCK, c // BLOCK] == 0:
                continue
            cost = table[costs[r, c]]
            if r == start[0] and c == start[1] and not cost < np.inf:
                cost = table[0]
            if not cost < np.inf:
                continue
            new = np.float32(_solve(potential, r, c, rows, columns, cost, quadratic))
            if new < potential[r, c] * _CHANGE:
                potential[r, c] = new
                visited[seen] = r * columns + c
                seen += 1
                if spare >= 0:
                    entry, spare = spare, following[spare]
                else:
                    entry, used = used, used + 1
                bucket = max(int(new / width), level) % buckets
                items[entry], following[entry], heads[bucket] = r * columns + c, heads[bucket], entry
                waiting += 1
    return visited, seen, watched and potential[start] < np.inf


@njit(cache=True, nogil=True, error_model='numpy')
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


@njit(cache=True, nogil=True, error_model='numpy')
def _value(potential: Float32Array, row: int, column: int) -> float:
    if 0 <= row < potential.shape[0] and 0 <= column < potential.shape[1]:
        return potential[row, column]
    return np.inf


@njit(cache=True, nogil=True, error_model='numpy')
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


@njit(cache=True, nogil=True, error_model='numpy')
def _lowest_neighbour(potential: Float32Array, row: int, column: int) -> Tuple[int, int]:
    """Return the neighbour of eight with the lowest potential; no diagonal passes a cell without potential."""
    best, best_row, best_column = potential[row, column], row, column
    for r in range(row - 1, row + 2):
        for c in range(column - 1, column + 2):
            value = _value(potential, r, c)
            if value < best and _value(potential, r, column) < np.inf and _value(potential, row, c) < np.inf:
                best, best_row, best_column = value, r, c
    return best_row, best_column


@njit(cache=True, nogil=True, error_model='numpy')
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


@njit(cache=True, nogil=True, error_model='numpy')
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


@njit(cache=True, nogil=True, error_model='numpy')
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
