# SPDX-License-Identifier: BSD-3-Clause
"""A* and Theta* as planners, and ``global_planner/GlobalPlanner``."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Mapping, Optional

import numpy as np

from m2wr_navigation.parameters import Parameter, flag
from m2wr_navigation.planners import any_angle_kernels, grid_search_kernels, wave_kernels
from m2wr_navigation.planners.navfn import Navfn
from m2wr_navigation.planners.planner import Plan, cost_table
from m2wr_navigation.planners.potential_search import allowed_blocks

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import Float32Array, FloatArray

STEP = 0.5                  # cells between two points of a straight part, as navfn's paths have


class AStar(Navfn):
    """A* on eight neighbours with the octile heuristic."""

    PARAMETERS = {
        "allow_unknown": flag(True, "whether paths may cross unknown cells", False),
        "default_tolerance": Parameter(0.0, "m", 0.0, 1e6, "half side of the square in which a goal may be moved",
                                       False),
        "cost_factor": Parameter(0.8, "", 0.0, 5.0, "weight of a cell's cost against 50 for a free cell", False),
    }

    def __init__(self, values: Mapping[str, Any], clock: Optional[Callable[[], float]] = None) -> None:
        super().__init__(values, clock)
        self._total: Float32Array = np.zeros((0, 0), np.float32)
        self._parent = np.zeros((0, 0), np.int32)

    def cells(self, costmap: Costmap, table: Float32Array, begin: Any, target: Any) -> Optional[FloatArray]:
        return self.grid_cells(costmap, table, begin, target)

    def grid_cells(self, costmap: Costmap, table: Float32Array, begin: Any, target: Any) -> Optional[FloatArray]:
        """Return the cells (N, 2) of a path, or None.

        Parameters
        ----------
        costmap : Costmap
        table : (256,) float32
        begin, target : (row, column)
        """
        self._make_room(costmap)
        visited, count, reached = grid_search_kernels.search(
            costmap.costs, table, begin, target, allowed_blocks(costmap, table, begin, target), self._total,
            self._parent)
        path = grid_search_kernels.path_back(self._parent, begin, target) if reached else None
        wave_kernels.restore(self._total, visited, count)
        return None if path is None else with_points(path.astype(float), STEP)

    def _make_room(self, costmap: Costmap) -> None:
        if self._total.shape != costmap.shape:
            self._total = np.full(costmap.shape, np.inf, np.float32)
            self._parent = np.empty(costmap.shape, np.int32)


class ThetaStar(AStar):
    """Theta*: like A*, with straight lines between any two cells in sight. The potential is its heuristic."""

    def __init__(self, values: Mapping[str, Any], clock: Optional[Callable[[], float]] = None) -> None:
        super().__init__(values, clock)
        self._potential: Float32Array = np.zeros((0, 0), np.float32)

    def cells(self, costmap: Costmap, table: Float32Array, begin: Any, target: Any) -> Optional[FloatArray]:
        self._make_room(costmap)
        if self._potential.shape != costmap.shape:
            self._potential = np.full(costmap.shape, np.inf, np.float32)
        reached_cells, reached_count, reached = wave_kernels.wave(
            costmap.costs, table, target, begin, self._potential, allowed_blocks(costmap, table, begin, target), True)
        path = None
        if reached:
            visited, count, found = any_angle_kernels.search(
                costmap.costs, table, begin, target, self._potential, self._total, self._parent)
            if found:
                corners = grid_search_kernels.path_back(self._parent, begin, target)
                path = any_angle_kernels.straighten(costmap.costs, table, corners)
            wave_kernels.restore(self._total, visited, count)
        wave_kernels.restore(self._potential, reached_cells, reached_count)
        return None if path is None else with_points(path.astype(float), STEP)


def with_points(cells: FloatArray, step: float) -> FloatArray:
    """Return a path (M, 2) with points at most ``step`` apart.

    Parameters
    ----------
    cells : (N, 2) float64
        Its corners.
    step : float
        In the unit of the corners.
    """
    parts = [cells[:1]]
    for begin, end in zip(cells[:-1], cells[1:]):
        count = max(1, int(math.ceil(np.hypot(*(end - begin)) / step - 1e-9)))
        parts.append(begin + (end - begin) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(parts)


NONE, FORWARD, INTERPOLATE, FORWARD_THEN_INTERPOLATE, BACKWARD, LEFTWARD, RIGHTWARD = range(7)


class GlobalPlanner(AStar):
    """global_planner: Dijkstra with the quadratic potential or the 4-connected one, or A*."""

    PARAMETERS = {
        "allow_unknown": flag(True, "whether paths may cross unknown cells", False),
        "default_tolerance": Parameter(0.0, "m", 0.0, 1e6, "half side of the square in which a goal may be moved",
                                       False),
        "use_dijkstra": flag(True, "whether the path follows the potential; otherwise A* on eight neighbours", False),
        "use_quadratic": flag(True, "whether the potential has the quadratic approximation", False),
        "use_grid_path": flag(False, "whether the path goes from cell to cell; otherwise down the gradient", False),
        "neutral_cost": Parameter(50, "", 1, 255, "cost of a free cell"),
        "cost_factor": Parameter(3.0, "", 0.01, 5.0, "weight of a cell's cost"),
        "lethal_cost": Parameter(253, "", 1, 255, "cells of this cost or more are blocked"),
        "publish_potential": flag(True, "whether the potential is published"),
        "publish_scale": Parameter(100, "", 1, 100, "greatest value of the published potential", False),
        "orientation_mode": Parameter(1, "", 0, 6, "0 none, 1 forward, 2 interpolate, 3 forward then interpolate, "
                                      "4 backward, 5 left, 6 right"),
        "orientation_window_size": Parameter(1, "", 1, 255, "poses to each side that give the heading"),
    }

    def table(self) -> Float32Array:
        values = self.values
        table = cost_table(float(values["neutral_cost"]), values["cost_factor"], values["allow_unknown"])
        table[min(values["lethal_cost"], 253):255] = np.inf
        return table

    def cells(self, costmap: Costmap, table: Float32Array, begin: Any, target: Any) -> Optional[FloatArray]:
        if not self.values["use_dijkstra"]:
            return self.grid_cells(costmap, table, begin, target)
        return self.search_memory.path(costmap, table, begin, target, self.values["use_quadratic"],
                                       not self.values["use_grid_path"], self.values["publish_potential"])

    def search(self, costmap: Costmap, start: FloatArray, goal: FloatArray, tolerance: float) -> Plan:
        plan = super().search(costmap, start, goal, tolerance)
        turn(plan.poses, start[2], self.values["orientation_mode"], self.values["orientation_window_size"])
        return plan


def turn(poses: FloatArray, start_yaw: float, mode: int, window: int) -> None:
    """Write the headings of all poses but the last one, as global_planner's OrientationFilter.

    Parameters
    ----------
    poses : (N, 3) float64
        Changed.
    start_yaw : float
        [rad]
    mode : int
        ``orientation_mode``.
    window : int
        Poses to each side.
    """
    count = len(poses)
    if count < 2:
        return
    at = np.arange(count)
    ahead, behind = poses[np.minimum(at + window, count - 1), :2], poses[np.maximum(at - window, 0), :2]
    along = np.arctan2(*(ahead - behind).T[::-1])
    shortest = (poses[-1, 2] - start_yaw + math.pi) % (2.0 * math.pi) - math.pi
    between = start_yaw + shortest * at / (count - 1)
    yaws = {NONE: np.zeros(count), FORWARD: along, INTERPOLATE: between, BACKWARD: along + math.pi,
            LEFTWARD: along - 0.5 * math.pi, RIGHTWARD: along + 0.5 * math.pi}.get(mode)
    if yaws is None:            # forward, then a turn over the last window
        yaws = along
        last = max(0, count - 1 - window)
        shortest = (poses[-1, 2] - along[last] + math.pi) % (2.0 * math.pi) - math.pi
        yaws[last:] = along[last] + shortest * np.arange(count - last) / max(1, count - 1 - last)
    poses[:-1, 2] = (yaws[:-1] + math.pi) % (2.0 * math.pi) - math.pi
