# SPDX-License-Identifier: BSD-3-Clause
"""Tracing beams into counts of hits and visits, and reading counts out as an occupancy grid.

Array layouts
-------------
``table`` (H, W) int32
    Block of counts at each place of 32 x 32 cells, -1 if there are no counts yet.
``counts`` (B, 1024, 2) uint16 or uint32
    Hits and visits of the cells of each block, row by row.
``used`` (2,) int64
    Number of blocks in use, the blocks behind them are spare; greatest number of visits so far.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import (
        BoolArray,
        CountArray,
        Float32Array,
        FloatArray,
        IndexArray,
        Int8Array,
        Int32Array,
    )

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
HITS, VISITS = 0, 1
SHIFT, MASK, SIDE, CELLS = 5, 31, 32, 1024


@kernel
def _block_at(ty: int, tx: int, table: Int32Array, counts: CountArray, used: IndexArray) -> int:
    """Return the block at a place; an empty spare block if there was none."""
    block = table[ty, tx]
    if block < 0:
        block = used[0]
        used[0] += 1
        table[ty, tx] = block
        for cell in range(CELLS):
            counts[block, cell, HITS] = 0
            counts[block, cell, VISITS] = 0
    return block


@kernel
def _trace(x0: int, y0: int, x1: int, y1: int, sign: int, hit: bool, table: Int32Array,
           counts: CountArray, used: IndexArray) -> int:
    """Add ``sign`` to the visits of all cells on the line from (x0, y0) to (x1, y1) except the last one.

    The line is an integer line, drawn from the end with the smaller x, or the smaller y if it is steep. With ``hit``
    the last cell gets a visit and a hit. Returns the greatest number of visits of these cells.
    """
    greatest = 0
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    rows, columns = table.shape[0] << SHIFT, table.shape[1] << SHIFT
    steep = dy > dx
    if steep:
        a0, b0, a1, b1, da, db = y0, x0, y1, x1, dy, dx
    else:
        a0, b0, a1, b1, da, db = x0, y0, x1, y1, dx, dy
    last_a = a1
    if a0 > a1:
        a0, b0, a1, b1 = a1, b1, a0, b0
    rise = 1 if b1 > b0 else -1
    d, b = 2 * db - da, b0
    block, place_x, place_y = -1, -1, -1
    for a in range(a0, a1 + 1):
        if a != last_a or hit:
            if steep:
                x, y = b, a
            else:
                x, y = a, b
            if x >= 0 and y >= 0 and x < columns and y < rows:
                if x >> SHIFT != place_x or y >> SHIFT != place_y:
                    place_x, place_y = x >> SHIFT, y >> SHIFT
                    block = _block_at(place_y, place_x, table, counts, used)
                cell = ((y & MASK) << SHIFT) | (x & MASK)
                counts[block, cell, VISITS] += sign
                greatest = max(greatest, counts[block, cell, VISITS])
                if a == last_a:
                    counts[block, cell, HITS] += sign
        if d > 0:
            b += rise
            d += 2 * (db - da)
        else:
            d += 2 * db
    return greatest


@kernel
def add_scan(pose: FloatArray, rays: Float32Array, ray_hits: BoolArray, first: int, anchor: FloatArray,
             per_metre: float, shift: IndexArray, sign: int, limit: int, table: Int32Array, counts: CountArray,
             used: IndexArray) -> int:
    """Add or remove a scan, starting with beam ``first``.

    Parameters
    ----------
    pose : (3,) float64
        Pose of the laser in ``map`` [m, m, rad].
    rays : (2, S) float32
        Ends of the beams [m, laser frame].
    ray_hits : (S,) bool
        Whether each ray ends at an obstacle.
    first : int
        First beam.
    anchor : (2,) float64
        Centre of a cell in ``map`` [m]. It must be the same in all calls, so that a scan is removed where it was added.
    per_metre : float
        Cells per metre.
    shift : (2,) int64
        Column and row of that cell; cells outside the table are left out.
    sign : int
        1 adds, -1 removes.
    limit : int
        Greatest count that fits into the arrays.
    table : (H, W) int32
        See the module.
    counts : (B, 1024, 2) uint16 or uint32
        See the module.
    used : (2,) int64
        See the module.

    Returns
    -------
    int
        Number of beams done; less than S if the spare blocks or the limit may not be sufficient for the next beam.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x0 = int(math.floor((pose[0] - anchor[0]) * per_metre + 0.5)) + shift[0]
    y0 = int(math.floor((pose[1] - anchor[1]) * per_metre + 0.5)) + shift[1]
    rows = table.shape[0] << SHIFT
    for k in range(first, rays.shape[1]):
        wx = pose[0] + c * rays[0, k] - s * rays[1, k]
        wy = pose[1] + s * rays[0, k] + c * rays[1, k]
        x1 = int(math.floor((wx - anchor[0]) * per_metre + 0.5)) + shift[0]
        y1 = int(math.floor((wy - anchor[1]) * per_metre + 0.5)) + shift[1]
        if max(y0, y1) < 0 or min(y0, y1) >= rows:
            continue
        # greatest number of blocks that the line crosses
        most = (abs(x1 - x0) >> SHIFT) + (abs(y1 - y0) >> SHIFT) + 3
        if used[0] + min(most, table.size - used[0]) > counts.shape[0]:
            return k
        used[1] = max(used[1], _trace(x0, y0, x1, y1, sign, ray_hits[k], table, counts, used))
        if used[1] >= limit:
            return k + 1
    return rays.shape[1]


@kernel
def read_out(threshold: float, table: Int32Array, counts: CountArray, grid: Int8Array) -> None:
    """Write the occupancy of all cells with counts into a grid.

    Parameters
    ----------
    threshold : float
        A cell is occupied if hits / visits is greater.
    table : (H, W) int32
        See the module.
    counts : (B, 1024, 2) uint16 or uint32
        See the module.
    grid : (32 H, 32 W) int8
        Written where there are blocks.
    """
    for ty in range(table.shape[0]):
        for tx in range(table.shape[1]):
            block = table[ty, tx]
            if block < 0:
                continue
            for row in range(SIDE):             # without branches and with plain indices: vectorised
                for column in range(SIDE):
                    cell = (row << SHIFT) | column
                    hits, visits = counts[block, cell, HITS], counts[block, cell, VISITS]
                    seen = OCCUPIED if hits / visits > threshold else FREE
                    grid[(ty << SHIFT) + row, (tx << SHIFT) + column] = UNKNOWN if visits == 0 else seen
