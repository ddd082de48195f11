# SPDX-License-Identifier: BSD-3-Clause
"""How far one node of a graph may have drifted from each other one, along the way that tells most."""
import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model='numpy')
def _relax(k, onto, out):
    """Go on along a link from node ``k`` to ``onto``; True where that is the better way there."""
    if out[k, 0] >= out[onto, 0]:
        return False
    out[onto, 0], out[onto, 1], out[onto, 2] = out[k, 0], out[k, 1], out[k, 2]
    return True


@njit(cache=True, nogil=True, error_model='numpy')
def _spread(first, way, lever, variances, step, out):
    """Go on from node ``first`` along the path, backwards (``way`` -1) or forwards (1), while that way is better."""
    systematic, variance, length = out[first, 0], out[first, 1], out[first, 2]
    last = out.shape[0] - 1 if way > 0 else 0
    for k in range(first, last, way):
        to = max(k, k + way)            # a step belongs to the node that it leads to
        systematic, variance, length = systematic + lever[to], variance + variances[to], length + step[to]
        if systematic >= out[k + way, 0]:
            return
        out[k + way, 0], out[k + way, 1], out[k + way, 2] = systematic, variance, length


@njit(cache=True, nogil=True, error_model='numpy')
def drift(path, variances, links, source, out):
    """Follow steps and links from the node ``source`` to all others, each by the way with the least systematic drift.

    Parameters
    ----------
    path : (K, 3) float64
    variances : (K,) float64
        Of the place by the step to each node [m^2].
    links : (L, 2) int64
        Pairs of nodes that are known from each other.
    out : (K, 3) float64
        Written: the lever of a heading that drifts, which is the sum over the way of distance from the source times
        step [m^2]; variance of the place [m^2]; length of the way [m].
    """
    count = path.shape[0]
    out[:, 0], out[:, 1], out[:, 2] = np.inf, 0.0, 0.0
    out[source, 0] = 0.0
    lever, step = np.zeros(count), np.zeros(count)
    for k in range(1, count):
        dx, dy = path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1]
        step[k] = math.sqrt(dx * dx + dy * dy)
        dx = path[source, 0] - 0.5 * (path[k, 0] + path[k - 1, 0])
        dy = path[source, 1] - 0.5 * (path[k, 1] + path[k - 1, 1])
        lever[k] = step[k] * math.sqrt(dx * dx + dy * dy)
    for way in (-1, 1):
        _spread(source, way, lever, variances, step, out)
    changed = True
    while changed:
        changed = False
        for k in range(links.shape[0] - 1, -1, -1):      # newest first: they lead farthest
            for side in range(2):
                onto = links[k, side]
                if _relax(links[k, 1 - side], onto, out):
                    changed = True
                    for way in (-1, 1):
                        _spread(onto, way, lever, variances, step, out)


@njit(cache=True, nogil=True, error_model='numpy')
def distances_along(path, out):
    """Write the length of a path (K, 3) up to each node into ``out`` (K,) [m]."""
    total = 0.0
    for k in range(path.shape[0]):
        if k:
            dx, dy = path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1]
            total += math.sqrt(dx * dx + dy * dy)
        out[k] = total


@njit(cache=True, nogil=True, error_model='numpy')
def widths(found, deviations, systematic, shift_limits, turn_limits, shift, turn):
    """Write half widths of searches, (K,) [m] and (K,) [rad], for what ``drift`` has found.

    Parameters
    ----------
    found : (K, 3) float64
        ``out`` of ``drift``.
    deviations : float
        Half width in deviations.
    systematic : float
        What a heading drifts along the way [rad/m].
    shift_limits, turn_limits : tuple of 2 float
        Least and most [m], [rad].
    """
    for k in range(found.shape[0]):
        reach = deviations * (systematic * found[k, 0] + math.sqrt(found[k, 1]))
        shift[k] = min(shift_limits[0] + reach, shift_limits[1])
        turn[k] = min(turn_limits[0] + deviations * systematic * found[k, 2], turn_limits[1])


@njit(cache=True, nogil=True, error_model='numpy')
def old_nodes(along, node, old):
    """Return how many nodes, the first ones, lie more than ``old`` metres of path before ``node``."""
    count = 0
    while count < node and along[node] - along[count] > old:
        count += 1
    return count


@njit(cache=True, nogil=True, error_model='numpy')
def met(path, shift, count, beyond, beside, near, numbers):
    """Find which of the first ``count`` nodes the last one of a path (K, 3) may have met again.

    Parameters
    ----------
    shift : (K,) float64
        How far the last node may have drifted from each [m].
    beyond, beside : float
        How much farther, times and plus [m], is looked.
    near : float
        Drift up to which nodes are near [m].
    numbers : (2, K) int64
        Written: the near ones and the others.

    Returns
    -------
    tuple of int
        How many there are of each.
    """
    x, y, nears, fars = path[-1, 0], path[-1, 1], 0, 0
    for k in range(count):
        dx, dy, reach = path[k, 0] - x, path[k, 1] - y, beyond * shift[k] + beside
        if dx * dx + dy * dy < reach * reach:
            if shift[k] <= near:
                numbers[0, nears] = k
                nears += 1
            else:
                numbers[1, fars] = k
                fars += 1
    return nears, fars


@njit(cache=True, nogil=True, error_model='numpy')
def _inverse(a, b, c, d, e, f, out):
    """Write the inverse of the symmetric matrix (a b c, b d e, c e f) into ``out`` (3, 3)."""
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    by = 1.0 / (a * p + b * q + c * r)
    out[0, 0], out[1, 1], out[2, 2] = p * by, (a * f - c * c) * by, (a * d - b * b) * by
    out[0, 1] = out[1, 0] = q * by
    out[0, 2] = out[2, 0] = r * by
    out[1, 2] = out[2, 1] = (b * c - a * e) * by


@njit(cache=True, nogil=True, error_model='numpy')
def inverse(matrix, out):
    """Write the inverse of a symmetric matrix (3, 3) into ``out``, which may be the same; the library costs more."""
    _inverse(matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[1, 1], matrix[1, 2], matrix[2, 2], out)


@njit(cache=True, nogil=True, error_model='numpy')
def covariance(information, dependent, deviations, floor, out):
    """Write the covariance (3, 3) of a match into ``out``; see ``loop_graph.covariance``."""
    _inverse(information[0] / dependent + 1.0 / (deviations[0] * deviations[0]), information[1] / dependent,
             information[2] / dependent, information[3] / dependent + 1.0 / (deviations[1] * deviations[1]),
             information[4] / dependent, information[5] / dependent + 1.0 / (deviations[2] * deviations[2]), out)
    for k in range(3):
        out[k, k] += floor[k]


@njit(cache=True, nogil=True, error_model='numpy')
def step_information(information, dependent, deviations, floor, out):
    """Write the inverse of ``covariance`` into ``out``; return the variance of the place."""
    covariance(information, dependent, deviations, floor, out)
    variance = out[0, 0] + out[1, 1]
    inverse(out, out)
    return variance


# ---- what is known of odometry's bias later on


@njit(cache=True, nogil=True, error_model='numpy')
def leverage(information, deviations, led, out):
    """Write how a step from one node to the next moves with the bias that odometry is corrected by.

    Parameters
    ----------
    information : (6,) float64
        Upper triangle of the scan's information at the newer node. What the scan holds does not move.
    deviations : (3,) float64
        Of odometry, to which the match was held.
    led : (3,) float64
        Forward way [m] and turn [rad] with their signs, forward direction in the laser's frame [rad].
    out : (3, 3) float64
        Written: derivatives of the step, in the axes of the newer node, by scale of ways, scale of turns, turn a metre.
    """
    a, b, c = 1.0 / deviations[0]**2, 1.0 / deviations[1]**2, 1.0 / deviations[2]**2
    _inverse(information[0] + a, information[1], information[2], information[3] + b, information[4],
             information[5] + c, out)
    forward, turn, x, y = led[0], led[1], math.cos(led[2]), math.sin(led[2])
    for k in range(3):
        ahead, aside, turned = a * out[k, 0], b * out[k, 1], c * out[k, 2]      # rows of the prior's share in the match
        heading = turned + 0.5 * forward * (x * aside - y * ahead)
        out[k, 0], out[k, 1], out[k, 2] = forward * (x * ahead + y * aside), turn * heading, forward * heading


@njit(cache=True, nogil=True, error_model='numpy')
def _times(matrix, x, y, z):
    """Return a matrix (3, 3) times a vector, as three numbers."""
    return (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z,
            matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z,
            matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z)


@njit(cache=True, nogil=True, error_model='numpy')
def look_back(accounts, leverages, variance, changes, out):
    """Find what each step lacks by what the whole run has told of odometry's bias, not by what was known at its time.

    The bias is followed as a random walk, forwards and then backwards.

    Parameters
    ----------
    accounts : (K, 6, 3) float64
        Of each node: information that it told of the bias (3 rows), that times the bias, the bias that odometry was
        corrected by on the way to it, and as its first value the forward way [m].
    leverages : (K, 3, 3) float64
        Of ``leverage``.
    variance : float
        Of the bias before anything is told, and at most.
    changes : (3,) float64
        What the variance grows by in a metre.
    out : (K, 3) float64
        Written: what is to be added to the step to each node, in that node's axes; 0 for the first.

    Notes
    -----
    Rauch, Tung, Striebel: Maximum Likelihood Estimates of Linear Dynamic Systems, AIAA Journal 3(8), 1965.
    """
    count = out.shape[0]
    before, after, found = np.empty((count, 3, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
    x = y = z = 0.0
    spread = variance * np.eye(3)
    for k in range(count):
        for i in range(3):
            spread[i, i] = min(spread[i, i] + changes[i] * abs(accounts[k, 5, 0]), variance)
        inverse(spread, before[k])
        x, y, z = _times(before[k], x, y, z)
        spread[:] = before[k]
        for i in range(3):
            for j in range(3):
                spread[i, j] += accounts[k, i, j]
        inverse(spread, spread)
        x, y, z = _times(spread, x + accounts[k, 3, 0], y + accounts[k, 3, 1], z + accounts[k, 3, 2])
        after[k] = spread
        found[k, 0], found[k, 1], found[k, 2] = x, y, z
    for k in range(count - 1, -1, -1):
        if k < count - 1:
            dx, dy, dz = _times(before[k + 1], x - found[k, 0], y - found[k, 1], z - found[k, 2])
            dx, dy, dz = _times(after[k], dx, dy, dz)
            x, y, z = found[k, 0] + dx, found[k, 1] + dy, found[k, 2] + dz
        out[k, 0], out[k, 1], out[k, 2] = _times(
            leverages[k], x - accounts[k, 4, 0], y - accounts[k, 4, 1], z - accounts[k, 4, 2])
