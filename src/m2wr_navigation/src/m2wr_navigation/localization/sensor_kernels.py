# SPDX-License-Identifier: BSD-3-Clause
"""Sensor models: how well a scan fits the map from each particle.

Particles are in the grid's frame here: x, y in cells from its corner, theta from its x axis. So a rotated grid costs
nothing.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_maps.linear_kernels import solve
from m2wr_node.kernel import fast_kernel, kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray, Uint8Array

RAY_STEP = 0.5          # least step of a ray [cells]; bounds its error
CORNER = 1.5            # a cell's centre to the ray's place in it and to another cell's edge, at most [cells]


@fast_kernel
def field_sums(particles: FloatArray, beams: Float32Array, fields: Uint8Array, table: Float32Array,
               out: FloatArray) -> None:
    """Add up a table of distances to obstacles over a scan's beams: the likelihood field.

    Parameters
    ----------
    particles : (N, 3) float64
        Poses in the grid's frame [cells, cells, rad].
    beams : (4, B) float32
        End points in the base frame [cells], x and y, and directions, x and y of any length.
    fields : (H, W, 4) uint8
        Distances to what a beam can hit, in steps; by the quarter of its direction: + 1 towards smaller x, + 2 towards
        smaller y.
    table : (256, 2) float32
        What is added for a distance. Off the map, the last row.
    out : (N, 2) float64
        Written: the sums of both columns.
    """
    height, width = fields.shape[0], fields.shape[1]
    for i in range(len(particles)):
        cos, sin = np.float32(math.cos(particles[i, 2])), np.float32(math.sin(particles[i, 2]))
        # one cell more, so that truncation rounds down for all points in the map
        left, low = np.float32(particles[i, 0] + 1.0), np.float32(particles[i, 1] + 1.0)
        first = second = np.float32(0.0)
        for b in range(beams.shape[1]):
            x = int(left + cos * beams[0, b] - sin * beams[1, b])
            y = int(low + sin * beams[0, b] + cos * beams[1, b])
            at = 255
            if 0 < x <= width and 0 < y <= height:
                quarter = int(cos * beams[2, b] - sin * beams[3, b] < 0.0) \
                    + 2 * int(sin * beams[2, b] + cos * beams[3, b] < 0.0)
                at = int(fields[y - 1, x - 1, quarter])
            first += table[at, 0]
            second += table[at, 1]
        out[i, 0], out[i, 1] = first, second


@kernel
def near_share(particles: FloatArray, beams: Float32Array, fields: Uint8Array, near: float,
               out: FloatArray) -> None:
    """Compute the share of particles from which each beam ends near an obstacle of the map.

    Parameters
    ----------
    particles : (N, 3) float64
        Poses in the grid's frame [cells, cells, rad].
    beams : (4, B) float32
        As for :func:`field_sums`.
    fields : (H, W, 4) uint8
        As for :func:`field_sums`.
    near : float
        ``beam_skip_distance`` [steps].
    out : (B,) float64
        Written.
    """
    height, width = fields.shape[0], fields.shape[1]
    out[:] = 0.0
    for i in range(len(particles)):
        cos, sin = math.cos(particles[i, 2]), math.sin(particles[i, 2])
        for b in range(beams.shape[1]):
            x = math.floor(particles[i, 0] + cos * beams[0, b] - sin * beams[1, b])
            y = math.floor(particles[i, 1] + sin * beams[0, b] + cos * beams[1, b])
            if 0 <= x < width and 0 <= y < height:
                quarter = int(cos * beams[2, b] - sin * beams[3, b] < 0.0) \
                    + 2 * int(sin * beams[2, b] + cos * beams[3, b] < 0.0)
                if fields[y, x, quarter] < near:
                    out[b] += 1.0
    out /= len(particles)


@kernel
def ray_length(x: float, y: float, direction: float, limit: float, blocked: BoolArray, free: Float32Array) -> float:
    """Return the length of a ray to the first cell that is not free, or to the map's edge.

    Parameters
    ----------
    x, y : float
        Start [cells].
    direction : float
        [rad]
    limit : float
        Greatest length [cells].
    blocked : (H, W) bool
        Cells that are not known to be free.
    free : (H, W) float32
        Distance to the nearest one of them [cells].

    Returns
    -------
    float
        [cells]; at most half a cell too long. The ray advances by the free distance around it.
    """
    height, width = blocked.shape
    cos, sin = math.cos(direction), math.sin(direction)
    length = 0.0
    while length < limit:
        column, row = math.floor(x + length * cos), math.floor(y + length * sin)
        if not (0 <= column < width and 0 <= row < height) or blocked[row, column]:
            return length
        length += max(free[row, column] - CORNER, RAY_STEP)
    return limit


@kernel
def beam_sums(particles: FloatArray, mount: FloatArray, beams: FloatArray, blocked: BoolArray, free: Float32Array,
              cell: float, model: FloatArray, out: FloatArray) -> None:
    """Add up the beam model over a scan's beams.

    Parameters
    ----------
    particles : (N, 3) float64
        Poses of the base in the grid's frame [cells, cells, rad].
    mount : (2,) float64
        The laser in the base frame [m].
    beams : (2, B) float64
        Direction in the base frame [rad] and range [m] of each beam.
    blocked, free
        As for :func:`ray_length`.
    cell : float
        Size of a cell [m].
    model : (7,) float64
        z_hit, z_short, z_max, z_rand, sigma_hit [m], lambda_short [1/m], greatest range [m].
    out : (N, 2) float64
        Written: sums of p^3 and of ln p.

    Notes
    -----
    S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, 2005, table 6.1.
    """
    hit, short, missed, uniform, spread, decay, reach = model
    scale = -0.5 / (spread * spread)
    for i in range(len(particles)):
        cos, sin = math.cos(particles[i, 2]), math.sin(particles[i, 2])
        x = particles[i, 0] + (cos * mount[0] - sin * mount[1]) / cell
        y = particles[i, 1] + (sin * mount[0] + cos * mount[1]) / cell
        cubes = logs = 0.0
        for b in range(beams.shape[1]):
            measured = beams[1, b]
            expected = cell * ray_length(x, y, particles[i, 2] + beams[0, b], reach / cell, blocked, free)
            away = measured - expected
            p = hit * math.exp(scale * away * away)
            if away < 0.0:
                p += short * decay * math.exp(-decay * measured)
            p += missed if measured >= reach else uniform / reach
            cubes += p * p * p
            logs += math.log(max(p, 1e-30))
        out[i, 0], out[i, 1] = cubes, logs


@kernel
def _smooth(fields: Uint8Array, quarter: int, x: float, y: float) -> Tuple[float, float, float, bool]:
    """Return distance and gradient, interpolated between cell centres, and whether the place is on the map."""
    height, width = fields.shape[0], fields.shape[1]
    column, row = math.floor(x - 0.5), math.floor(y - 0.5)
    if column < 0 or row < 0 or column + 1 >= width or row + 1 >= height:
        return 0.0, 0.0, 0.0, False
    right, up = x - 0.5 - column, y - 0.5 - row
    a, b = float(fields[row, column, quarter]), float(fields[row, column + 1, quarter])
    c, d = float(fields[row + 1, column, quarter]), float(fields[row + 1, column + 1, quarter])
    low, high = a + right * (b - a), c + right * (d - c)
    return (low + up * (high - low), (1.0 - up) * (b - a) + up * (d - c), high - low, True)


@kernel
def refine_pose(pose: FloatArray, beams: Float32Array, fields: Uint8Array, scale: float, limits: FloatArray,
                prior: FloatArray, rounds: int, out: FloatArray, information: FloatArray) -> float:
    """Move a pose to where the scan fits best, by Gauss-Newton on the distances of its end points to obstacles.

    Parameters
    ----------
    pose : (3,) float64
        In the grid's frame [cells, cells, rad].
    beams : (4, B) float32
        As for :func:`field_sums`.
    fields : (H, W, 4) uint8
        As for :func:`field_sums`.
    scale : float
        Cells in a step.
    limits : (2,) float64
        Standard deviation of a distance, and the distance from which a beam has no weight because it hit what is not in
        the map [cells].
    prior : (3, 3) float64
        Information of ``pose`` [1/cells, rad]; what the scan does not tell is left as it was.
    rounds : int
        Number of steps.
    out : (3,) float64
        Written: the better pose.
    information : (6,) float64
        Written: the upper triangle of its information, ``prior`` and scan together, row by row [1/cells, rad].

    Returns
    -------
    float
        Share of the beams that end near an obstacle of the map, at the better pose.
    """
    out[:] = pose
    spread, near = limits
    count = 0
    gradient, change = np.empty(3), np.empty(3)
    for step in range(rounds + 1):
        cos, sin = math.cos(out[2]), math.sin(out[2])
        at = 0
        for j in range(3):
            gradient[j] = 0.0
            for k in range(3):
                gradient[j] += prior[j, k] * (out[k] - pose[k])
            for k in range(j, 3):
                information[at] = prior[j, k]
                at += 1
        count = 0
        for b in range(beams.shape[1]):
            x, y = cos * beams[0, b] - sin * beams[1, b], sin * beams[0, b] + cos * beams[1, b]
            quarter = int(cos * beams[2, b] - sin * beams[3, b] < 0.0) \
                + 2 * int(sin * beams[2, b] + cos * beams[3, b] < 0.0)
            d, dx, dy, inside = _smooth(fields, quarter, out[0] + x, out[1] + y)
            d, dx, dy = d * scale, dx * scale, dy * scale
            if not inside or d > near:
                continue
            count += 1
            part = d / near
            weight = (1.0 - part * part) ** 2 / (spread * spread)        # Tukey's: far ones fade out
            turn = -y * dx + x * dy
            row = (dx, dy, turn)
            at = 0
            for j in range(3):
                gradient[j] += weight * d * row[j]
                for k in range(j, 3):
                    information[at] += weight * row[j] * row[k]
                    at += 1
        if step == rounds or not solve(information, gradient, change):
            break
        out += change
        if abs(change[0]) + abs(change[1]) < 1e-3 and abs(change[2]) < 1e-5:
            rounds = step + 1                   # one more look at the beams, then the end
    return count / max(1, beams.shape[1])
