# SPDX-License-Identifier: BSD-3-Clause
"""Scan matching of particles in their tile maps.

Plain arrays in, plain arrays out; each call handles a range of particles, so that threads can share the set.

Array layouts
-------------
``table`` (N, H, W) int32, ``blocks`` (G, 8, 8) int32
    Block of each particle at each place, and tile at each place of a block; -1 for none.
``mean`` (T, 256, 2) uint8, ``hits`` (T, 256) uint8
    Mean hit point of each cell of a tile of 16 x 16, from the cell's lower corner in units of UNIT cells, and its hits.
``frame`` (3,) float64
    World x and y of the table's corner [m], cells per metre.
``beams`` (7, B) float64
    End point x, y and unit normal of the surface there, in the laser's frame; lever arm of the normal and of the
    tangent (the residual's derivative by heading); weight of the tangential residual.
``pairs`` (K * PAIRS,) float64
    Scratch: the beams that have a partner, in blocks of LANES.  Each block holds first all first
    values, then all second ones, and so on: the rows of ``beams``, the partner's position [m, from the table's corner],
    and nine terms of the normal equations.  Constant offsets and unsigned indices allow the compiler to vectorise.
    Sums are taken one beam after another, so the result does not depend on the width of the vectors.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.filter.tile_kernels import CELL_TO_BLOCK, MASK, SHIFT, UNIT, tile_at
from m2wr_maps.linear_kernels import solve
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int32Array, Uint8Array

QX, QY, NX, NY, ARM_N, ARM_T, SLIDE, BEAM_ROWS = 0, 1, 2, 3, 4, 5, 6, 7
# settings of the Gauss-Newton matcher
WIDE, NARROW, ROUNDS, SPREAD, SIGMA, LSIGMA, FREE, MATCH_SETTINGS = 0, 1, 2, 3, 4, 5, 6, 7
# columns of a result row
POSE, SCORE, LOG_LIKELIHOOD, FOUND, COST, INFORMATION, RESULT_SIZE = 0, 3, 4, 5, 6, 7, 13
LANES, PAIR_ROWS = 128, 18
PAIRS = LANES * PAIR_ROWS
SUMS = 21
_QY, _NX, _NY, _ARM_N, _ARM_T, _SLIDE, _TX, _TY, _T0, _T1, _T2, _T3, _T4, _T5, _T6, _T7, _T8 = (
    np.uint64(LANES * row) for row in range(1, PAIR_ROWS))
STEP_LIMIT, CONVERGED = tuning.MATCHING.basin[0], tuning.MATCHING.converged
FARTHEST = tuning.MATCHING.beam_deviation     # of the end points, beyond a step [m]: farther ones lose their partners
NULL_DISTANCE2 = tuning.NULL_DISTANCE2


@kernel
def scratch(beams: int) -> FloatArray:
    """Return an array for the ``pairs`` of that many beams."""
    return np.empty((beams // LANES + 1) * PAIRS)


@kernel
def _placed(x: float, y: float, c: float, s: float, frame: FloatArray, beams: FloatArray, pairs: FloatArray) -> None:
    """Write the positions of the end points, in cells from the table's corner, to the first two terms of each pair."""
    ox, oy, inv = frame[0], frame[1], frame[2]
    for first in range(0, beams.shape[1], LANES):
        block = first // LANES * PAIRS
        qx, qy = beams[QX, first:first + LANES], beams[QY, first:first + LANES]
        for k in range(qx.shape[0]):
            j = np.uint64(block + k)
            pairs[j + _T0] = (x + c * qx[k] - s * qy[k] - ox) * inv
            pairs[j + _T1] = (y + s * qx[k] + c * qy[k] - oy) * inv


@kernel
def partners(x: float, y: float, theta: float, beams: FloatArray, grid: Int32Array, blocks: Int32Array,
             mean: Uint8Array, hits: Uint8Array, frame: FloatArray, pairs: FloatArray) -> int:
    """Find for each end point the nearest mean hit point in the 3 x 3 cells around it.

    Parameters
    ----------
    x : float
        Position of the laser in ``map`` [m].
    y : float
        Position of the laser in ``map`` [m].
    theta : float
        Heading [rad].
    beams : (7, B) float64
        Beams; layout of ``match_kernels``.
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
    pairs : (P,) float64
        Written: beams with a partner, and its position.

    Returns
    -------
    int
        Number of beams with a partner.
    """
    c, s = math.cos(theta), math.sin(theta)
    rows, columns = grid.shape[0] << CELL_TO_BLOCK, grid.shape[1] << CELL_TO_BLOCK
    delta = 1.0 / frame[2]
    _placed(x, y, c, s, frame, beams, pairs)
    found = 0
    for b in range(beams.shape[1]):
        j = np.uint64(b // LANES * PAIRS + b % LANES)
        fx, fy = pairs[j + _T0], pairs[j + _T1]
        if not (fx >= 1.0 and fy >= 1.0 and fx < columns - 1 and fy < rows - 1):
            continue
        ix, iy = int(fx), int(fy)
        best, best_x, best_y = 1e9, 0.0, 0.0
        if 0 < (ix & MASK) < MASK and 0 < (iy & MASK) < MASK:       # all nine cells are in one tile
            tile = tile_at(grid, blocks, iy >> SHIFT, ix >> SHIFT)
            if tile < 0:
                continue
            rx, ry = fx - ix, fy - iy
            cell = ((iy & MASK) << SHIFT) | (ix & MASK)
            for step_y in range(-1, 2):
                k = cell + (step_y << SHIFT) - 1
                for step_x in range(-1, 2):
                    if hits[tile, k] != 0:
                        px, py = step_x + mean[tile, k, 0] * UNIT, step_y + mean[tile, k, 1] * UNIT
                        d2 = (rx - px) * (rx - px) + (ry - py) * (ry - py)
                        if d2 < best:
                            best, best_x, best_y = d2, ix + px, iy + py
                    k += 1
        else:
            for jy in range(iy - 1, iy + 2):
                for jx in range(ix - 1, ix + 2):
                    tile = tile_at(grid, blocks, jy >> SHIFT, jx >> SHIFT)
                    if tile < 0:
                        continue
                    k = ((jy & MASK) << SHIFT) | (jx & MASK)
                    if hits[tile, k] != 0:
                        px, py = jx + mean[tile, k, 0] * UNIT, jy + mean[tile, k, 1] * UNIT
                        d2 = (fx - px) * (fx - px) + (fy - py) * (fy - py)
                        if d2 < best:
                            best, best_x, best_y = d2, px, py
        if best < 1e9:
            j = np.uint64(found // LANES * PAIRS + found % LANES)
            pairs[j], pairs[j + _QY] = beams[QX, b], beams[QY, b]
            pairs[j + _NX], pairs[j + _NY] = beams[NX, b], beams[NY, b]
            pairs[j + _ARM_N], pairs[j + _ARM_T], pairs[j + _SLIDE] = beams[ARM_N, b], beams[ARM_T, b], beams[SLIDE, b]
            pairs[j + _TX], pairs[j + _TY] = best_x * delta, best_y * delta
            found += 1
    return found


@kernel
def _terms(x: float, y: float, c: float, s: float, by_width: float, free: float, block: int, count: int,
           pairs: FloatArray) -> None:
    """Write the terms of the normal equations of ``count`` beams of a block."""
    for k in range(count):
        j = np.uint64(block + k)
        qx, qy, nx, ny = pairs[j], pairs[j + _QY], pairs[j + _NX], pairs[j + _NY]
        an, at, slide = pairs[j + _ARM_N], pairs[j + _ARM_T], pairs[j + _SLIDE] - free
        dx, dy = x + c * qx - s * qy - pairs[j + _TX], y + s * qx + c * qy - pairs[j + _TY]
        u = (dx * dx + dy * dy) * by_width
        w = 1.0 / (1.0 + u * (1.0 + u * (0.5 + u * 0.16666667)))       # approximates exp(-u)
        ex, ey = c * dx + s * dy, c * dy - s * dx
        rn, rt = nx * ex + ny * ey, nx * ey - ny * ex
        v = w * (slide if slide > 0.0 else 0.0)
        pairs[j + _T0] = w * nx * nx + v * ny * ny
        pairs[j + _T1] = (w - v) * nx * ny
        pairs[j + _T2] = w * nx * an - v * ny * at
        pairs[j + _T3] = w * ny * ny + v * nx * nx
        pairs[j + _T4] = w * ny * an + v * nx * at
        pairs[j + _T5] = w * an * an + v * at * at
        pairs[j + _T6] = w * nx * rn - v * ny * rt
        pairs[j + _T7] = w * ny * rn + v * nx * rt
        pairs[j + _T8] = w * an * rn + v * at * rt


@kernel
def _accumulate(x: float, y: float, theta: float, frame: FloatArray, pairs: FloatArray, found: int, width: float,
                free: float, h: FloatArray, g: FloatArray) -> None:
    """Write the normal equations h (xx xy xt yy yt tt), g of the weighted point-to-line residuals, in the laser's axes.

    ``free`` is subtracted from the weight of the tangential residuals.
    """
    c, s = math.cos(theta), math.sin(theta)
    # positions of laser and partners are relative to the table's corner [m]
    x, y, by_width = x - frame[0], y - frame[1], 1.0 / width
    h0 = h1 = h2 = h3 = h4 = h5 = g0 = g1 = g2 = 0.0
    for first in range(0, found, LANES):
        block, count = first // LANES * PAIRS, min(LANES, found - first)
        _terms(x, y, c, s, by_width, free, block, count, pairs)
        for k in range(count):
            j = np.uint64(block + k)
            h0 += pairs[j + _T0]
            h1 += pairs[j + _T1]
            h2 += pairs[j + _T2]
            h3 += pairs[j + _T3]
            h4 += pairs[j + _T4]
            h5 += pairs[j + _T5]
            g0 += pairs[j + _T6]
            g1 += pairs[j + _T7]
            g2 += pairs[j + _T8]
    h[0], h[1], h[2], h[3], h[4], h[5] = h0, h1, h2, h3, h4, h5
    g[0], g[1], g[2] = g0, g1, g2


@kernel
def _ratings(x: float, y: float, c: float, s: float, sigma: float, by_width: float, block: int, count: int,
             pairs: FloatArray) -> None:
    """Write the squared distance, the exponent of the score and the robust weight of each of ``count`` beams of a
    block.
    """
    for k in range(count):
        j = np.uint64(block + k)
        qx, qy = pairs[j], pairs[j + _QY]
        dx, dy = x + c * qx - s * qy - pairs[j + _TX], y + s * qx + c * qy - pairs[j + _TY]
        d2 = dx * dx + dy * dy
        u = d2 * by_width
        pairs[j + _T0], pairs[j + _T1] = d2, -d2 / sigma
        pairs[j + _T2] = 1.0 / (1.0 + u * (1.0 + u * (0.5 + u * 0.16666667)))


@kernel
def _rate(x: float, y: float, theta: float, beams: int, frame: FloatArray, pairs: FloatArray, found: int,
          settings: FloatArray, row: FloatArray) -> None:
    """Write score, log-likelihood and number of partners of a pose into a result row."""
    c, s = math.cos(theta), math.sin(theta)
    x, y = x - frame[0], y - frame[1]
    score, squared, kept = 0.0, NULL_DISTANCE2 * (beams - found), 0.0
    for first in range(0, found, LANES):
        block, count = first // LANES * PAIRS, min(LANES, found - first)
        _ratings(x, y, c, s, settings[SIGMA], 1.0 / settings[NARROW], block, count, pairs)
        for k in range(count):
            j = np.uint64(block + k)
            squared += pairs[j + _T0]
            score += math.exp(pairs[j + _T1])
            kept += pairs[j + _T2]
    row[SCORE], row[LOG_LIKELIHOOD], row[FOUND] = score, -squared / settings[LSIGMA], found
    row[COST] = 0.5 * settings[NARROW] / (settings[SPREAD] * settings[SPREAD]) * (beams - kept)


@kernel
def _add_prior(x: float, y: float, theta: float, prediction: FloatArray, prior: FloatArray, per_variance: float,
               h: FloatArray, g: FloatArray) -> None:
    """Divide the normal equations by the variance of a beam, and add the prior at ``prediction`` (3,)."""
    c, s = math.cos(theta), math.sin(theta)
    px, py = x - prediction[0], y - prediction[1]
    turn = theta - prediction[2]
    turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
    for k in range(6):
        h[k] *= per_variance
    for k in range(3):
        g[k] *= per_variance
    h[0] += prior[0]
    h[3] += prior[1]
    h[5] += prior[2]
    g[0] += prior[0] * (c * px + s * py)
    g[1] += prior[1] * (c * py - s * px)
    g[2] += prior[2] * turn


@kernel
def _advance(step: FloatArray, lever2: float, only: bool, pose: FloatArray, before: FloatArray) -> None:
    """Move a pose by a step of Gauss-Newton, and further if the steps converge slowly.

    They do where end points of furniture find a partner close by after each step. This is Anderson's method with a
    memory of one step: Walker and Ni, SIAM J. Numer. Anal. 49(4), 2011; Pavlov et al., AA-ICP, ICRA 2018.

    Parameters
    ----------
    step : (3,) float64
        In the axes of the map [m, m, rad].
    lever2 : float
        Mean squared lever arm of the beams, which makes rotations comparable to distances [m^2].
    only : bool
        Whether only this step is made, as in the first and the last round.
    pose : (3,) float64
        Changed.
    before : (6,) float64
        The step before and the pose after it alone; replaced.
    """
    along, squared, moved2, gain = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        change, weight = step[k] - before[k], lever2 if k == 2 else 1.0
        along -= weight * step[k] * change
        squared += weight * change * change
        pose[k] += step[k]
        moved2 += weight * (pose[k] - before[3 + k])**2
    if not only and along > 0.0:
        gain = min(along / squared, FARTHEST / math.sqrt(moved2))
    for k in range(3):
        before[k], reached = step[k], pose[k]
        pose[k] += gain * (reached - before[3 + k])
        before[3 + k] = reached


@kernel
def _match(start: FloatArray, prediction: FloatArray, beams: FloatArray, grid: Int32Array, blocks: Int32Array,
           mean: Uint8Array, hits: Uint8Array, frame: FloatArray, prior: FloatArray, settings: FloatArray,
           pairs: FloatArray, sums: FloatArray, row: FloatArray) -> None:
    """Match a scan in one map, with scratch arrays for pairs and equations, ``sums`` (SUMS,)."""
    h, g, step, pose, before = sums[:6], sums[6:9], sums[9:12], sums[12:15], sums[15:21]
    per_variance = 1.0 / (settings[SPREAD] * settings[SPREAD])
    width = max(settings[WIDE], settings[NARROW])
    pose[:] = start
    found, settled = 0, False
    for number in range(int(settings[ROUNDS])):
        found = partners(pose[0], pose[1], pose[2], beams, grid, blocks, mean, hits, frame, pairs)
        _accumulate(pose[0], pose[1], pose[2], frame, pairs, found, width, 0.0, h, g)
        _add_prior(pose[0], pose[1], pose[2], prediction, prior, per_variance, h, g)
        if not solve(h, g, step):
            break
        size = max(abs(step[0]), abs(step[1]), abs(step[2]))
        if size > STEP_LIMIT:
            for k in range(3):
                step[k] *= STEP_LIMIT / size
        c, s = math.cos(pose[2]), math.sin(pose[2])
        step[0], step[1] = c * step[0] - s * step[1], s * step[0] + c * step[1]
        settled = size < CONVERGED and width <= settings[NARROW]
        _advance(step, h[5] / (h[0] + h[3]), number == 0 or settled, pose, before)
        if settled:             # the pose has moved by less than a millimetre
            break
        width = max(settings[NARROW], 0.5 * width)
    if not settled:
        found = partners(pose[0], pose[1], pose[2], beams, grid, blocks, mean, hits, frame, pairs)
    _accumulate(pose[0], pose[1], pose[2], frame, pairs, found, settings[NARROW], settings[FREE], h, g)
    row[:3] = pose
    row[2] -= 2.0 * math.pi * math.floor((pose[2] + math.pi) / (2.0 * math.pi))
    for k in range(6):
        row[INFORMATION + k] = h[k] * per_variance
    _rate(pose[0], pose[1], pose[2], beams.shape[1], frame, pairs, found, settings, row)


@kernel
def match_particles(starts: FloatArray, predictions: FloatArray, first: int, last: int, beams: FloatArray,
                    table: Int32Array, blocks: Int32Array, mean: Uint8Array, hits: Uint8Array, frame: FloatArray,
                    prior: FloatArray, settings: FloatArray, least: float, results: FloatArray) -> None:
    """Match a scan in the maps of some particles by Gauss-Newton, from ``starts``.

    The cost is the robust point-to-line distance of the end points to their nearest mean hit points, plus the distance
    from the prediction weighted by ``prior``. The width of the robust kernel is halved in each round. The information
    matrix in the result excludes sliding along straight walls: this weight only stabilises the search.

    A match with score ``least`` or less is rejected: the prediction is kept, without information.

    Parameters
    ----------
    starts : (N, 3) float64
        Start poses in ``map``.
    predictions : (N, 3) float64
        Poses predicted by odometry.
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
    prior : (3,) float64
        Inverse variances along the axes of the prediction.
    settings : (7,) float64
        WIDE, NARROW, ROUNDS, SPREAD, SIGMA, LSIGMA, FREE.
    least : float
        Score of a rejected match.
    results : (N, 13) float64
        Written: pose, score, log-likelihood, partners, cost and the scan's information (upper triangle, laser axes).
    """
    pairs, sums = scratch(beams.shape[1]), np.zeros(SUMS)
    for i in range(first, last):
        row = results[i]
        _match(starts[i], predictions[i], beams, table[i], blocks, mean, hits, frame, prior, settings, pairs, sums, row)
        if row[SCORE] <= least:
            row[0], row[1], row[2] = predictions[i, 0], predictions[i, 1], predictions[i, 2]
            row[INFORMATION:] = 0.0
            found = partners(row[0], row[1], row[2], beams, table[i], blocks, mean, hits, frame, pairs)
            _rate(row[0], row[1], row[2], beams.shape[1], frame, pairs, found, settings, row)
