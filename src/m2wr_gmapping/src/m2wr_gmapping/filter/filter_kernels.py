# SPDX-License-Identifier: BSD-3-Clause
"""What one processed scan does to the poses and weights of all particles."""
import math

from numba import njit

COST, INFORMATION = 6, 7


@njit(cache=True, nogil=True, error_model='numpy')
def _draw_one(information, deviations, normals, share, out):
    """Write ``share`` of a draw (3,) from the Gaussian of a match's information plus that of the motion."""
    a = information[0] + 1.0 / (deviations[0] * deviations[0])
    d = information[3] + 1.0 / (deviations[1] * deviations[1])
    f = information[5] + 1.0 / (deviations[2] * deviations[2])
    # lower triangle l of the information; l^-T times standard normal numbers has its inverse as covariance
    l00 = math.sqrt(a)
    l10, l20 = information[1] / l00, information[2] / l00
    l11 = math.sqrt(d - l10 * l10)
    l21 = (information[4] - l20 * l10) / l11
    l22 = math.sqrt(f - l20 * l20 - l21 * l21)
    out[2] = share * normals[2] / l22
    out[1] = (share * normals[1] - l21 * out[2]) / l11
    out[0] = (share * normals[0] - l10 * out[1] - l20 * out[2]) / l00


@njit(cache=True, nogil=True, error_model='numpy')
def draw(rows, deviations, normals, share, dependent, path_weights, poses):
    """Weigh every path by its match and draw its newest pose from the product of match and motion.

    Scans seldom tell particles apart by the little that each draw moves them, and what is drawn adds up: the best
    stays where its match has it, and a path is the less probable the further its poses were drawn from theirs.

    Parameters
    ----------
    rows : (N, 13) float64
        Result rows of ``match_kernels``.
    deviations : (3,) float64
        Of the motion, along the axes of the poses [m, m, rad].
    normals : (N, 3) float64
        Standard normal numbers, of which ``share`` is taken.
    dependent : float
        Beams whose errors are as good as one: by so much a match tells less than its cost says.
    path_weights : (N,) float64
        Logarithms of the paths' probabilities, but for a constant; changed.
    poses : (N, 3) float64
        Written.

    Returns
    -------
    int
        The particle with the most probable path, before what was drawn counts.
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


@njit(cache=True, nogil=True, error_model='numpy')
def weigh(rows, column, gain, log_weights, weights):
    """Add a column of ``rows`` (N, 13) to the logarithms of the weights, and write those smoothed, with sum 1.

    ``gain``: what divides the logarithms (upstream: ogain times the particles).
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
