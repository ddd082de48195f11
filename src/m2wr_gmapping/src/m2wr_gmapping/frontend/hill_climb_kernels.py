# SPDX-License-Identifier: BSD-3-Clause
"""Hill climb, score and likelihood of the original gmapping on the mean hit points of the tile maps.

Arrays as in ``match_kernels`` and ``tile_kernels``. ``settings`` (7,): first steps [m], [rad], number of halvings,
sigma, lsigma, half width of the neighbourhood [cells], least score. The free cell in front of each hit is not tested:
it has no effect in the original either.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_gmapping import tuning
from m2wr_gmapping.filter.tile_kernels import CELL_TO_BLOCK, MASK, SHIFT, UNIT, tile_at
from m2wr_gmapping.frontend.match_kernels import FOUND, LOG_LIKELIHOOD, SCORE
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int32Array, Uint8Array

LSTEP, ASTEP, ITERATIONS, SIGMA, LSIGMA, KERNEL, MIN_SCORE = 0, 1, 2, 3, 4, 5, 6
NULL_DISTANCE2 = tuning.NULL_DISTANCE2


@kernel
def _nearest(wx: float, wy: float, grid: Int32Array, blocks: Int32Array, mean: Uint8Array, hits: Uint8Array,
             frame: FloatArray, kernel: int) -> float:
    """Return the squared distance to the nearest mean hit point around a point [m^2]; -1 if there is none."""
    fx, fy = (wx - frame[0]) * frame[2], (wy - frame[1]) * frame[2]
    rows, columns = grid.shape[0] << CELL_TO_BLOCK, grid.shape[1] << CELL_TO_BLOCK
    delta = 1.0 / frame[2]
    if not (fx >= kernel and fy >= kernel and fx < columns - kernel and fy < rows - kernel):
        return -1.0
    ix, iy = int(fx), int(fy)
    best = -1.0
    for jy in range(iy - kernel, iy + kernel + 1):
        for jx in range(ix - kernel, ix + kernel + 1):
            tile = tile_at(grid, blocks, jy >> SHIFT, jx >> SHIFT)
            if tile < 0:
                continue
            cell = ((jy & MASK) << SHIFT) | (jx & MASK)
            if hits[tile, cell] == 0:
                continue
            dx, dy = fx - jx - mean[tile, cell, 0] * UNIT, fy - jy - mean[tile, cell, 1] * UNIT
            d2 = (dx * dx + dy * dy) * delta * delta
            if best < 0.0 or d2 < best:
                best = d2
    return best


@kernel
def _score(x: float, y: float, theta: float, beams: FloatArray, grid: Int32Array, blocks: Int32Array,
           mean: Uint8Array, hits: Uint8Array, frame: FloatArray, settings: FloatArray, result: FloatArray) -> float:
    """Return the score of a pose; its log-likelihood and number of matched beams are written into ``result``."""
    c, s = math.cos(theta), math.sin(theta)
    kernel = int(settings[KERNEL])
    score = likelihood = 0.0
    found = 0
    for b in range(beams.shape[1]):
        qx, qy = beams[0, b], beams[1, b]
        d2 = _nearest(x + c * qx - s * qy, y + s * qx + c * qy, grid, blocks, mean, hits, frame, kernel)
        if d2 >= 0.0:
            score += math.exp(-d2 / settings[SIGMA])
            likelihood -= d2 / settings[LSIGMA]
            found += 1
        else:
            likelihood -= NULL_DISTANCE2 / settings[LSIGMA]
    result[SCORE], result[LOG_LIKELIHOOD], result[FOUND] = score, likelihood, found
    return score


@kernel
def climb_poses(starts: FloatArray, first: int, last: int, beams: FloatArray, table: Int32Array, blocks: Int32Array,
                mean: Uint8Array, hits: Uint8Array, frame: FloatArray, settings: FloatArray,
                results: FloatArray) -> None:
    """Climb from the start poses of some particles, each in its own map.

    Parameters
    ----------
    starts : (N, 3) float64
        Start poses in ``map``.
    first : int
        Particles ``first`` to ``last`` - 1.
    last : int
        Particles ``first`` to ``last`` - 1.
    beams : (7, B) float64
        Beams; layout of ``match_kernels``.
    table : (N, H, W) int32
        Block of each particle at each place, -1 for none.
    blocks : (G, 8, 8) int32
        Tile at each place of a block, -1 for none.
    mean : (T, 256, 2) uint8
        Mean hit point of each cell.
    hits : (T, 256) uint8
        Number of hits of each cell.
    frame : (3,) float64
        World x, y of the table's corner [m], cells per metre.
    settings : (7,) float64
        Settings of the matcher.
    results : (N, 13) float64
        Written: result rows.
    """
    for i in range(first, last):
        grid, row = table[i], results[i]
        x, y, theta = starts[i, 0], starts[i, 1], starts[i, 2]
        current = _score(x, y, theta, beams, grid, blocks, mean, hits, frame, settings, row)
        best, refinement = -1.0, 0
        lstep, astep = settings[LSTEP], settings[ASTEP]
        while True:
            if best >= current:
                refinement += 1
                lstep *= 0.5
                astep *= 0.5
            best = current
            fx, fy, ft = x, y, theta
            for dx, dy, turn in ((lstep, 0.0, 0.0), (-lstep, 0.0, 0.0), (0.0, -lstep, 0.0), (0.0, lstep, 0.0),
                                 (0.0, 0.0, astep), (0.0, 0.0, -astep)):
                score = _score(x + dx, y + dy, theta + turn, beams, grid, blocks, mean, hits, frame, settings, row)
                if score > current:
                    current, fx, fy, ft = score, x + dx, y + dy, theta + turn
            x, y, theta = fx, fy, ft
            if current <= best and refinement >= settings[ITERATIONS]:
                break
        if not best > settings[MIN_SCORE]:
            x, y, theta = starts[i, 0], starts[i, 1], starts[i, 2]
        _score(x, y, theta, beams, grid, blocks, mean, hits, frame, settings, row)
        row[0], row[1] = x, y
        row[2] = theta - 2.0 * math.pi * math.floor((theta + math.pi) / (2.0 * math.pi))
