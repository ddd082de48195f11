# SPDX-License-Identifier: BSD-3-Clause
"""Compile every kernel or load it from its cache: ``python3 -m m2wr_navigation.kernel_warm_up``."""
from __future__ import annotations

from typing import Optional

import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.compare.clearance import Clearances
from m2wr_navigation.controllers import rollout_kernels
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap import footprint_kernels, obstacle_kernels
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint import circle
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.observation import SOURCE_PARAMETERS, Observation, Source
from m2wr_navigation.fusion import ekf_kernels
from m2wr_navigation.fusion.ekf import Ekf, Measurement
from m2wr_navigation.localization.kernel_tour import compile_localization_kernels
from m2wr_navigation.methods import moving_kernels
from m2wr_navigation.methods.method import Sensing
from m2wr_navigation.methods.moving import MovingObstacles
from m2wr_navigation.methods.scan_points import ScanPoints
from m2wr_navigation.optimum.shortest_path import shortest_path
from m2wr_navigation.parameters import read
from m2wr_navigation.planners import potential_search, visibility_kernels
from m2wr_node.kernel_library import prepare
from m2wr_view.outlines import Outline

#: Planners with kernels that no library can have: they take tuples of arrays.
WITH_NUMBA = ("RRT", "InformedRRTStar", "HybridAStar")


def small_costmap(rolling: bool = False, overwrite: bool = False, kind: str = "ObstacleLayer") -> LayeredCostmap:
    """Return an updated costmap of 4 x 4 m with an obstacle, a map and inflation.

    Parameters
    ----------
    rolling : bool
    overwrite : bool
        Whether obstacles replace the costs of the map.
    kind : str
        Type of the layer with the obstacle.
    """
    costmap = LayeredCostmap("map", (4.0, 4.0), 0.1, (0.0, 0.0), rolling, True)
    costmap.set_footprint(circle(0.2))
    for name, given in (("StaticLayer", {"use_maximum": overwrite}),
                        (kind, {"combination_method": 0 if overwrite else 1}), ("InflationLayer", {})):
        made = registry.find(registry.LAYERS, name)
        costmap.add(made(name, read(made.PARAMETERS, given, name)[0]))
    static = costmap.static_layer()
    assert static is not None
    static.set_map(np.zeros((40, 40), np.int8), 0.1, np.zeros(3), "map")
    source = Source("laser", read(SOURCE_PARAMETERS, {"clearing": True}, "laser")[0])
    costmap.obstacle_layers()[0].sources["laser"] = source
    source.add(Observation(0.0, np.array([2.0, 2.0, 0.2]), np.array([[3.0, 2.0, 0.2]]), np.zeros((0, 3))), 0.0)
    costmap.update(np.array([2.4, 2.0, 0.0]), 0.0)      # a rolling costmap is no longer aligned with the map
    return costmap


def compile_costmap_kernels() -> None:
    """Update costmaps of each kind."""
    for kind in ("ObstacleLayer", "VoxelLayer"):
        for rolling in (False, True):
            costmap = small_costmap(rolling, rolling, kind)
            grid = costmap.snapshot()
            footprint_kernels.outline_cost(grid.costs, grid.resolution, grid.origin, costmap.footprint, 2.0, 2.0, 0.0)
            costmap.clear_area([kind], np.array([2.0, 2.0, 0.0]), 1.0, True)
            for layer in costmap.obstacle_layers():
                layer.configure(layer.values)


def compile_planner_kernels(wanted: Optional[type] = None) -> None:
    """Plan with each kind of search, on a small grid and on a large one; wake the reasons of failures, too.

    Parameters
    ----------
    wanted : type, optional
        The planner of a node. Others of ``WITH_NUMBA`` are left out then: they would load numba for nothing.
    """
    start, goal = np.array([0.5, 0.5, 0.0]), np.array([3.0, 3.0, 0.0])
    for side in (64, potential_search.SIDE):
        costmap = Costmap.filled((side, side), 0.1, (0.0, 0.0), 0)
        costmap.costs[10:20, 15], costmap.costs[30, 30] = 254, 254
        costmap.costs[5, 5], costmap.beside = 253, 0.15
        for name in ("NavfnROS", "AStar", "ThetaStar") + WITH_NUMBA:
            kind = registry.find(registry.PLANNERS, name)
            if name in WITH_NUMBA and wanted not in (None, kind):
                continue
            kind(read(kind.PARAMETERS, {"iterations": 100}, name)[0]).plan(costmap, start, goal, 0.3)
    visibility_kernels.shortest(costmap.costs[:40, :40] // 254, (1, 1), (38, 38))


def compile_optimum_kernels() -> None:
    """Find the shortest path around a disc, and the clearance of a robot on it."""
    disc = Outline(np.array([(0.0, 0.0)]), 0.5)
    shortest_path([disc], 0.2, (-2.0, 0.0), (2.0, 0.0))
    Clearances([disc], [disc]).least(np.zeros((1, 3)))


def compile_controller_kernels() -> None:
    """Let each controller with kernels of its own drive, turn at the goal, and leave an obstacle."""
    costmap = Costmap.filled((60, 60), 0.1, (-3.0, -3.0), 0)
    blocked = costmap.copy()
    blocked.costs[30, 32] = 254
    footprint = np.array([[0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2], [0.2, -0.2]])
    for name in ("DWAPlannerROS", "TrajectoryPlannerROS"):
        kind = registry.find(registry.CONTROLLERS, name)
        controller = kind(read(kind.PARAMETERS, {}, name)[0])
        for end, grid in ((2.0, costmap), (0.05, costmap), (2.0, blocked)):
            plan = np.column_stack([np.linspace(0.0, end, 20), np.zeros(20), np.ones(20)])
            controller.compute(Situation(0.0, 0.1, np.zeros(3), np.zeros(3), plan, grid, footprint))


def compile_method_kernels() -> None:
    """Let the methods with kernels take some decisions: an obstacle is in sight, again, and gone; and hit one."""
    for name in ("mppi", "dwa", "bug2"):
        kind = registry.find(registry.METHODS, name)
        given = {"samples": 10} if "samples" in kind.PARAMETERS else {}
        method = kind(read(kind.PARAMETERS, given, name)[0])
        method.begin((1.0, 0.0))
        for time, reading in ((0.0, 2.0), (1.0, 2.0), (2.0, 4.0), (3.0, 0.3)):
            method.step(Sensing(time, (0.0, 0.0, 0.0), (0.0, 0.0), np.full(10, reading, np.float32), -1.0, 0.2))


def compile_tracking_kernels() -> None:
    """Fuse two measurements, and follow a disc that moves and then leaves the view."""
    ekf, used = Ekf(), np.arange(ekf_kernels.SIZE) < 3
    for stamp in (0.0, 1.0):
        ekf.add(Measurement(stamp, used, np.zeros(ekf_kernels.SIZE), np.eye(ekf_kernels.SIZE)))
    ekf_kernels.rotation(0.0, 0.0, 0.0, -1)
    moving, beams = MovingObstacles(5.0, 0.1), np.arange(40)
    angles = 0.05 * (beams - 20)
    for stamp in range(6):
        hits = np.abs(beams - 10 - 3 * stamp) < 4
        ranges = np.where(hits, 2.0, 5.0)
        ends = ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        moving.update(ScanPoints(float(stamp), np.zeros(3), ends, hits & (stamp < 5), beams, ranges, -1.0, 0.05))
    moving_kernels.beam_at(1.0, 0.0, np.zeros(3), -1.0, 0.05, 40)
    moving_kernels.circle_through(ends, 1.0, 0.0, 0.2)


def compile_rare_kernels() -> None:
    """Call what only some parameters, or some places, use."""
    costs, corner = np.zeros((20, 20), np.uint8), np.zeros(2)
    footprint_kernels.line_cost(costs, 1, 1, 5, 9)
    obstacle_kernels.surface_cells(costs, 0.1, corner, np.array([[1.0, 1.0, 0.2]]), np.array([0.5, 0.5, 0.2]), 3.0, 0.1)
    rollout_kernels.poses_after(np.zeros((2, 3)), np.zeros(3), np.zeros(3), np.ones(3), np.ones(4), np.empty((2, 3)))


def compile_kernels() -> None:
    """Call everything once."""
    compile_controller_kernels()
    compile_costmap_kernels()
    compile_planner_kernels()
    compile_localization_kernels()
    compile_optimum_kernels()
    compile_method_kernels()
    compile_tracking_kernels()
    compile_rare_kernels()


if __name__ == "__main__":
    prepare("m2wr_navigation", compile_kernels)
