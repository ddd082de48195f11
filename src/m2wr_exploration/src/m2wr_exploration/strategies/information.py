# SPDX-License-Identifier: BSD-3-Clause
"""Most unknown area for the way."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List

from m2wr_exploration.frontiers import gain
from m2wr_exploration.strategies.strategy import SENSOR_RANGE, Strategy
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_exploration.frontiers import Frontier, View


class Information(Strategy):
    """Visible unknown area, discounted by the path: gain times exp(-path / decay) (Gonzalez-Banos, Latombe 2002)."""

    PARAMETERS = {
        "sensor_range": SENSOR_RANGE,
        "decay": Parameter(5.0, "m", 0.1, 1000.0, "path after which a gain counts 1/e"),
    }

    def order(self, view: View, frontiers: List[Frontier]) -> List[Frontier]:
        reach, decay = self.values["sensor_range"], self.values["decay"]
        return sorted(frontiers, key=lambda frontier: -gain(view.costmap, frontier, reach)
                      * math.exp(-frontier.path / decay))
