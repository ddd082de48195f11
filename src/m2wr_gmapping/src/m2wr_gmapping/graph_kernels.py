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
