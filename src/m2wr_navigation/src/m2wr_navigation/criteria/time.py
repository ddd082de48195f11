# SPDX-License-Identifier: BSD-3-Clause
"""Duration of the drive."""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_navigation.criteria.criterion import Criterion
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.best_path.track import ObstacleField, Track


class Time(Criterion):
    """Time from the first movement to the goal."""

    UNIT = "s"
    PARAMETERS = {"weight": Parameter(0.2, "m/s", 0.0, 1000.0, "metres of score for a second")}

    def amount(self, track: Track, obstacles: ObstacleField) -> float:
        return track.time
