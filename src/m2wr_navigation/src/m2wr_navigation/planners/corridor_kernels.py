# SPDX-License-Identifier: BSD-3-Clause
"""A corridor of blocks of cells that holds a good path through a large grid.

The free cells of each block of 8 x 8 cells fall into connected parts. The graph of these parts, with an edge where free
cells of two parts are neighbours, has exactly the connectivity of the grid: no narrow passage is lost, no wall has a
leak. Its shortest path is found by A*, and the blocks around it are the corridor in which the grid is searched. Edges
are the straight distances of the parts' centres times their mean costs, so that the corridor is that of a nearly best
path.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.planners.block_layout import BLOCK
from m2wr_navigation.planners.heap_kernels import pop, push
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, Int32Array, Uint8Array

_MOST_PARTS = 33            # 32 isolated cells of a chessboard, and one


@kernel
def _extremes(line: Uint8Array, least: Uint8Array, greatest: Uint8Array) -> None:
    for column in range(line.shape[0]):
        least[column] = min(least[column], line[column])
        greatest[column] = max(greatest[column], line[column])


@kernel
def _label_block(costs: Uint8Array, table: Float32Array, labels: Uint8Array, top: int, left: int,
                 stack: Int32Array, sums: Float32Array) -> int:
    """Write the part (1, 2, ...) of each free cell of a block; return the number of parts."""
    bottom, right = min(top + BLOCK, costs.shape[0]), min(left + BLOCK, costs.shape[1])
    for row in range(top, bottom):
        for column in range(left, right):
            labels[row, column] = 0
    parts = 0
    for row in range(top, bottom):
        for column in range(left, right):
            if labels[row, column] != 0 or not table[costs[row, column]] < np.inf:
                continue
            sums[parts, :] = 0.0
            parts += 1
            labels[row, column] = parts
            stack[0], count = row * costs.shape[1] + column, 1
            while count > 0:
                count -= 1
                at_row, at_column = stack[count] // costs.shape[1], stack[count] % costs.shape[1]
                sums[parts - 1, 0] += 1.0
                sums[parts - 1, 1] += at_row
                sums[parts - 1, 2] += at_column
                sums[parts - 1, 3] += table[costs[at_row, at_column]]
                for side in range(4):
                    r = at_row + (1 if side == 0 else -1 if side == 1 else 0)
                    c = at_column + (1 if side == 2 else -1 if side == 3 else 0)
                    if top <= r < bottom and left <= c < right and labels[r, c] == 0 \
                            and table[costs[r, c]] < np.inf:
                        labels[r, c] = parts
                        stack[count] = r * costs.shape[1] + c
                        count += 1
    return parts


@kernel
def label_parts(costs: Uint8Array, table: Float32Array, start: Tuple[int, int],
                target: Tuple[int, int]) -> Tuple[Int32Array, Uint8Array, Float32Array]:
    """Divide the free cells of each block into connected parts.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost of each value; inf: blocked.
    start, target : (row, column)
        Their blocks are always labelled cell by cell.

    Returns
    -------
    first : (h, w) int32
        Number of the first part of each block; its parts have numbers in sequence. -1: without a free cell.
    labels : (H, W) uint8
        Part within the block, from 1; only written where ``uniform`` parts do not tell.
    parts : (N, 4) float32
        Row and column of the centre, mean cost, 1 if the part is a whole block.
    """
    rows, columns = costs.shape
    high, wide = (rows + BLOCK - 1) // BLOCK, (columns + BLOCK - 1) // BLOCK
    first = np.full((high, wide), -1, np.int32)
    labels = np.empty((rows, columns), np.uint8)
    parts = np.empty((high * wide + 64, 4), np.float32)
    least, greatest = np.empty(columns, np.uint8), np.empty(columns, np.uint8)
    stack, sums = np.empty(BLOCK * BLOCK, np.int32), np.empty((_MOST_PARTS, 4), np.float32)
    count = 0
    for up in range(high):
        least[:], greatest[:] = costs[up * BLOCK], costs[up * BLOCK]
        for row in range(up * BLOCK + 1, min((up + 1) * BLOCK, rows)):
            _extremes(costs[row], least, greatest)
        for across in range(wide):
            left, right = across * BLOCK, min((across + 1) * BLOCK, columns)
            low, top_cost = 255, 0
            for column in range(left, right):
                low, top_cost = min(low, int(least[column])), max(top_cost, int(greatest[column]))
            special = (up == start[0] // BLOCK and across == start[1] // BLOCK) or (
                up == target[0] // BLOCK and across == target[1] // BLOCK)
            if not special and low == top_cost and not table[low] < np.inf:
                continue
            if count + _MOST_PARTS >= len(parts):
                parts = np.concatenate((parts, np.empty((len(parts), 4), np.float32)))
            if not special and (top_cost == low or (top_cost < 253 and table[top_cost] < np.inf)):
                first[up, across] = count
                parts[count, 0] = 0.5 * (up * BLOCK + min((up + 1) * BLOCK, rows) - 1)
                parts[count, 1] = 0.5 * (left + right - 1)
                parts[count, 2] = 0.5 * (table[low] + table[top_cost])
                parts[count, 3] = 1.0
                count += 1
                continue
            found = _label_block(costs, table, labels, up * BLOCK, left, stack, sums)
            if found == 0:
                continue
            first[up, across] = count
            for k in range(found):
                for axis in range(3):
                    parts[count, axis] = sums[k, axis + 1] / sums[k, 0]
                parts[count, 3] = 0.0
                count += 1
    return first, labels, parts[:count]


@kernel
def part_of(first: Int32Array, labels: Uint8Array, parts: Float32Array, costs: Uint8Array, table: Float32Array,
            row: int, column: int) -> int:
    """Return the number of the part that holds a cell, or -1.

    Parameters
    ----------
    first, labels, parts : arrays
        Of :func:`label_parts`.
    costs : (H, W) uint8
    table : (256,) float32
    row, column : int
        May be outside of the grid.
    """
    if not (0 <= row < costs.shape[0] and 0 <= column < costs.shape[1]):
        return -1
    number = first[row // BLOCK, column // BLOCK]
    if number < 0 or not table[costs[row, column]] < np.inf:
        return -1
    return number if parts[number, 3] == 1.0 else number + labels[row, column] - 1


@kernel
def _neighbours(first: Int32Array, labels: Uint8Array, parts: Float32Array, costs: Uint8Array, table: Float32Array,
                number: int, found: Int32Array) -> int:
    """Write the numbers of the neighbours of a part, some twice; return how many."""
    row, column = int(parts[number, 0]), int(parts[number, 1])
    top, left = row // BLOCK * BLOCK, column // BLOCK * BLOCK
    bottom, right = min(top + BLOCK, costs.shape[0]) - 1, min(left + BLOCK, costs.shape[1]) - 1
    count, before, whole = 0, -1, parts[number, 3] == 1.0
    for side in range(4):
        before = -1
        next_up = top // BLOCK + (1 if side == 0 else -1 if side == 1 else 0)
        next_across = left // BLOCK + (1 if side == 2 else -1 if side == 3 else 0)
        if not (0 <= next_up < first.shape[0] and 0 <= next_across < first.shape[1]):
            continue
        other = first[next_up, next_across]
        if other < 0:
            continue
        if whole and parts[other, 3] == 1.0:
            found[count] = other
            count += 1
            continue
        length = (right - left if side < 2 else bottom - top) + 1
        for k in range(length):
            r = bottom if side == 0 else top if side == 1 else top + k
            c = right if side == 2 else left if side == 3 else left + k
            if part_of(first, labels, parts, costs, table, r, c) != number:
                continue
            r += 1 if side == 0 else -1 if side == 1 else 0
            c += 1 if side == 2 else -1 if side == 3 else 0
            other = part_of(first, labels, parts, costs, table, r, c)
            if other >= 0 and other != before:
                found[count] = other
                count += 1
                before = other
    for corner in range(4):
        r, down = (bottom, 1) if corner < 2 else (top, -1)
        c, along = (right, 1) if corner % 2 else (left, -1)
        if part_of(first, labels, parts, costs, table, r, c) == number \
                and part_of(first, labels, parts, costs, table, r + down, c) >= 0 \
                and part_of(first, labels, parts, costs, table, r, c + along) >= 0:
            other = part_of(first, labels, parts, costs, table, r + down, c + along)
            if other >= 0:
                found[count] = other
                count += 1
    return count


@kernel
def corridor(costs: Uint8Array, table: Float32Array, start: Tuple[int, int], target: Tuple[int, int],
             width: int) -> Tuple[Uint8Array, bool]:
    """Return the blocks around the shortest path through the graph of parts.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost of each value, in which 0 has the least; inf: blocked.
    start, target : (row, column)
        Free cells.
    width : int
        Blocks to each side of the path.

    Returns
    -------
    allowed : (h, w) uint8
        1 in the corridor.
    found : bool
        Whether start and target are connected.
    """
    first, labels, parts = label_parts(costs, table, start, target)
    allowed = np.zeros(first.shape, np.uint8)
    begin = part_of(first, labels, parts, costs, table, start[0], start[1])
    end = part_of(first, labels, parts, costs, table, target[0], target[1])
    if begin < 0 or end < 0:
        return allowed, False
    total = np.full(len(parts), np.inf, np.float32)
    parent, closed = np.full(len(parts), -1, np.int32), np.zeros(len(parts), np.uint8)
    keys, items = np.empty(4096, np.float32), np.empty(4096, np.int32)
    found = np.empty(4 * BLOCK + 8, np.int32)
    total[begin] = 0.0
    waiting = push(keys, items, 0, 0.0, begin)
    while waiting > 0:
        number = items[0]
        waiting = pop(keys, items, waiting)
        if number == end:
            break
        if closed[number] == 1:
            continue
        closed[number] = 1
        if waiting + len(found) >= len(keys):
            keys = np.concatenate((keys, np.empty(len(keys), np.float32)))
            items = np.concatenate((items, np.empty(len(items), np.int32)))
        for k in range(_neighbours(first, labels, parts, costs, table, number, found)):
            other = found[k]
            if closed[other] == 1:
                continue
            length = math.hypot(parts[other, 0] - parts[number, 0], parts[other, 1] - parts[number, 1])
            new = np.float32(total[number] + 0.5 * length * (parts[number, 2] + parts[other, 2]))
            if new < total[other]:
                total[other], parent[other] = new, number
                ahead = math.hypot(parts[other, 0] - parts[end, 0], parts[other, 1] - parts[end, 1]) * table[0]
                waiting = push(keys, items, waiting, new + ahead, other)
    if not total[end] < np.inf:
        return allowed, False
    at = end
    while at >= 0:
        up, across = int(parts[at, 0]) // BLOCK, int(parts[at, 1]) // BLOCK
        allowed[max(0, up - width):up + width + 1, max(0, across - width):across + width + 1] = 1
        at = parent[at]
    return allowed, True
