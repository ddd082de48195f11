# SPDX-License-Identifier: BSD-3-Clause
"""Ray casting of a laser scanner on heightmaps.

``beams``, ``rows``, sphere and shape have the layouts of :mod:`m2wr_sim.sensors.ray_kernels`; the sensor's frame too.
The others are:

``heights`` (R, C)
    Samples; columns along x, rows against y.  A cell lies between four of them.
``blocks`` (K, 2)
    Least and greatest height of each block of cells, level after level, each row by row.
``levels`` (L, 3) int64
    First block, rows and columns of blocks of each level.  Blocks of the first level have 2 ** SHIFT cells a side,
    those of each further one 2 ** SHIFT times as many; the last one is the whole.
``ground`` (8,)
    Of the sample in the first row and column x, y, of height 0 z, samples per metre along x and y, half extents; all
    relative to the centre of the bounding box, which is the centre of the sphere.

Each ray walks over the blocks below it (F. K. Musgrave, "Grid tracing", 1988; with the hierarchy of A. Tevs, I. Ihrke,
H.-P. Seidel, "Maximum mipmaps", 2008).  A block that the ray stays above or below is passed at once, all others are
entered.  In a cell the height of the ray above each of the two triangles is linear; a hit is where its sign changes.
The sign is kept from block to block, so that no ray slips through between two of them.  Both sides are visible.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

from m2wr_sim.sensors.base_kernels import kernel, product, rotation
from m2wr_sim.sensors.mesh_kernels import IGNORED, OWNER, RANGE_MAX, RANGE_MIN, _box_bounds

SHIFT = 2               # blocks of a level are 4 x 4 blocks of the level before
UPRIGHT = 1e-12         # samples a metre; a slower ray does not change its column or row

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@kernel
def _in_cell(heights: Floats, row: int, column: int, ray: Sequence[float], begin: float, end: float,
             side: float) -> Tuple[float, float]:
    """Return where a ray hits the two triangles of a cell, infinity if nowhere, and the side on which it leaves them.

    ``side`` is 1 above the ground, -1 below, 0 unknown.
    """
    u, v, z, du, dv, dz = ray
    a, b = heights[row, column], heights[row, column + 1]
    c, d = heights[row + 1, column], heights[row + 1, column + 1]
    u, v = u - column, v - row
    past, rate = u + v - 1.0, du + dv           # beyond the diagonal
    split = -past / rate if rate != 0.0 else math.inf
    if not begin < split < end:
        split = end
    far = past + rate * 0.5 * (begin + split) > 0.0
    one = begin
    while True:
        if far:
            height, slope = z - (d + (d - c) * (u - 1.0) + (d - b) * (v - 1.0)), dz - (d - c) * du - (d - b) * dv
        else:
            height, slope = z - (a + (b - a) * u + (c - a) * v), dz - (b - a) * du - (c - a) * dv
        first, last = height + slope * one, height + slope * split
        if side == 0.0:
            side = 1.0 if first > 0.0 else (-1.0 if first < 0.0 else (1.0 if last > 0.0 else
                                                                      (-1.0 if last < 0.0 else 0.0)))
        elif side * first <= 0.0:
            return one, side
        if side * last < 0.0 or (last == 0.0 and side != 0.0 and slope != 0.0):
            return min(max(-height / slope, one), split), side
        if split >= end:
            return math.inf, side
        one, split, far = split, end, not far


@kernel
def _walk(heights: Floats, blocks: Floats, levels: NDArray[np.int64], ray: Sequence[float], begin: float,
          end: float) -> float:
    """Return the distance at which a ray hits the ground between two distances, where it is over the grid."""
    u, v, z, du, dv, dz = ray
    rows, columns, top = heights.shape[0] - 1, heights.shape[1] - 1, levels.shape[0]
    per_u, per_v = (1.0 / du if du != 0.0 else 0.0), (1.0 / dv if dv != 0.0 else 0.0)
    on_u, on_v = (1 if du > 0.0 else 0), (1 if dv > 0.0 else 0)
    level, i, j, t, side = top, 0, 0, begin, 0.0
    while True:
        shift = SHIFT * level
        leave_u = (min((j + on_u) << shift, columns) - u) * per_u if du != 0.0 else math.inf
        leave_v = (min((i + on_v) << shift, rows) - v) * per_v if dv != 0.0 else math.inf
        leave = min(max(min(leave_u, leave_v), t), end)
        if level > 0:
            block = levels[level - 1, 0] + i * levels[level - 1, 2] + j
            low, high = blocks[block, 0], blocks[block, 1]
        else:
            a, b, c, d = heights[i, j], heights[i, j + 1], heights[i + 1, j], heights[i + 1, j + 1]
            low, high = min(min(a, b), min(c, d)), max(max(a, b), max(c, d))
        one, two = z + dz * t, z + dz * leave
        passed = 1.0 if min(one, two) > high else (-1.0 if max(one, two) < low else 0.0)
        if passed != 0.0:
            if side * passed < 0.0:     # crossed between two blocks, within rounding
                return t
            side = passed
        elif level > 0:
            level, shift = level - 1, shift - SHIFT
            j = min(max(int(u + du * t) >> shift, j << SHIFT), min((j << SHIFT) + (1 << SHIFT) - 1,
                                                                   (columns - 1) >> shift))
            i = min(max(int(v + dv * t) >> shift, i << SHIFT), min((i << SHIFT) + (1 << SHIFT) - 1,
                                                                   (rows - 1) >> shift))
            continue
        else:
            found, side = _in_cell(heights, i, j, ray, t, leave, side)
            if found < math.inf:
                return found
        if leave >= end:
            return math.inf
        t = leave
        if leave_u <= leave_v:
            before, j = j, j + 2 * on_u - 1
            if j < 0 or j << shift >= columns:
                return math.inf
            rises = before >> SHIFT != j >> SHIFT
        else:
            before, i = i, i + 2 * on_v - 1
            if i < 0 or i << shift >= rows:
                return math.inf
            rises = before >> SHIFT != i >> SHIFT
        if rises and level < top:
            level, i, j = level + 1, i >> SHIFT, j >> SHIFT


@kernel
def _clipped(place: float, rate: float, most: float, begin: float, end: float) -> Tuple[float, float]:
    """Return the part of an interval of distances in which a coordinate of a ray is within 0 and ``most``."""
    if rate == 0.0:
        return (begin, end) if 0.0 <= place <= most else (begin, -math.inf)
    one, two = -place / rate, (most - place) / rate
    if rate < 0.0:
        one, two = two, one
    return max(begin, one), min(end, two)


@kernel
def cast_heights(ranges: Floats, hits: NDArray[np.int64], row: int, beams: Floats, rows: Floats, frame: Floats,
                 sphere: Floats, shape: Sequence[float], heights: Floats, blocks: Floats, levels: NDArray[np.int64],
                 ground: Floats) -> None:
    """Lower ranges to a heightmap, after ``ray_kernels.cast_rays``; see the module for the layouts of the arrays.

    Parameters
    ----------
    ranges : (V * N,) float64
        Lowered where the heightmap is nearer [m].
    hits : (V * N,) or (0,) int64
        Unless empty, set to ``row`` there.
    row : int
        Of the heightmap in the scene.
    beams, rows, frame, heights, blocks, ground : float64
        Read only.
    sphere : (4,) float64
        Bounding sphere.
    shape : (16,) float64
    levels : (L, 3) int64

    Notes
    -----
    A pose of the sensor or the heightmap that is not finite gives no hit.
    """
    cx, cy, cz = sphere[0] - frame[0], sphere[1] - frame[1], sphere[2] - frame[2]
    reach = sphere[3] + frame[RANGE_MAX]
    if not cx * cx + cy * cy + cz * cz <= reach * reach or (
            frame[IGNORED] >= 0.0 and shape[OWNER] == frame[IGNORED]):
        return
    m = product(shape, rotation(frame[3], frame[4], frame[5], frame[6]))
    if not abs(m[0]) + abs(m[4]) + abs(m[8]) < math.inf:
        return
    o = (-(shape[0] * cx + shape[3] * cy + shape[6] * cz), -(shape[1] * cx + shape[4] * cy + shape[7] * cz),
         -(shape[2] * cx + shape[5] * cy + shape[8] * cz))
    p = (-(m[0] * o[0] + m[3] * o[1] + m[6] * o[2]), -(m[1] * o[0] + m[4] * o[1] + m[7] * o[2]),
         -(m[2] * o[0] + m[5] * o[1] + m[8] * o[2]))
    box = np.array((0.0, 0.0, 0.0, ground[5], ground[6], ground[7]))
    u, v, z = (o[0] - ground[0]) * ground[3], (ground[1] - o[1]) * ground[4], o[2] - ground[2]
    most_u, most_v = heights.shape[1] - 1.0, heights.shape[0] - 1.0
    n = beams.shape[1]
    for k in range(rows.shape[0]):
        flat, up = rows[k, 0], rows[k, 1]
        near = _box_bounds(box, m, p, flat, up)[0]
        if not near <= frame[RANGE_MAX]:
            continue
        for i in range(n):
            x, y = flat * beams[0, i], flat * beams[1, i]
            du = (m[0] * x + m[1] * y + m[2] * up) * ground[3]
            dv = -(m[3] * x + m[4] * y + m[5] * up) * ground[4]
            du, dv = (0.0 if abs(du) < UPRIGHT else du), (0.0 if abs(dv) < UPRIGHT else dv)
            begin, end = _clipped(u, du, most_u, frame[RANGE_MIN], ranges[k * n + i])
            begin, end = _clipped(v, dv, most_v, begin, end)
            if not begin < end:
                continue
            t = _walk(heights, blocks, levels, (u, v, z, du, dv, m[6] * x + m[7] * y + m[8] * up), begin, end)
            if t < ranges[k * n + i] and t > frame[RANGE_MIN]:
                ranges[k * n + i] = t
                if hits.size > 0:
                    hits[k * n + i] = row
