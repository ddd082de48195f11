"""How far the newest node of a graph may have drifted from each older one, along the way that tells most."""
import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model='numpy')
def _relax(k, onto, systematic, variance, length, out):
    """Go on from node ``k`` to ``onto``; True where that is the better way there."""
    if out[k, 0] + systematic >= out[onto, 0]:
        return False
    out[onto, 0] = out[k, 0] + systematic
    out[onto, 1] = out[k, 1] + variance
    out[onto, 2] = out[k, 2] + length
    return True


@njit(cache=True, nogil=True, error_model='numpy')
def drift(path, variances, links, out):
    """Follow steps and links from the newest node to all others, each by the way with the least systematic drift.

    Parameters
    ----------
    path : (K, 3) float64
    variances : (K,) float64
        Of the place by the step to each node [m^2].
    links : (L, 2) int64
        Pairs of nodes that are known from each other.
    out : (K, 3) float64
        Written: the lever of a heading that drifts, which is the sum over the way of distance from the newest node
        times step [m^2]; variance of the place [m^2]; length of the way [m].
    """
    count = path.shape[0]
    out[:, 0], out[:, 1], out[:, 2] = np.inf, 0.0, 0.0
    last = count - 1
    out[last, 0] = 0.0
    lever, step = np.zeros(count), np.zeros(count)
    for k in range(1, count):
        dx, dy = path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1]
        step[k] = math.sqrt(dx * dx + dy * dy)
        dx = path[last, 0] - 0.5 * (path[k, 0] + path[k - 1, 0])
        dy = path[last, 1] - 0.5 * (path[k, 1] + path[k - 1, 1])
        lever[k] = step[k] * math.sqrt(dx * dx + dy * dy)
    changed = True
    while changed:
        for k in range(last, 0, -1):
            _relax(k, k - 1, lever[k], variances[k], step[k], out)
        for k in range(1, count):
            _relax(k - 1, k, lever[k], variances[k], step[k], out)
        changed = False
        for k in range(links.shape[0]):
            changed |= _relax(links[k, 0], links[k, 1], 0.0, 0.0, 0.0, out)
            changed |= _relax(links[k, 1], links[k, 0], 0.0, 0.0, 0.0, out)
