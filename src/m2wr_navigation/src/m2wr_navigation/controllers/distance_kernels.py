# SPDX-License-Identifier: BSD-3-Clause
"""Distances over the local costmap, round obstacles: the Eikonal equation, solved from the nearest cells outwards."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import INSCRIBED, LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, IndexArray, Uint8Array

#: Value of a cell that is not entered: lethal, or unknown. Greater ones: no way leads there.
BLOCKED = np.float32(1e30)
_UNREACHED, _ONE, _TWO, _HALF = np.float32(2e30), np.float32(1.0), np.float32(2.0), np.float32(0.5)
_CHANGE = np.float32(1e-3)          # cells: a distance is not lowered by less
_BITS, _COLUMN = 32, 2 ** 32 - 1    # a cell in a queue: row << _BITS | column
_FREE, _INSIDE = 0, 1               # which cells are entered in a pass: all but the inscribed ones, or these


@kernel
def spread_distances(costs: Uint8Array, seeds: IndexArray, queues: IndexArray, passes: Uint8Array,
                     out: Float32Array) -> None:
    """Compute the length of the shortest way from each cell to the nearest one of some cells.

    The Eikonal equation ``|grad d| = 1`` is solved. A count of steps between cells with a common side, as in C++, is up
    to 41 % longer. It is equal for all staircases between two points, and so it does not tell headings within a quarter
    of a turn apart.

    Parameters
    ----------
    costs : (H, W) uint8
        Lethal and unknown cells are not entered. From inscribed cells a way leads out, by which a robot that has come
        near to a wall finds back; no way leads in, since it would be a short cut that the robot cannot take.
    seeds : (K, 2) int64
        Row and column, within the grid.
    queues : (4, 4 * H * W) int64
        Working memory.
    passes : (H, W) uint8
        Working memory.
    out : (H, W) float32
        Written, in cells; BLOCKED in cells that are not entered, more where no way leads.
    """
    rows, columns = costs.shape
    for row in range(rows):
        for column in range(columns):
            cost = costs[row, column]
            out[row, column] = BLOCKED if cost == LETHAL or cost == NO_INFORMATION else _UNREACHED
            passes[row, column] = _INSIDE if cost == INSCRIBED else _FREE
    count = 0
    for k in range(len(seeds)):
        row, column = seeds[k, 0], seeds[k, 1]
        if out[row, column] != 0.0:
            out[row, column] = 0.0
            queues[0, count] = (row << _BITS) | column
            count += 1
    count = _propagate(passes, _FREE, queues[0], count, queues[1], queues[2:], out)
    _propagate(passes, _INSIDE, queues[1], count, queues[0], queues[2:], out)


@kernel
def _propagate(passes: Uint8Array, kind: int, sources: IndexArray, count: int, borders: IndexArray, queues: IndexArray,
               out: Float32Array) -> int:
    """Lower the distances of the cells of a kind, from some cells outwards.

    Cells are taken below a limit, which rises by one cell whenever none is left. One that is lowered again is taken
    again, so the order below the limit does not matter.

    Parameters
    ----------
    passes : (H, W) uint8
        Kind of each cell.
    kind : int
        _FREE or _INSIDE.
    sources : (N,) int64
        Cells with a distance, ordered by its whole part; the first ``count`` are used.
    count : int
    borders : (N,) int64
        Written: cells that have a neighbour of another kind, in the same order.
    queues : (2, N) int64
        Working memory.
    out : (H, W) float32
        Changed.

    Returns
    -------
    int
        How many borders there are.
    """
    rows, columns = passes.shape
    next_source = found = waiting = now = 0
    limit = np.float32(0.0)
    while waiting > 0 or next_source < count:
        queue, later, now = queues[now], queues[1 - now], 1 - now
        limit += _ONE
        if waiting == 0:
            limit = max(limit, np.float32(math.floor(_of(out, sources[next_source]))) + _ONE)
        in_queue, waiting, taken = waiting, 0, 0
        while next_source < count and in_queue < len(queue) and _of(out, sources[next_source]) < limit:
            queue[in_queue] = sources[next_source]
            in_queue, next_source = in_queue + 1, next_source + 1
        while taken < in_queue:
            row, column = queue[taken] >> _BITS, queue[taken] & _COLUMN
            taken += 1
            here, border = out[row, column], False
            for side in range(4):
                to_row, to_column = row + (side == 0) - (side == 1), column + (side == 2) - (side == 3)
                if not (0 <= to_row < rows and 0 <= to_column < columns):
                    continue
                if passes[to_row, to_column] != kind:
                    border = True
                elif _is_lowered(to_row, to_column, side < 2, here, out):
                    if out[to_row, to_column] >= limit:
                        later[waiting] = (to_row << _BITS) | to_column
                        waiting += waiting < len(later) - 1
                    else:
                        queue[in_queue] = (to_row << _BITS) | to_column
                        in_queue += in_queue < len(queue) - 1
            if border:
                borders[found] = (row << _BITS) | column
                found += found < len(borders) - 1
    return found


@kernel
def _of(out: Float32Array, cell: int) -> np.float32:
    """Return the distance of a cell of a queue."""
    return out[cell >> _BITS, cell & _COLUMN]


@kernel
def _is_lowered(row: int, column: int, along_rows: bool, here: np.float32, out: Float32Array) -> bool:
    """Solve the equation in a neighbour of a cell with the distance ``here``; return if it is lowered.

    The cell and its neighbour are in one column (``along_rows``), or in one row.
    """
    before = out[row, column]
    if before <= here or before == BLOCKED:
        return False
    rows, columns = out.shape
    if along_rows:
        other = min(out[row, column - 1] if column > 0 else _UNREACHED,
                    out[row, column + 1] if column < columns - 1 else _UNREACHED)
    else:
        other = min(out[row - 1, column] if row > 0 else _UNREACHED,
                    out[row + 1, column] if row < rows - 1 else _UNREACHED)
    apart = abs(here - other)
    new = min(here, other) + _ONE if not apart < _ONE else \
        _HALF * (here + other + np.float32(math.sqrt(_TWO - apart * apart)))
    if new < before - _CHANGE:
        out[row, column] = new
        return True
    return False
