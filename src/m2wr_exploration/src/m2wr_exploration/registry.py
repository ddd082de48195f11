# SPDX-License-Identifier: BSD-3-Clause
"""Table of the strategies by their names. A new one is one file and one line here."""
from __future__ import annotations

from typing import Any, Dict

from m2wr_navigation import registry

STRATEGIES: Dict[str, str] = {
    "explore_lite": "m2wr_exploration.strategies.explore_lite:ExploreLite",
    "nearest": "m2wr_exploration.strategies.nearest:Nearest",
    "information": "m2wr_exploration.strategies.information:Information",
    "tour": "m2wr_exploration.strategies.tour:Tour",
}


def find(name: str) -> Any:
    """Return the class of a strategy; raises UnknownPluginError if there is none of this name."""
    return registry.find(STRATEGIES, name)
