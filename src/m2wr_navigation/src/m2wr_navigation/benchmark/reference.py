# SPDX-License-Identifier: BSD-3-Clause
"""The planners of OMPL (Sucan, Moll, Kavraki 2012), if its wheel is installed: the reference for those that sample."""
from __future__ import annotations

import importlib
import math
from typing import TYPE_CHECKING, Any, Dict

import numpy as np

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray, Vector

#: Name here: name in OMPL.
NAMES: Dict[str, str] = {"RRT": "RRT", "RRTStar": "RRTstar", "InformedRRTStar": "InformedRRTstar"}
LOWEST_BLOCKED = 253        # cost
CHECKED = 0.1               # of a cell: between two states of a motion that are checked
NO_OMPL = "OMPL is not installed; pip install ompl"


class NoReferenceError(ImportError):
    """OMPL is not installed."""


def _module(name: str) -> Any:
    try:
        return importlib.import_module("ompl." + name)
    except ImportError as error:
        raise NoReferenceError("{} ({})".format(NO_OMPL, error)) from error


def reference_path(name: str, costmap: Costmap, start: Vector, goal: Vector, seconds: float,
                   step: float = 1.0) -> FloatArray:
    """Return the corners (N, 2) of OMPL's path, or (0, 2) if it finds none [m].

    Parameters
    ----------
    name : str
        One of :data:`NAMES`.
    costmap : Costmap
        Cells below the inscribed cost are free.
    start, goal : (2,) float
        [m]
    seconds : float
        Time for the search; RRT ends with its first path.
    step : float
        Greatest length of a branch [m].

    Raises
    ------
    NoReferenceError
        If OMPL is not installed.
    """
    base, geometric, util = _module("base"), _module("geometric"), _module("util")
    util.setLogLevel(util.LogLevel.LOG_ERROR if hasattr(util, "LogLevel") else util.LOG_ERROR)
    cell, (rows, columns), (left, low) = costmap.resolution, costmap.shape, costmap.origin.tolist()
    free = np.asarray(costmap.costs) < LOWEST_BLOCKED
    space, bounds = base.RealVectorStateSpace(2), base.RealVectorBounds(2)
    for axis, (edge, count) in enumerate(((left, columns), (low, rows))):
        bounds.setLow(axis, edge)
        bounds.setHigh(axis, edge + count * cell)
    space.setBounds(bounds)

    def is_free(state: Any) -> bool:
        column, row = int((state[0] - left) / cell), int((state[1] - low) / cell)
        return bool(free[min(row, rows - 1), min(column, columns - 1)])

    problem = geometric.SimpleSetup(space)
    problem.setStateValidityChecker(is_free)
    problem.getSpaceInformation().setStateValidityCheckingResolution(
        CHECKED * cell / math.hypot(rows * cell, columns * cell))
    ends = space.allocState(), space.allocState()
    for state, place in zip(ends, (start, goal)):
        state[0], state[1] = float(place[0]), float(place[1])
    problem.setStartAndGoalStates(ends[0], ends[1], 0.1 * cell)
    planner = getattr(geometric, NAMES[name])(problem.getSpaceInformation())
    planner.setRange(step)
    problem.setPlanner(planner)
    problem.solve(seconds)
    if not problem.haveExactSolutionPath():
        return np.zeros((0, 2))
    path = problem.getSolutionPath()
    states = [path.getState(k) for k in range(path.getStateCount())]
    return np.array([(state[0], state[1]) for state in states])
