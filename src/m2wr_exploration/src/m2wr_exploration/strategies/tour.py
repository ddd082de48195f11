# SPDX-License-Identifier: BSD-3-Clause
"""The shortest tour over all frontiers."""
from __future__ import annotations

from typing import TYPE_CHECKING, List

import numpy as np

from m2wr_exploration.strategies.strategy import Strategy
from m2wr_exploration.strategies.tour_kernels import shortest_tour
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_exploration.frontiers import Frontier, View


class Tour(Strategy):
    """Visits all known frontiers on the shortest open tour, and plans it again with each view.

    A near dead end is so looked at while the robot is beside it, not after the way back from elsewhere. Tours over up
    to ``exact`` frontiers are optimal (Held and Karp 1962); the nearest ones are taken if there are more.
    """

    PARAMETERS = {
        "exact": Parameter(9, "", 1, 12, "frontiers in a tour; the time doubles with each"),
    }

    def order(self, view: View, frontiers: List[Frontier]) -> List[Frontier]:
        near = sorted(frontiers, key=lambda frontier: frontier.path)
        toured, rest = near[:self.values["exact"]], near[self.values["exact"]:]
        if len(toured) < 2:
            return near
        between = np.empty((len(toured), len(toured)))
        for number, frontier in enumerate(toured):
            field = view.distances_from(frontier.goal_cell)
            between[number] = [field[other.goal_cell] for other in toured]
        tour = shortest_tour(np.array([frontier.path for frontier in toured]), between)
        return [toured[number] for number in tour] + rest
