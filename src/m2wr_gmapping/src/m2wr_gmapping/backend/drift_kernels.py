# SPDX-License-Identifier: BSD-3-Clause
"""Drift between the nodes of a graph."""
from __future__ import annotations

import math

import numpy as np

from m2wr_node.array_types import FloatArray, IndexArray
from m2wr_node.kernel import kernel


@kernel
def _propagate(first: int, direction: int, lever: FloatArray, variances: FloatArray, turn: FloatArray,
               out: FloatArray) -> None:
    """Continue from node ``first`` along the path, backwards (``direction`` -1) or forwards (1), while the route is
    better.
    """
    by_heading, by_steps, heading = out[first, 0], out[first, 1], out[first, 2]
    last = out.shape[0] - 1 if direction > 0 else 0
    for k in range(first, last, direction):
        to = max(k, k + direction)            # a step is stored with the node at its end
        by_heading, by_steps, heading = by_heading + lever[to], by_steps + variances[to], heading + turn[to]
        if by_heading >= out[k + direction, 0]:
            return
        out[k + direction, 0], out[k + direction, 1], out[k + direction, 2] = by_heading, by_steps, heading


@kernel
def drift(path: FloatArray, variances: FloatArray, walk: float, links: IndexArray, source: int,
          out: FloatArray) -> None:
    """Compute the drift of all nodes against ``source``, each along the route with the least drift of the heading.

    Routes use the steps of the path and the loop closures.

    Parameters
    ----------
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    variances : (K,) float64
        Position variance of the step to each node [m^2].
    walk : float
        Variance of the heading per distance [rad^2/m].
    links : (L, 2) int64
        Pairs of nodes that a loop closure connects.
    source : int
        Number of the node.
    out : (K, 3) float64
        Written: position variance at the source by the headings of the steps, which is the sum of their variances
        times their squared distances from the source [m^2]; position variance of the steps [m^2]; variance of the
        heading [rad^2].
    """
    count = path.shape[0]
    out[:, 0], out[:, 1], out[:, 2] = np.inf, 0.0, 0.0
    out[source, 0] = 0.0
    lever, turn = np.zeros(count), np.zeros(count)
    for k in range(1, count):
        dx, dy = path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1]
        turn[k] = walk * math.sqrt(dx * dx + dy * dy)
        dx = path[source, 0] - 0.5 * (path[k, 0] + path[k - 1, 0])
        dy = path[source, 1] - 0.5 * (path[k, 1] + path[k - 1, 1])
        lever[k] = turn[k] * (dx * dx + dy * dy)
    for direction in (-1, 1):
        _propagate(source, direction, lever, variances, turn, out)
    changed = True
    while changed:
        changed = False
        for k in range(links.shape[0] - 1, -1, -1):      # newest first: they reach farthest
            for side in range(2):
                onto, other = links[k, side], links[k, 1 - side]
                if out[other, 0] < out[onto, 0]:
                    out[onto], changed = out[other], True
                    for direction in (-1, 1):
                        _propagate(onto, direction, lever, variances, turn, out)
