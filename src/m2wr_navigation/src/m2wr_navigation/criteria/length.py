# SPDX-License-Identifier: BSD-3-Clause
"""Length of the path."""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_navigation.criteria.criterion import Criterion
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.best_path.track import ObstacleField, Track


class Length(Criterion):
    """Length of the axle's path, with the rest to the goal."""

    UNIT = "m"
    PARAMETERS = {"weight": Parameter(1.0, "m/m", 0.0, 1000.0, "metres of score for a metre of path")}

    def amount(self, track: Track, obstacles: ObstacleField) -> float:
        return track.length
