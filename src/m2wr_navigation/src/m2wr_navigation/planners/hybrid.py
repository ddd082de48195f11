# SPDX-License-Identifier: BSD-3-Clause
"""Hybrid A* as a planner: paths that a robot with a least turning radius can drive (Dolgov 2008)."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, List, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation.parameters import Parameter, flag
from m2wr_navigation.planners import hybrid_kernels, wave_kernels
from m2wr_navigation.planners.navfn import Navfn
from m2wr_navigation.planners.planner import Plan, PlanningError, cell_of, leave_inscribed, reachable_goal
from m2wr_navigation.planners.reeds_shepp_kernels import MOST_PARTS

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

    Pose = Tuple[float, float, float]

MOST_NODES = 1 << 19        # about 40 MB with the heap
SLOTS = 1 << 21             # of the hash table
HEAP = 4                    # places of the heap for each node


class HybridAStar(Navfn):
    """Hybrid A* with arcs of the least turning radius; to the goal by Dubins or, with backing, Reeds-Shepp paths."""

    PARAMETERS = {
        "allow_unknown": flag(True, "whether paths may cross unknown cells", False),
        "default_tolerance": Parameter(0.0, "m", 0.0, 1e6, "half side of the square in which a goal may be moved",
                                       False),
        "cost_factor": Parameter(0.8, "", 0.0, 5.0, "weight of a cell's cost against 50 for a free cell", False),
        "turning_radius": Parameter(0.4, "m", 0.01, 100.0, "of the narrowest curve", False),
        "reverse_factor": Parameter(0.0, "", 0.0, 100.0, "cost of driving backwards over that ahead; 0: never", False),
        "change_cost": Parameter(0.5, "m", 0.0, 100.0, "added cost of changing between ahead and backwards", False),
        "any_goal_heading": flag(False, "whether the path may end with any heading", False),
    }

    def __init__(self, values: Mapping[str, Any], clock: Optional[Callable[[], float]] = None) -> None:
        super().__init__(values, clock)
        self._memory: Any = None

    def _fresh_memory(self) -> Any:
        if self._memory is None:
            self._memory = (np.empty((MOST_NODES, 3)), np.empty(MOST_NODES, np.float32),
                            np.empty((MOST_NODES, 2), np.int32), np.empty(SLOTS, np.int64), np.empty(SLOTS, np.int32),
                            np.empty(HEAP * MOST_NODES, np.float32), np.empty(HEAP * MOST_NODES, np.int32))
        self._memory[3].fill(-1)
        return self._memory

    def search(self, costmap: Costmap, start: FloatArray, goal: FloatArray, tolerance: float) -> Plan:
        table, values = self.table(), self.values
        begin, end = cell_of(costmap, start, "start"), cell_of(costmap, goal, "goal")
        way_out = leave_inscribed(costmap, table, begin)
        first = int(way_out[-1, 0]), int(way_out[-1, 1])
        target = reachable_goal(costmap, table, first, end, max(tolerance, values["default_tolerance"]))
        from_pose = self._in_cells(costmap, start) if len(way_out) == 1 else (first[1] + 0.5, first[0] + 0.5, start[2])
        to_pose = self._in_cells(costmap, goal) if target == end else (target[1] + 0.5, target[0] + 0.5, goal[2])
        distance = np.full(costmap.shape, np.inf, np.float32)
        wave_kernels.wave(costmap.costs, table, target, (-1, -1), distance, np.zeros((0, 0), np.uint8), True)
        cell, memory = costmap.resolution, self._fresh_memory()
        radius = values["turning_radius"] / cell
        options = (radius, values["reverse_factor"], values["change_cost"] / cell, float(values["any_goal_heading"]))
        node, count, heading = hybrid_kernels.hybrid_search(costmap.costs, table, distance, from_pose, to_pose, options,
                                                            memory)
        if node < 0:
            raise PlanningError("start and goal are connected, but there is no path with a turning radius of {:g} m "
                                "and the headings {:.2f} and {:.2f} ({} nodes)".format(
                                    values["turning_radius"], start[2], goal[2], count))
        found = self._path(memory, node, (to_pose[0], to_pose[1], heading), options)
        poses = np.column_stack([found[:, :2] * cell + costmap.origin,
                                 (found[:, 2] + math.pi) % (2.0 * math.pi) - math.pi])
        if len(way_out) > 1:
            poses = np.concatenate([np.asarray(start, float)[None], poses])
        return Plan(poses)

    @staticmethod
    def _in_cells(costmap: Costmap, pose: FloatArray) -> Pose:
        x, y = (np.asarray(pose[:2]) - costmap.origin) / costmap.resolution
        return float(x), float(y), float(pose[2])

    @staticmethod
    def _path(memory: Any, node: int, goal: Pose, options: Tuple[float, float, float, float]) -> FloatArray:
        """Return the poses (N, 3) from the start through a node to the goal [cells, cells, rad]."""
        poses, links = memory[0], memory[2]
        chain: List[int] = [node]
        while links[chain[-1], 0] >= 0:
            chain.append(int(links[chain[-1], 0]))
        last, parts = tuple(poses[node].tolist()), np.empty((MOST_PARTS, 2))
        hybrid_kernels.shot(last, goal, *options[:3], float(links[node, 1]), parts)
        return np.concatenate([poses[chain[::-1]], hybrid_kernels.shot_poses(last, parts)])
