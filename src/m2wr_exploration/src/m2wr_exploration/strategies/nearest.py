# SPDX-License-Identifier: BSD-3-Clause
"""The nearest frontier."""
from __future__ import annotations

from typing import TYPE_CHECKING, List

from m2wr_exploration.strategies.strategy import Strategy

if TYPE_CHECKING:
    from m2wr_exploration.frontiers import Frontier, View


class Nearest(Strategy):
    """The frontier with the shortest path (Yamauchi 1997)."""

    def order(self, view: View, frontiers: List[Frontier]) -> List[Frontier]:
        return sorted(frontiers, key=lambda frontier: frontier.path)
