# SPDX-License-Identifier: BSD-3-Clause
"""Update of the particles' poses and weights by one processed scan."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

COST, INFORMATION = 6, 7


@kernel
def _draw_one(information: FloatArray, deviations: FloatArray, normals: FloatArray, share: float,
              out: FloatArray) -> None:
    """Write ``share`` of a draw (3,) from the product of match and motion model."""
    a = information[0] + 1.0 / (deviations[0] * deviations[0])
    d = information[3] + 1.0 / (deviations[1] * deviations[1])
    f = information[5] + 1.0 / (deviations[2] * deviations[2])
    # l: Cholesky factor of the information; l^-T times standard normal numbers has the inverse information as
    # covariance
    l00 = math.sqrt(a)
    l10, l20 = information[1] / l00, information[2] / l00
    l11 = math.sqrt(d - l10 * l10)
    l21 = (information[4] - l20 * l10) / l11
    l22 = math.sqrt(f - l20 * l20 - l21 * l21)
    out[2] = share * normals[2] / l22
    out[1] = (share * normals[1] - l21 * out[2]) / l11
    out[0] = (share * normals[0] - l10 * out[1] - l20 * out[2]) / l00


@kernel
def draw(rows: FloatArray, deviations: FloatArray, normals: FloatArray, share: float, dependent: float,
         path_weights: FloatArray, poses: FloatArray) -> int:
    """Weight every path by its match and draw its newest pose from the product of match and motion model.

    Scans seldom distinguish particles by such small draws, and the draws accumulate. So the best particle keeps its
    match, and a path is less probable the farther its poses were drawn from their matches.

    Parameters
    ----------
    rows : (N, 13) float64
        Result rows of ``match_kernels``.
    deviations : (3,) float64
        Standard deviations of the motion, along the axes of the poses [m, m, rad].
    normals : (N, 3) float64
        Standard normal numbers.
    share : float
        Share of the draw that is used.
    dependent : float
        Number of beams that count as one: divides the cost.
    path_weights : (N,) float64
        Changed: log-probabilities of the paths, up to a constant.
    poses : (N, 3) float64
        Written: drawn poses in ``map``.

    Returns
    -------
    int
        Particle with the most probable path, before the draws count.
    """
    count, best = rows.shape[0], 0
    for n in range(count):
        path_weights[n] -= rows[n, COST] / dependent
        if path_weights[n] > path_weights[best]:
            best = n
    for n in range(count):
        x, y, theta = rows[n, 0], rows[n, 1], rows[n, 2]
        out, z = poses[n], normals[n]
        if n == best:
            out[0], out[1], out[2] = x, y, theta
            continue
        _draw_one(rows[n, INFORMATION:], deviations, z, share, out)
        path_weights[n] -= 0.5 * share * share * (z[0] * z[0] + z[1] * z[1] + z[2] * z[2])
        c, s = math.cos(theta), math.sin(theta)
        out[0], out[1] = x + c * out[0] - s * out[1], y + s * out[0] + c * out[1]
        out[2] = (theta + out[2] + math.pi) % (2.0 * math.pi) - math.pi
    return best


@kernel
def weigh(rows: FloatArray, column: int, gain: float, log_weights: FloatArray, weights: FloatArray) -> None:
    """Add a column of the results to the log-weights, and write the normalised weights.

    Parameters
    ----------
    rows : (N, 13) float64
        Result rows of ``match_kernels``.
    column : int
        Column of ``rows``.
    gain : float
        Divisor of the log-weights (gmapping: ogain times the number of particles).
    log_weights : (N,) float64
        Changed.
    weights : (N,) float64
        Written; sum 1.
    """
    count, most = log_weights.shape[0], -math.inf
    for n in range(count):
        log_weights[n] += rows[n, column]
        most = max(most, log_weights[n])
    total = 0.0
    for n in range(count):
        weights[n] = math.exp((log_weights[n] - most) / gain)
        total += weights[n]
    for n in range(count):
        weights[n] /= total
