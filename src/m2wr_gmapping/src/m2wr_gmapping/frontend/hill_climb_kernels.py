# SPDX-License-Identifier: BSD-3-Clause
"""The original hill climb, score and likelihood, on the tile maps' own means.

Arrays as in ``match_kernels`` and ``tile_kernels``; ``settings`` (7,): first steps [m], [rad], halvings, sigma, lsigma,
half width of the neighbourhood [cells], least score.  The original's companion free cell is left out, as it is there
in effect.
"""
import math

from numba import njit

SHIFT, MASK = 4, 15
UNIT = 1.0 / 65535
LSTEP, ASTEP, ITERATIONS, SIGMA, LSIGMA, KERNEL, MIN_SCORE = 0, 1, 2, 3, 4, 5, 6
SCORE, LOG_LIKELIHOOD, FOUND = 3, 4, 5
NULL_DISTANCE2 = 0.5


@njit(cache=True, nogil=True, error_model='numpy')
def _nearest(wx, wy, table, mean, hits, frame, kernel):
    """Squared distance to the nearest mean hit point in the neighbourhood of a point; -1 if there is none."""
    fx, fy = (wx - frame[0]) * frame[2], (wy - frame[1]) * frame[2]
    rows, columns = table.shape[0] << SHIFT, table.shape[1] << SHIFT
    delta = 1.0 / frame[2]
    if not (fx >= kernel and fy >= kernel and fx < columns - kernel and fy < rows - kernel):
        return -1.0
    ix, iy = int(fx), int(fy)
    best = -1.0
    for jy in range(iy - kernel, iy + kernel + 1):
        for jx in range(ix - kernel, ix + kernel + 1):
            tile = table[jy >> SHIFT, jx >> SHIFT]
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


@njit(cache=True, nogil=True, error_model='numpy')
def _score(x, y, theta, beams, table, mean, hits, frame, settings, result):
    """Score of a pose; with its log-likelihood and number of partners written into ``result``."""
    c, s = math.cos(theta), math.sin(theta)
    kernel = int(settings[KERNEL])
    score = likelihood = 0.0
    found = 0
    for b in range(beams.shape[1]):
        qx, qy = beams[0, b], beams[1, b]
        d2 = _nearest(x + c * qx - s * qy, y + s * qx + c * qy, table, mean, hits, frame, kernel)
        if d2 >= 0.0:
            score += math.exp(-d2 / settings[SIGMA])
            likelihood -= d2 / settings[LSIGMA]
            found += 1
        else:
            likelihood -= NULL_DISTANCE2 / settings[LSIGMA]
    result[SCORE], result[LOG_LIKELIHOOD], result[FOUND] = score, likelihood, found
    return score


@njit(cache=True, nogil=True, error_model='numpy')
def climb_poses(starts, first, last, beams, table, mean, hits, frame, settings, results):
    """Climb from ``starts`` for particles ``first`` to ``last`` - 1, each in its own map; write the result rows."""
    for i in range(first, last):
        grid, row = table[i], results[i]
        x, y, theta = starts[i, 0], starts[i, 1], starts[i, 2]
        current = _score(x, y, theta, beams, grid, mean, hits, frame, settings, row)
        best, refinement = -1.0, 0
        lstep, astep = settings[LSTEP], settings[ASTEP]
        while True:
            if best >= current:
                refinement += 1
                lstep *= 0.5
                astep *= 0.5
            best = current
            fx, fy, ft = x, y, theta
            for k in range(6):
                tx, ty, tt = x, y, theta
                if k == 0:
                    tx += lstep
                elif k == 1:
                    tx -= lstep
                elif k == 2:
                    ty -= lstep
                elif k == 3:
                    ty += lstep
                elif k == 4:
                    tt += astep
                else:
                    tt -= astep
                score = _score(tx, ty, tt, beams, grid, mean, hits, frame, settings, row)
                if score > current:
                    current, fx, fy, ft = score, tx, ty, tt
            x, y, theta = fx, fy, ft
            if current <= best and refinement >= settings[ITERATIONS]:
                break
        if not best > settings[MIN_SCORE]:
            x, y, theta = starts[i, 0], starts[i, 1], starts[i, 2]
        _score(x, y, theta, beams, grid, mean, hits, frame, settings, row)
        row[0], row[1] = x, y
        row[2] = theta - 2.0 * math.pi * math.floor((theta + math.pi) / (2.0 * math.pi))
