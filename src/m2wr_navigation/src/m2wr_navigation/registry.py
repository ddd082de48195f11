# SPDX-License-Identifier: BSD-3-Clause
"""Table of planners, controllers, methods, criteria, recovery behaviours and costmap layers, by their names.

A new one is one file and one line here.
"""
from __future__ import annotations

import importlib
from typing import Any, Dict, List

PLANNERS: Dict[str, str] = {
    "navfn/NavfnROS": "m2wr_navigation.planners.navfn:Navfn",
    "global_planner/GlobalPlanner": "m2wr_navigation.planners.grid_search:GlobalPlanner",
    "carrot_planner/CarrotPlanner": "m2wr_navigation.planners.carrot:Carrot",
    "m2wr_navigation/AStar": "m2wr_navigation.planners.grid_search:AStar",
    "m2wr_navigation/ThetaStar": "m2wr_navigation.planners.grid_search:ThetaStar",
    "m2wr_navigation/HybridAStar": "m2wr_navigation.planners.hybrid:HybridAStar",
    "m2wr_navigation/RRT": "m2wr_navigation.planners.rrt:RRT",
    "m2wr_navigation/RRTStar": "m2wr_navigation.planners.rrt:RRTStar",
    "m2wr_navigation/InformedRRTStar": "m2wr_navigation.planners.rrt:InformedRRTStar",
}
CONTROLLERS: Dict[str, str] = {
    "base_local_planner/TrajectoryPlannerROS": "m2wr_navigation.controllers.trajectory_planner:TrajectoryPlanner",
    "dwa_local_planner/DWAPlannerROS": "m2wr_navigation.controllers.dwa:Dwa",
    "m2wr_navigation/PurePursuit": "m2wr_navigation.controllers.pure_pursuit:PurePursuit",
}
METHODS: Dict[str, str] = {
    "bug0": "m2wr_navigation.methods.bug0:Bug0",
    "bug1": "m2wr_navigation.methods.bug1:Bug1",
    "bug2": "m2wr_navigation.methods.bug2:Bug2",
    "dist_bug": "m2wr_navigation.methods.dist_bug:DistBug",
    "tangent_bug": "m2wr_navigation.methods.tangent_bug:TangentBug",
    "vfh_plus": "m2wr_navigation.methods.vfh_plus:VfhPlus",
    "follow_the_gap": "m2wr_navigation.methods.follow_the_gap:FollowTheGap",
    "potential_field": "m2wr_navigation.methods.potential_field:PotentialField",
    "dwa": "m2wr_navigation.methods.dynamic_window:DynamicWindow",
    "mppi": "m2wr_navigation.methods.mppi:Mppi",
    "learned": "m2wr_navigation.methods.learned:Learned",
}
CRITERIA: Dict[str, str] = {
    "length": "m2wr_navigation.criteria.length:Length",
    "time": "m2wr_navigation.criteria.time:Time",
    "clearance": "m2wr_navigation.criteria.clearance:LeastClearance",
    "turning": "m2wr_navigation.criteria.turning:Turning",
    "energy": "m2wr_navigation.criteria.energy:Energy",
}
RECOVERIES: Dict[str, str] = {
    "clear_costmap_recovery/ClearCostmapRecovery": "m2wr_navigation.recoveries.clear_costmap:ClearCostmap",
    "rotate_recovery/RotateRecovery": "m2wr_navigation.recoveries.rotate:Rotate",
    "m2wr_navigation/BackUpRecovery": "m2wr_navigation.recoveries.back_up:BackUp",
    "move_slow_and_clear/MoveSlowAndClear": "m2wr_navigation.recoveries.move_slow:MoveSlowAndClear",
}
LAYERS: Dict[str, str] = {
    "costmap_2d::StaticLayer": "m2wr_navigation.costmap.static_layer:StaticLayer",
    "costmap_2d::ObstacleLayer": "m2wr_navigation.costmap.obstacle_layer:ObstacleLayer",
    "costmap_2d::VoxelLayer": "m2wr_navigation.costmap.voxel_layer:VoxelLayer",
    "costmap_2d::InflationLayer": "m2wr_navigation.costmap.inflation_layer:InflationLayer",
}


class UnknownPluginError(ValueError):
    """A parameter names a plugin that the table does not have; the message lists those it has."""


def short_name(name: str) -> str:
    """Return the part of a plugin's name after the package, which is the namespace of its parameters."""
    return name.replace("::", "/").rsplit("/", 1)[-1]


def find(table: Dict[str, str], name: str) -> Any:
    """Return the class of a plugin.

    Parameters
    ----------
    table : dict of str to str
        One of the tables of this module.
    name : str
        With or without the package: ``navfn/NavfnROS``, ``NavfnROS``, ``costmap_2d::StaticLayer``.

    Raises
    ------
    UnknownPluginError
        If no plugin of the table has this name.
    """
    by_short: Dict[str, List[str]] = {}
    for known, target in table.items():
        by_short.setdefault(short_name(known), []).append(target)
    found = [table[name]] if name in table else by_short.get(short_name(name), [])
    if not found:
        raise UnknownPluginError("there is no {!r}; known are {}".format(name, ", ".join(sorted(table))))
    module, _, attribute = found[0].partition(":")
    return getattr(importlib.import_module(module), attribute)
