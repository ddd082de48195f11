# SPDX-License-Identifier: BSD-3-Clause
"""Which robot drives to which frontier: an auction, as in Burgard, Moors, Stachniss and Schneider (IEEE T-RO, 2005).

The value of a frontier for a robot is its utility minus the length of the path. The pair with the greatest value is
assigned first; then the utility of frontiers near to the one that was assigned is less, as the laser will see them from
there. Every robot may hold the auction on its own: with the same input all come to the same result.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray

TAKEN = 0.5         # m: a frontier this near to an assigned one is the same


def assign(costs: FloatArray, frontiers: FloatArray, claims: FloatArray, reach: float) -> IndexArray:
    """Assign frontiers to robots.

    Parameters
    ----------
    costs : (R, F) float64
        Length of the path of each robot to each frontier [m]; inf: none.
    frontiers : (F, 2) float64
        Their centres [m].
    claims : (C, 2) float64
        Frontiers to which other robots drive already [m].
    reach : float
        Range of the laser [m]: the utility of a frontier far from all that are assigned.

    Returns
    -------
    (R,) int64
        Frontier of each robot; -1: none is left.
    """
    robots, count = costs.shape
    result = np.full(robots, -1, np.int64)
    utility, free = np.full(count, float(reach)), np.ones(count, bool)
    for claim in claims:
        _claim(claim, frontiers, utility, free, reach)
    for _ in range(min(robots, count)):
        values = utility[None] - costs
        values[result >= 0] = -np.inf
        values[:, ~free] = -np.inf
        best = int(np.argmax(values))
        robot, frontier = divmod(best, count)
        if not np.isfinite(values[robot, frontier]):
            break
        result[robot] = frontier
        _claim(frontiers[frontier], frontiers, utility, free, reach)
    return result


def _claim(place: FloatArray, frontiers: FloatArray, utility: FloatArray, free: BoolArray, reach: float) -> None:
    """Discount the frontiers near to a place; what is in view from there with certainty is worth nothing."""
    apart = np.hypot(frontiers[:, 0] - place[0], frontiers[:, 1] - place[1])
    utility -= np.maximum(0.0, reach - apart)
    np.logical_and(free, apart > TAKEN, out=free)
