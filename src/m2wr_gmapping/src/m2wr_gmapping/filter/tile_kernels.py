# SPDX-License-Identifier: BSD-3-Clause
"""Registration of scans in copy-on-write tile maps, with reference counts of tiles and blocks.

Array layouts
-------------
``table`` (N, H, W) int32
    Block of each particle at each place, -1 for none.
``blocks`` (G, 8, 8) int32
    Tile at each place of a block, -1 for none.
``mean`` (T, 256, 2) uint8, ``hits`` (T, 256) uint8
    Mean hit point of each cell of a tile of 16 x 16, from the cell's lower corner in units of UNIT cells, and its
    number of hits, which stops at MOST_HITS.
``block_holders`` (G,) int32, ``holders`` (T,) int32
    Number of particles that hold a block, and of blocks that hold a tile.
``free_blocks`` (G,) int32, ``free`` (T,) int32, ``counters`` (2,) int64
    Stacks of unused blocks and unused tiles, and their heights.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray, Int32Array, Uint8Array

SHIFT, MASK, CELLS = 4, 15, 256
BLOCK_SHIFT, BLOCK_MASK = 3, 7
CELL_TO_BLOCK = SHIFT + BLOCK_SHIFT       # shift from cells to blocks, which are the places of the table
BLOCKS, TILES = 0, 1                    # of ``counters``
UNIT, MOST_HITS = 1.0 / 255, 255
TURNS_TOGETHER = 4              # rotations that tiles_around handles together
PLACES, PLACE_SHIFT = 8, 5      # positions of a mean in its cell along one axis in draw_field: the upper three bits


@kernel
def tile_at(grid: Int32Array, blocks: Int32Array, ty: int, tx: int) -> int:
    """Return the tile of one map at a row and column of tiles, which must be within its table; -1 for none.

    Parameters
    ----------
    grid : (H, W) int32
        Table of one particle.
    blocks : (G, 8, 8) int32
        Tile at each place of a block, -1 for none.
    ty : int
        Row.
    tx : int
        Column.
    """
    block = grid[ty >> BLOCK_SHIFT, tx >> BLOCK_SHIFT]
    return -1 if block < 0 else blocks[block, ty & BLOCK_MASK, tx & BLOCK_MASK]


@kernel
def _own_block(grid: Int32Array, by: int, bx: int, blocks: Int32Array, block_holders: Int32Array,
               free_blocks: Int32Array, holders: Int32Array, counters: IndexArray) -> int:
    """Give a particle a block of its own at that place, a new one or a copy of the shared one; return it."""
    block = grid[by, bx]
    counters[BLOCKS] -= 1
    fresh = free_blocks[counters[BLOCKS]]
    block_holders[fresh] = 1
    grid[by, bx] = fresh
    if block < 0:
        blocks[fresh] = -1
        return fresh
    block_holders[block] -= 1
    for y in range(BLOCK_MASK + 1):
        for x in range(BLOCK_MASK + 1):
            tile = blocks[block, y, x]
            blocks[fresh, y, x] = tile
            if tile >= 0:
                holders[tile] += 1
    return fresh


@kernel
def _own_tile(tile: int, mean: Uint8Array, hits: Uint8Array, holders: Int32Array, free: Int32Array,
              counters: IndexArray) -> int:
    """Return a tile of one holder: a copy of a shared one, or a new one if that is -1."""
    counters[TILES] -= 1
    fresh = free[counters[TILES]]
    holders[fresh] = 1
    if tile < 0:
        for k in range(CELLS):
            hits[fresh, k] = 0
            mean[fresh, k, 0] = 0
            mean[fresh, k, 1] = 0
    else:
        holders[tile] -= 1
        for k in range(CELLS):
            hits[fresh, k] = hits[tile, k]
            mean[fresh, k, 0] = mean[tile, k, 0]
            mean[fresh, k, 1] = mean[tile, k, 1]
    return fresh


@kernel
def bounds(poses: FloatArray, points: FloatArray) -> Tuple[Tuple[float, float], Tuple[float, float]]:
    """Return lower and upper corner of a box that holds end points seen from any of the poses [m].

    Parameters
    ----------
    poses : (N, 3) float64
        Poses x, y [m], theta [rad] in ``map``.
    points : (2, B) float64
        End points [m, laser frame].
    """
    reach2 = 0.0
    for b in range(points.shape[1]):
        reach2 = max(reach2, points[0, b] * points[0, b] + points[1, b] * points[1, b])
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for n in range(poses.shape[0]):
        low_x, high_x = min(low_x, poses[n, 0]), max(high_x, poses[n, 0])
        low_y, high_y = min(low_y, poses[n, 1]), max(high_y, poses[n, 1])
    reach = math.sqrt(reach2)
    return (low_x - reach, low_y - reach), (high_x + reach, high_y + reach)


@kernel
def bounds_of_scans(path: FloatArray, points: FloatArray, parts: IndexArray, corners: FloatArray) -> None:
    """Write lower and upper corner of a box that holds the end points of each of several scans.

    Parameters
    ----------
    path : (K, 3) float64
        Poses of the scans x, y [m], theta [rad] in ``map``.
    points : (2, B) float64
        End points of all scans [m, laser frame].
    parts : (K, 2) int64
        First end point of each scan, and the one after the last.
    corners : (K, 2, 2) float64
        Written [m].
    """
    for k in range(path.shape[0]):
        low, high = bounds(path[k:k + 1], points[:, parts[k, 0]:parts[k, 1]])
        corners[k, 0, 0], corners[k, 0, 1], corners[k, 1, 0], corners[k, 1, 1] = low[0], low[1], high[0], high[1]


@kernel
def _register(grid: Int32Array, pose: FloatArray, points: FloatArray, first: int, last: int, blocks: Int32Array,
              mean: Uint8Array, hits: Uint8Array, block_holders: Int32Array, free_blocks: Int32Array,
              holders: Int32Array, free: Int32Array, counters: IndexArray, frame: FloatArray, frozen: int) -> int:
    """Register the end points ``first`` to ``last``, excluded, in the map of one particle.

    Returns the first one that is not registered: less than ``last`` if a stack becomes empty.
    """
    ox, oy, inv = frame[0], frame[1], frame[2]
    rows, columns = grid.shape[0] << CELL_TO_BLOCK, grid.shape[1] << CELL_TO_BLOCK
    x, y, c, s = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    for b in range(first, last):
        fx = (x + c * points[0, b] - s * points[1, b] - ox) * inv
        fy = (y + s * points[0, b] + c * points[1, b] - oy) * inv
        if not (fx >= 0.0 and fy >= 0.0 and fx < columns and fy < rows):
            continue
        ix, iy = int(fx), int(fy)
        cell = ((iy & MASK) << SHIFT) | (ix & MASK)
        ty, tx = iy >> SHIFT, ix >> SHIFT
        tile = tile_at(grid, blocks, ty, tx)
        if tile >= 0 and hits[tile, cell] >= frozen:
            continue
        by, bx = ty >> BLOCK_SHIFT, tx >> BLOCK_SHIFT
        block = grid[by, bx]
        if block < 0 or block_holders[block] != 1:
            if counters[BLOCKS] < 1:
                return b
            block = _own_block(grid, by, bx, blocks, block_holders, free_blocks, holders, counters)
        if tile < 0 or holders[tile] != 1:
            if counters[TILES] < 1:
                return b
            tile = _own_tile(tile, mean, hits, holders, free, counters)
            blocks[block, ty & BLOCK_MASK, tx & BLOCK_MASK] = tile
        if hits[tile, cell] < MOST_HITS:
            hits[tile, cell] += 1
        share = 1.0 / hits[tile, cell]
        mx, my = mean[tile, cell, 0] * UNIT, mean[tile, cell, 1] * UNIT
        mean[tile, cell, 0] = int((mx + (fx - ix - mx) * share) / UNIT + 0.5)
        mean[tile, cell, 1] = int((my + (fy - iy - my) * share) / UNIT + 0.5)
    return last


@kernel
def register_scans(particles: IndexArray, poses: FloatArray, points: FloatArray, parts: IndexArray,
                   progress: IndexArray, table: Int32Array, blocks: Int32Array, mean: Uint8Array, hits: Uint8Array,
                   block_holders: Int32Array, free_blocks: Int32Array, holders: Int32Array, free: Int32Array,
                   counters: IndexArray, frame: FloatArray, frozen: int) -> bool:
    """Register end points in the maps of particles: one scan in many maps, or many scans in one.

    Points outside the table are left out.

    Parameters
    ----------
    particles : (K,) int64
        Particle of each pose.
    poses : (K, 3) float64
        Poses x, y [m], theta [rad] in ``map``.
    points : (2, B) float64
        End points [m, laser frame].
    parts : (K, 2) int64
        First end point that is seen from each pose, and the one after the last.
    progress : (2,) int64
        First pose, and the number of its points that are done; changed if a stack becomes empty.
    table : (N, H, W) int32
        Block of each particle at each place, -1 for none.
    blocks : (G, 8, 8) int32
        Tile at each place of a block, -1 for none.
    mean : (T, 256, 2) uint8
        Mean hit point of each cell.
    hits : (T, 256) uint8
        Number of hits of each cell.
    block_holders : (G,) int32
        Number of particles that hold each block.
    free_blocks : (G,) int32
        Stack of unused blocks.
    holders : (T,) int32
        Number of blocks that hold each tile.
    free : (T,) int32
        Stack of unused tiles.
    counters : (2,) int64
        Heights of the stacks of blocks and tiles.
    frame : (3,) float64
        World x, y of the table's corner [m], cells per metre.
    frozen : int
        Cells with this number of hits are not changed any more.

    Returns
    -------
    bool
        False if a stack is empty. The caller then adds blocks or tiles and calls again.
    """
    for k in range(progress[0], poses.shape[0]):
        first, last = parts[k, 0], parts[k, 1]
        done = _register(table[particles[k]], poses[k], points, first + progress[1], last, blocks, mean, hits,
                         block_holders, free_blocks, holders, free, counters, frame, frozen)
        if done < last:
            progress[0], progress[1] = k, done - first
            return False
        progress[1] = 0
    return True


@kernel
def count_holders(table: Int32Array, blocks: Int32Array, block_holders: Int32Array, free_blocks: Int32Array,
                  holders: Int32Array, free: Int32Array, counters: IndexArray) -> None:
    """Count the particles that hold each block and the blocks that hold each tile, and list the unused ones.

    Parameters
    ----------
    table : (N, H, W) int32
        Block of each particle at each place, -1 for none.
    blocks : (G, 8, 8) int32
        Tile at each place of a block, -1 for none.
    block_holders : (G,) int32
        Zeros; written.
    free_blocks : (G,) int32
        Written: stack of unused blocks, that with the lowest number on top.
    holders : (T,) int32
        Zeros; written.
    free : (T,) int32
        Written: stack of unused tiles, in the same order.
    counters : (2,) int64
        Written: heights of the stacks.
    """
    for block in table.flat:
        if block >= 0:
            block_holders[block] += 1
    counters[:] = 0
    for number in range(blocks.shape[0] - 1, -1, -1):
        if block_holders[number] == 0:
            free_blocks[counters[BLOCKS]] = number
            counters[BLOCKS] += 1
            continue
        for tile in blocks[number].flat:
            if tile >= 0:
                holders[tile] += 1
    for unused in range(holders.shape[0] - 1, -1, -1):
        if holders[unused] == 0:
            free[counters[TILES]] = unused
            counters[TILES] += 1


@kernel
def _stamp_values(by_sigma: float, stamps: Uint8Array) -> None:
    """Write 255 exp(-d^2 by_sigma) for the 5 x 5 cells around a mean, for each of its positions: (PLACES, PLACES, 25).
    """
    for sy in range(PLACES):
        for sx in range(PLACES):
            mx, my = (sx + 0.5) / PLACES - 0.5, (sy + 0.5) / PLACES - 0.5
            for k in range(25):
                dx, dy = k % 5 - 2, k // 5 - 2
                u = ((dx - mx) * (dx - mx) + (dy - my) * (dy - my)) * by_sigma
                stamps[sy, sx, k] = int(255.0 / (1.0 + u * (1.0 + u * (0.5 + u * 0.16666667))) + 0.5)


@kernel
def tiles_around(centre: FloatArray, widest: float, count: int, points: FloatArray, stride: int, reach: float,
                 frame: FloatArray, wanted: BoolArray) -> None:
    """Mark the tiles with means close to the points of a scan at all rotations about its pose.

    Parameters
    ----------
    centre : (3,) float64
        Pose of the scan [m, m, rad].
    widest : float
        Greatest rotation to either side [rad].
    count : int
        Number of steps to either side.
    points : (R, B) float64
        End points in the first two rows [m, laser frame].
    stride : int
        Every ``stride``-th point is used.
    reach : float
        Distance along either axis within which tiles are marked, including cells that share a value of ``draw_field``
        [m].
    frame : (3,) float64
        World x, y of the table's corner [m], cells per metre.
    wanted : (8 H, 8 W) bool
        Written: True for marked tiles; others are unchanged.
    """
    between = widest / max(1, count) * TURNS_TOGETHER
    rows, columns = wanted.shape[0] << SHIFT, wanted.shape[1] << SHIFT
    for t in range(2 * count // TURNS_TOGETHER + 1):
        theta = centre[2] - widest + (t + 0.5) * between
        c, s = math.cos(theta), math.sin(theta)
        for b in range(0, points.shape[1], stride):
            qx, qy = points[0, b], points[1, b]
            around = (reach + 0.5 * between * (abs(qx) + abs(qy))) * frame[2] + 4.0
            fx = (centre[0] + c * qx - s * qy - frame[0]) * frame[2]
            fy = (centre[1] + s * qx + c * qy - frame[1]) * frame[2]
            if not (fx + around >= 0.0 and fy + around >= 0.0 and fx - around < columns and fy - around < rows):
                continue
            first_x, last_x = int(max(fx - around, 0.0)) >> SHIFT, int(min(fx + around, columns - 1.0)) >> SHIFT
            first_y, last_y = int(max(fy - around, 0.0)) >> SHIFT, int(min(fy + around, rows - 1.0)) >> SHIFT
            for ty in range(first_y, last_y + 1):
                for tx in range(first_x, last_x + 1):
                    wanted[ty, tx] = True


@kernel
def draw_field(grid: Int32Array, blocks: Int32Array, mean: Uint8Array, hits: Uint8Array, frame: FloatArray,
               corner: IndexArray, sigma: float, wanted: BoolArray, field: Uint8Array) -> None:
    """Draw the mean hit points of one map into a dense field of match values.

    The value is 255 exp(-d^2 / sigma), where d is the distance of a cell's centre to the nearest mean within two cells,
    and 0 without a mean. A mean is rounded to an eighth of a cell.

    Parameters
    ----------
    grid : (H, W) int32
        Table of one particle.
    blocks : (G, 8, 8) int32
        Tile at each place of a block, -1 for none.
    mean : (T, 256, 2) uint8
        Mean hit point of each cell.
    hits : (T, 256) uint8
        Number of hits of each cell.
    frame : (3,) float64
        World x, y of the table's corner [m], cells per metre.
    corner : (2,) int64
        Cell of the table at ``field[0, 0]``; may be outside the table.
    sigma : float
        Denominator of the exponent [m^2].
    wanted : (8 H, 8 W) bool
        Tiles to draw.
    field : (h, w) uint8
        Written.
    """
    stamps = np.empty((PLACES, PLACES, 25), np.uint8)
    _stamp_values(1.0 / (frame[2] * frame[2] * sigma), stamps)
    height, width = field.shape
    field[:] = 0
    first_y, last_y = max(0, corner[1] >> SHIFT), min(wanted.shape[0], ((corner[1] + height) >> SHIFT) + 1)
    first_x, last_x = max(0, corner[0] >> SHIFT), min(wanted.shape[1], ((corner[0] + width) >> SHIFT) + 1)
    for ty in range(first_y, last_y):
        for tx in range(first_x, last_x):
            tile = tile_at(grid, blocks, ty, tx)
            if tile < 0 or not wanted[ty, tx]:
                continue
            for cell in range(CELLS):
                if hits[tile, cell] == 0:
                    continue
                y = (ty << SHIFT) + (cell >> SHIFT) - corner[1]
                x = (tx << SHIFT) + (cell & MASK) - corner[0]
                if not (x >= 2 and y >= 2 and x < width - 2 and y < height - 2):
                    continue
                stamp = stamps[mean[tile, cell, 1] >> PLACE_SHIFT, mean[tile, cell, 0] >> PLACE_SHIFT]
                for dy in range(5):
                    row = field[y + dy - 2]
                    for dx in range(5):
                        row[x + dx - 2] = max(row[x + dx - 2], stamp[5 * dy + dx])
