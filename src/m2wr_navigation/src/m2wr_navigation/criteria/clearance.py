# SPDX-License-Identifier: BSD-3-Clause
"""Least distance from obstacles."""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_navigation.criteria.criterion import Criterion
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.best_path.track import ObstacleField, Track


class LeastClearance(Criterion):
    """Least distance of the robot's outline from a known obstacle; only what lacks to the wanted distance costs."""

    UNIT = "m"
    PARAMETERS = {
        "weight": Parameter(3.0, "m/m", 0.0, 1000.0, "metres of score for a metre that lacks"),
        "wanted": Parameter(0.3, "m", 0.0, 3.0, "greater distances are no better"),
    }

    def amount(self, track: Track, obstacles: ObstacleField) -> float:
        return obstacles.clearance(track)

    def costs(self, amount: float) -> float:
        return max(0.0, self.values["wanted"] - amount)
