# SPDX-License-Identifier: BSD-3-Clause
"""Planners that sample: RRT, RRT* and Informed RRT*."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Optional

import numpy as np

from m2wr_navigation.parameters import Parameter, flag
from m2wr_navigation.planners import wave_kernels
from m2wr_navigation.planners.grid_search import STEP, with_points
from m2wr_navigation.planners.navfn import Navfn
from m2wr_navigation.planners.sampling_kernels import GOAL, grow, path_in, sapling, shortcut

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import Float32Array, FloatArray

BATCH = 200             # samples between two looks at the clock: some ms
CENTRE = 0.5            # cells: paths of grids count from the centre of cell (0, 0), the kernels from its corner


class RRT(Navfn):
    """RRT (LaValle 1998): the first path that a random tree finds, straightened where a line is free."""

    PARAMETERS = {
        "allow_unknown": flag(True, "whether paths may cross unknown cells", False),
        "default_tolerance": Parameter(0.0, "m", 0.0, 1e6, "half side of the square in which a goal may be moved",
                                       False),
        "cost_factor": Parameter(0.8, "", 0.0, 5.0, "weight of a cell's cost against 50 for a free cell: how much "
                                 "longer a path may be to keep clear of obstacles", False),
        "iterations": Parameter(5000, "", 1, 20000, "greatest number of samples", False),
        "step": Parameter(1.0, "m", 0.01, 1000.0, "greatest length of a branch", False),
        "goal_bias": Parameter(0.05, "", 0.0, 1.0, "share of the samples that are the goal", False),
        "shortcut": flag(True, "whether corners are left out where a straight line costs less", False),
        "planning_time": Parameter(2.0, "s", 0.0, 3600.0, "wall time after which the best path so far is taken; 0: no "
                                   "limit", False),
        "seed": Parameter(0, "", 0, 2 ** 31 - 1, "of the samples; the same seed gives the same path", False),
    }
    REWIRES = False
    INFORMED = False

    _samples = 0            # of the last search

    @property
    def not_found(self) -> str:
        return "no path with {} of {} samples although start and goal are connected; more iterations or a longer " \
            "planning_time may find one".format(self._samples, self.values["iterations"])

    def cells(self, costmap: Costmap, table: Float32Array, begin: Any, target: Any) -> Optional[FloatArray]:
        values = self.values
        if begin == target:
            return np.array([begin], float)
        if wave_kernels.connected(costmap.costs, table, begin)[0][target] == 0:
            return None         # no sample can help
        draws = np.random.default_rng(values["seed"]).random((values["iterations"], 3))
        ends = np.array([begin[::-1], target[::-1]], float) + CENTRE
        gamma = 0.0
        if self.REWIRES:        # Karaman, Frazzoli 2011: gamma > 2 (1 + 1/d)^(1/d) (free area / unit disc)^(1/d), d = 2
            free = float(np.count_nonzero(table[costmap.costs] < np.inf))
            gamma = 2.0 * math.sqrt(1.5 * free / math.pi) * 1.01
        tree = sapling(ends, len(draws))
        options = values["step"] / costmap.resolution, values["goal_bias"], gamma, self.INFORMED
        begun, self._samples, count = self.clock() if self.clock is not None else 0.0, 0, 2
        while self._samples < len(draws):
            count = grow(costmap.costs, table, tree, count, draws[self._samples:self._samples + BATCH], options)
            self._samples = min(self._samples + BATCH, len(draws))
            if self.clock is not None and 0.0 < values["planning_time"] <= self.clock() - begun:
                break
            if not self.REWIRES and tree[1][GOAL] < math.inf:
                break
        path = path_in(tree)
        if not len(path):
            return None
        if values["shortcut"]:
            path = shortcut(costmap.costs, table, path)
        return with_points(path[:, ::-1] - CENTRE, STEP)


class RRTStar(RRT):
    """RRT* (Karaman, Frazzoli 2011): all samples are used, and the tree is rewired; the path tends to the best one."""

    REWIRES = True


class InformedRRTStar(RRTStar):
    """Informed RRT* (Gammell 2014): once there is a path, only places on shorter ones are sampled."""

    INFORMED = True
