# SPDX-License-Identifier: BSD-3-Clause
"""The order of explore_lite."""
from __future__ import annotations

from typing import TYPE_CHECKING, List

from m2wr_exploration.strategies.strategy import Strategy
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_exploration.frontiers import Frontier, View


class ExploreLite(Strategy):
    """Straight distance against size, as in explore_lite 2.1.4 (``frontier_search.cpp``).

    The distance is in metres and yet multiplied by the resolution there. Launch files have scales for that, so it is
    kept.
    """

    PARAMETERS = {
        "potential_scale": Parameter(1e-3, "", 0.0, 1e6, "weight of the distance to a frontier"),
        "gain_scale": Parameter(1.0, "", 0.0, 1e6, "weight of the size of a frontier"),
        "orientation_scale": Parameter(0.0, "", 0.0, 1e6, "accepted, without effect, as in explore_lite"),
    }

    def order(self, view: View, frontiers: List[Frontier]) -> List[Frontier]:
        resolution = view.costmap.resolution
        return sorted(frontiers, key=lambda frontier: (
            self.values["potential_scale"] * frontier.nearest * resolution
            - self.values["gain_scale"] * len(frontier.cells) * resolution))
