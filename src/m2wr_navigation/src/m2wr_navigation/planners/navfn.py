# SPDX-License-Identifier: BSD-3-Clause
"""``navfn/NavfnROS``: the path down the gradient of the potential."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Mapping, Optional

import numpy as np

from m2wr_navigation.parameters import Parameter, flag
from m2wr_navigation.planners.planner import (
    Plan,
    Planner,
    PlanningError,
    cell_of,
    cost_table,
    leave_inscribed,
    poses_of,
    reachable_goal,
)
from m2wr_navigation.planners.potential_search import PotentialSearch

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import Float32Array, FloatArray

NEUTRAL, FACTOR = 50.0, 0.8         # COST_NEUTRAL, COST_FACTOR of navfn.h


class Navfn(Planner):
    """navfn with its costs. The wave starts at the goal and ends at the robot; no cell is dropped, no path too long.

    Attributes
    ----------
    search_memory : PotentialSearch
        With the potential of the last plan, if ``visualize_potential`` is set.
    """

    PARAMETERS = {
        "allow_unknown": flag(True, "whether paths may cross unknown cells", False),
        "default_tolerance": Parameter(0.0, "m", 0.0, 1e6, "half side of the square in which a goal may be moved",
                                       False),
        "visualize_potential": flag(False, "whether the potential is published", False),
    }

    def __init__(self, values: Mapping[str, Any], clock: Optional[Callable[[], float]] = None) -> None:
        super().__init__(values, clock)
        self.search_memory = PotentialSearch()

    def table(self) -> Float32Array:
        """Return the cost (256,) float32 of each value."""
        return cost_table(NEUTRAL, self.values.get("cost_factor", FACTOR), self.values["allow_unknown"])

    @property
    def not_found(self) -> str:
        """Why there is no path between two places that are connected."""
        return "the search found no path although start and goal are connected"

    def search(self, costmap: Costmap, start: FloatArray, goal: FloatArray, tolerance: float) -> Plan:
        tolerance = max(tolerance, self.values["default_tolerance"])
        table = self.table()
        begin, target = cell_of(costmap, start, "start"), cell_of(costmap, goal, "goal")
        way_out = leave_inscribed(costmap, table, begin)
        begin = int(way_out[-1, 0]), int(way_out[-1, 1])
        wanted = target
        cells: Optional[FloatArray] = None
        if table[costmap.costs[target]] < np.inf:
            cells = self.cells(costmap, table, begin, target)
        if cells is None:
            target = reachable_goal(costmap, table, begin, target, tolerance)
            if target == wanted:        # the same search again would fail again
                raise PlanningError(self.not_found)
            cells = self.cells(costmap, table, begin, target)
        if cells is None:
            raise PlanningError(self.not_found)
        path = np.concatenate([way_out, cells[1:] if len(cells) > 1 else cells])
        return Plan(poses_of(costmap, path, start, goal, target == wanted))

    def cells(self, costmap: Costmap, table: Float32Array, begin: Any, target: Any) -> Optional[FloatArray]:
        """Return the cells (N, 2) of a path, or None.

        Parameters
        ----------
        costmap : Costmap
        table : (256,) float32
        begin, target : (row, column)
        """
        return self.search_memory.path(costmap, table, begin, target, True, True, self.values["visualize_potential"])
