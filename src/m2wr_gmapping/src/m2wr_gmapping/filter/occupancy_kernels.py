# SPDX-License-Identifier: BSD-3-Clause
"""Tracing beams into counts of hits and visits, and reading counts out as an occupancy grid.

Array layouts
-------------
``table`` (H, W) int32
    Block of counts at each place of 32 x 32 cells, -1 where nothing was counted yet.
``hits``, ``visits`` (B, 1024) int32
    Counts of the cells of each block, row by row.
``values`` (B, 1024) int8
    Occupancy of the cells as it was read out last.
``changed`` (B,) bool
    Blocks whose counts have changed since then.
``used`` (1,) int64
    Number of blocks that have a place; those from there on are spare.
"""
import math

from numba import njit

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
SHIFT, MASK, SIDE, CELLS = 5, 31, 32, 1024


@njit(cache=True, nogil=True, error_model='numpy')
def _block_at(ty, tx, table, hits, visits, values, used):
    """Return the block at a place, a spare one with nothing in it if there was none."""
    block = table[ty, tx]
    if block < 0:
        block = used[0]
        used[0] += 1
        table[ty, tx] = block
        for cell in range(CELLS):
            hits[block, cell] = 0
            visits[block, cell] = 0
            values[block, cell] = UNKNOWN
    return block


@njit(cache=True, nogil=True, error_model='numpy')
def _trace(x0, y0, x1, y1, sign, hit, table, hits, visits, values, changed, used):
    """Add ``sign`` to the visits of all cells on the line from (x0, y0) to (x1, y1) but the last one.

    An integer line drawn from the end with the smaller x, or the smaller y if it is steep. With ``hit`` the last cell
    gets a visit and a hit.
    """
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
                    block = _block_at(place_y, place_x, table, hits, visits, values, used)
                    changed[block] = True
                cell = ((y & MASK) << SHIFT) | (x & MASK)
                visits[block, cell] += sign
                if a == last_a:
                    hits[block, cell] += sign
        if d > 0:
            b += rise
            d += 2 * (db - da)
        else:
            d += 2 * db


@njit(cache=True, nogil=True, error_model='numpy')
def add_scan(pose, rays, ray_hits, first, anchor, per_metre, shift, sign, table, hits, visits, values, changed, used):
    """Add (``sign`` 1) or take out (-1) a scan, from beam ``first`` on.

    Parameters
    ----------
    pose : (3,) float64
        Of the laser, in ``map``.
    rays : (2, S) float32
        Ends of the beams [m, laser frame].
    ray_hits : (S,) bool
        Which of them mark their end.
    anchor : (2,) float64
        Centre of a cell in ``map`` [m]; the same in all calls, or a scan would not be taken out where it was added.
    shift : (2,) int64
        Column and row of that cell; cells outside the table are left out.

    Returns
    -------
    int
        The number of beams done: less than S where spare blocks may not suffice for the next one.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x0 = int(math.floor((pose[0] - anchor[0]) * per_metre + 0.5)) + shift[0]
    y0 = int(math.floor((pose[1] - anchor[1]) * per_metre + 0.5)) + shift[1]
    for k in range(first, rays.shape[1]):
        wx = pose[0] + c * rays[0, k] - s * rays[1, k]
        wy = pose[1] + s * rays[0, k] + c * rays[1, k]
        x1 = int(math.floor((wx - anchor[0]) * per_metre + 0.5)) + shift[0]
        y1 = int(math.floor((wy - anchor[1]) * per_metre + 0.5)) + shift[1]
        most = (abs(x1 - x0) >> SHIFT) + (abs(y1 - y0) >> SHIFT) + 3      # blocks that a line of that length crosses
        if used[0] + min(most, table.size - used[0]) > changed.shape[0]:
            return k
        _trace(x0, y0, x1, y1, sign, ray_hits[k], table, hits, visits, values, changed, used)
    return rays.shape[1]


@njit(cache=True, nogil=True, error_model='numpy')
def read_out(threshold, table, hits, visits, values, changed, used, grid):
    """Bring ``values`` to the counts and write them into ``grid`` (32 H, 32 W) int8; it stays where no block is."""
    for block in range(used[0]):
        if not changed[block]:
            continue
        changed[block] = False
        for cell in range(CELLS):
            if visits[block, cell] <= 0:
                values[block, cell] = UNKNOWN
            elif hits[block, cell] / visits[block, cell] > threshold:
                values[block, cell] = OCCUPIED
            else:
                values[block, cell] = FREE
    for ty in range(table.shape[0]):
        for tx in range(table.shape[1]):
            block = table[ty, tx]
            if block < 0:
                continue
            for cell in range(CELLS):
                grid[(ty << SHIFT) + (cell >> SHIFT), (tx << SHIFT) + (cell & MASK)] = values[block, cell]
