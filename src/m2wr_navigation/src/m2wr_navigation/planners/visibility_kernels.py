# SPDX-License-Identifier: BSD-3-Clause
"""The exact shortest path between blocked cells: a visibility graph over their corners (Lozano-Perez, Wesley 1979)."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import IndexArray, Uint8Array


@kernel
def _is_blocked(blocked: Uint8Array, row: int, column: int) -> bool:
    outside = row < 0 or column < 0 or row >= blocked.shape[0] or column >= blocked.shape[1]
    return outside or blocked[row, column] != 0


@kernel
def sees(blocked: Uint8Array, y: int, x: int, last_y: int, last_x: int) -> bool:
    """Return whether the straight line between two points passes the inside of no blocked cell; exact.

    Parameters
    ----------
    blocked : (H, W) uint8
        Cells outside of the grid are blocked, too.
    y, x, last_y, last_x : int
        In half cells: the corners of cells are even, their centres odd.
    """
    if y > last_y:
        y, x, last_y, last_x = last_y, last_x, y, x
    rise, run = last_y - y, last_x - x
    if rise == 0:
        low, high = min(x, last_x), max(x, last_x)
        for column in range(low // 2, (high + 1) // 2):
            if y % 2:
                if _is_blocked(blocked, y // 2, column):
                    return False
            elif _is_blocked(blocked, y // 2, column) and _is_blocked(blocked, y // 2 - 1, column):
                return False
        return True
    for row in range(y // 2, (last_y + 1) // 2):
        begin, end = max(2 * row, y), min(2 * row + 2, last_y)
        # x at the two ends of the line within this row of cells, times rise
        first, second = x * rise + run * (begin - y), x * rise + run * (end - y)
        low, high = min(first, second), max(first, second)
        if low == high and low % (2 * rise) == 0:           # along a side of cells
            column = low // (2 * rise)
            if _is_blocked(blocked, row, column) and _is_blocked(blocked, row, column - 1):
                return False
            continue
        for column in range(low // (2 * rise), -((-high) // (2 * rise))):
            if _is_blocked(blocked, row, column):
                return False
    return True


@kernel
def corners(blocked: Uint8Array) -> IndexArray:
    """Return the corners (N, 2) at which a shortest path may turn, y and x in half cells.

    Parameters
    ----------
    blocked : (H, W) uint8
    """
    found = np.empty(((blocked.shape[0] + 1) * (blocked.shape[1] + 1), 2), np.int64)
    count = 0
    for row in range(1, blocked.shape[0]):
        for column in range(1, blocked.shape[1]):
            if blocked[row, column] + blocked[row - 1, column] + blocked[row, column - 1] \
                    + blocked[row - 1, column - 1] == 1:
                found[count, 0], found[count, 1] = 2 * row, 2 * column
                count += 1
    return found[:count].copy()


@kernel
def shortest(blocked: Uint8Array, start: Tuple[int, int], target: Tuple[int, int]) -> Tuple[IndexArray, float]:
    """Return the corners of the shortest path and its length.

    A path may slide along blocked cells, and pass between two of them that meet in a corner.

    Parameters
    ----------
    blocked : (H, W) uint8
        0 or 1.
    start, target : (row, column)
        The path leads from centre to centre.

    Returns
    -------
    path : (N, 2) int64
        y and x in half cells; N = 0: there is none.
    length : float
        In cells; inf: there is none.
    """
    inner = corners(blocked)
    nodes = np.empty((len(inner) + 2, 2), np.int64)
    nodes[0, 0], nodes[0, 1] = 2 * start[0] + 1, 2 * start[1] + 1
    nodes[1, 0], nodes[1, 1] = 2 * target[0] + 1, 2 * target[1] + 1
    nodes[2:] = inner
    count = len(nodes)
    total = np.full(count, np.inf)
    before, closed = np.full(count, -1, np.int64), np.zeros(count, np.uint8)
    total[0] = 0.0
    while True:
        best, at = np.inf, -1
        for k in range(count):
            if closed[k] == 0 and total[k] < np.inf:
                ahead = math.hypot(nodes[k, 0] - nodes[1, 0], nodes[k, 1] - nodes[1, 1])
                if total[k] + ahead < best:
                    best, at = total[k] + ahead, k
        if at < 0:
            return np.empty((0, 2), np.int64), np.inf
        if at == 1:
            break
        closed[at] = 1
        for k in range(count):
            new = total[at] + math.hypot(nodes[k, 0] - nodes[at, 0], nodes[k, 1] - nodes[at, 1])
            if closed[k] == 0 and new < total[k] and sees(
                    blocked, nodes[at, 0], nodes[at, 1], nodes[k, 0], nodes[k, 1]):
                total[k], before[k] = new, at
    steps, at = 0, 1
    while at >= 0:
        steps, at = steps + 1, before[at]
    path = np.empty((steps, 2), np.int64)
    at = 1
    for k in range(steps - 1, -1, -1):
        path[k] = nodes[at]
        at = before[at]
    return path, 0.5 * total[1]
