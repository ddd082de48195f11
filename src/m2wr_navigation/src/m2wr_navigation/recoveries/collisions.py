# SPDX-License-Identifier: BSD-3-Clause
"""Where the footprint would meet an obstacle: one check for all behaviours, so that they agree."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_navigation.costmap.footprint_kernels import IN_COLLISION, outline_cost

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation


def collides(situation: Situation, x: float, y: float, yaw: float) -> bool:
    """Return whether the footprint meets an obstacle of the local costmap at a pose.

    Parameters
    ----------
    situation : Situation
    x, y, yaw : float
        Of the base [m, m, rad].
    """
    grid = situation.costmap
    return bool(outline_cost(grid.costs, grid.resolution, grid.origin, situation.footprint, x, y, yaw) == IN_COLLISION)


def is_turn_free(situation: Situation, angle: float, step: float) -> bool:
    """Return whether the footprint meets no obstacle in a turn on the spot; the present heading is not checked.

    Parameters
    ----------
    situation : Situation
    angle : float
        Positive to the left [rad].
    step : float
        Greatest angle between two headings that are checked [rad].
    """
    x, y, yaw = situation.pose
    count = math.ceil(abs(angle) / step)
    return not any(collides(situation, x, y, yaw + angle * k / count) for k in range(1, count + 1))
