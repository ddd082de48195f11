# SPDX-License-Identifier: BSD-3-Clause
"""Sum of all turns."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.criteria.criterion import Criterion
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.best_path.track import ObstacleField, Track


class Turning(Criterion):
    """Sum of the angles by which the robot turned, to either side."""

    UNIT = "rad"
    PARAMETERS = {"weight": Parameter(0.05, "m/rad", 0.0, 1000.0, "metres of score for a radian")}

    def amount(self, track: Track, obstacles: ObstacleField) -> float:
        return float(np.abs(track.turns).sum())
