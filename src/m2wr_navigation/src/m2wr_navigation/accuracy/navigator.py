# SPDX-License-Identifier: BSD-3-Clause
"""What the nodes amcl and move_base do, in one process: scans and odometry in, pose and command out."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence

import numpy as np

from m2wr_maps.se2 import compose
from m2wr_navigation import registry
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.costmap.costmap_parameters import (
    COSTMAP_PARAMETERS,
    footprint_of,
    layer_settings,
    source_settings,
)
from m2wr_navigation.costmap.footprint_kernels import fill_polygon
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.observation import Observation, Source, scan_points, transformed
from m2wr_navigation.costmap.obstacle_layer import ObstacleLayer
from m2wr_navigation.costmap.static_layer import StaticLayer
from m2wr_navigation.parameters import read
from m2wr_navigation.planners.planner import Plan
from m2wr_navigation.recoveries.behaviours import made
from m2wr_navigation.recoveries.recovery import Costmaps
from m2wr_navigation.supervisor import PARAMETERS, Supervisor

if TYPE_CHECKING:
    from m2wr_navigation.accuracy.scenes import Scene
    from m2wr_navigation.supervisor import Outcome
    from m2wr_node.array_types import FloatArray
    from m2wr_sim.api.records import Scan

HEIGHT = 0.2                # m: of the laser


def costmap_by(given: Mapping[str, Any], outline: Sequence[Sequence[float]], place: str) -> LayeredCostmap:
    """Return a costmap with its layers.

    Parameters
    ----------
    given : mapping of str to object
        The costmap's part of a file of parameters.
    outline : sequence of (float, float)
        ``footprint``.
    place : str
        Its name, for messages.
    """
    values, _ = read(COSTMAP_PARAMETERS, {key: value for key, value in given.items() if key != "footprint"}, place)
    made = LayeredCostmap(values["global_frame"], (values["width"], values["height"]), values["resolution"],
                          (values["origin_x"], values["origin_y"]), values["rolling_window"],
                          values["track_unknown_space"])
    made.least_clearance = values["least_clearance"]
    made.set_footprint(footprint_of({"footprint": outline}, values)[0])
    for setting in layer_settings(given, place)[0]:
        kind = registry.find(registry.LAYERS, setting.kind)
        layer = kind(setting.name, read(kind.PARAMETERS, setting.given, place)[0])
        if isinstance(layer, ObstacleLayer):
            for name, settings in source_settings(setting, place)[0].items():
                layer.sources[name] = Source(name, settings)
        made.add(layer)
    return made


class Navigator(Costmaps):
    """Costmaps, planner, controller, recovery behaviours and their supervisor.

    Parameters
    ----------
    scene : Scene or None
        With the map; None: without one.
    given : mapping of str to object
        Parameters, as in ``config/m2wr.yaml``.
    laser : (3,) float
        The laser in the base frame [m, m, rad].
    """

    def __init__(self, scene: Optional[Scene], given: Mapping[str, Any], laser: FloatArray) -> None:
        self._laser = np.asarray(laser, float)
        self.maps: Dict[str, LayeredCostmap] = {
            which: costmap_by(given[which + "_costmap"], given["footprint"], which) for which in ("global", "local")}
        static = self.maps["global"].static_layer()
        if scene is not None:
            assert isinstance(static, StaticLayer)
            static.set_map(scene.cells, scene.map.resolution, np.append(scene.origin, 0.0), "map")
        self.planner = self._made(registry.PLANNERS, given["base_global_planner"], given)
        values, _ = read(PARAMETERS, {key: value for key, value in given.items() if key in PARAMETERS}, "~")
        self.period = 1.0 / values["controller_frequency"]
        self._replan = 1.0 / values["planner_frequency"] if values["planner_frequency"] > 0.0 else math.inf
        self._slow = 1.0 / given["global_costmap"].get("update_frequency", 5.0)
        recoveries, self.messages = made(values, self.maps["local"].circumscribed, self, given.get)
        self.supervisor = Supervisor(values, self._made(registry.CONTROLLERS, given["base_local_planner"], given),
                                     recoveries)
        self._pose: FloatArray = np.zeros(3)
        self._number, self._goal = 0, np.zeros(3)
        self._plan: FloatArray = np.zeros((1, 3))
        self._planned = self._updated = -math.inf
        self.others: Sequence[FloatArray] = ()      # (K, 2) m: outlines of other robots; obstacles for the controller

    @staticmethod
    def _made(table: Dict[str, str], name: str, given: Mapping[str, Any]) -> Any:
        kind = registry.find(table, name)
        return kind(read(kind.PARAMETERS, kind.renamed(given.get(registry.short_name(name), {})), name)[0])

    def layer_names(self, which: str) -> List[str]:
        return [layer.name for layer in self.maps[which].obstacle_layers()]

    def clear(self, which: str, layers: Sequence[str], side: float, inside: bool) -> int:
        return self.maps[which].clear_area(list(layers), self._pose, side, inside)

    def begin(self, now: float, goal: FloatArray, replaces: bool = False) -> None:
        """Take a goal.

        Parameters
        ----------
        now : float
            [s]
        goal : (3,) float64
            On the map [m, m, rad].
        replaces : bool
            Whether the robot was still on its way to another goal.
        """
        self._goal, self._number = np.asarray(goal, float), self.supervisor.begin(now, replaces)
        self._plan, self._planned = self._pose[None], -math.inf

    def look(self, now: float, scan: Scan, pose: FloatArray, clean: Optional[Scan] = None) -> None:
        """Enter a scan into the costmaps.

        Parameters
        ----------
        now : float
            [s]
        scan : Scan
        pose : (3,) float64
            Of the base on the map; odometry counts as without drift between two scans [m, m, rad].
        clean : Scan, optional
            The scan for the global costmap, if it is another one: without the beams that end on other robots.
        """
        self._pose = np.asarray(pose, float)
        place = compose(self._pose, self._laser)
        translation = (place[0], place[1], HEIGHT)
        quaternion = (0.0, 0.0, math.sin(0.5 * place[2]), math.cos(0.5 * place[2]))
        for which, costmap in self.maps.items():
            taken = clean if clean is not None and which == "global" else scan
            for layer in costmap.obstacle_layers():
                for source in layer.sources.values():
                    points, free = scan_points(taken.ranges.tolist(), scan.angle_min, scan.angle_increment,
                                               (scan.range_min, scan.range_max), source.values)
                    source.add(Observation(now, np.array(translation), transformed(points, translation, quaternion),
                                           transformed(free, translation, quaternion)), now)
            if which == "local" or now - self._updated >= self._slow:
                costmap.update(self._pose, now)
                self._updated = now if which == "global" else self._updated

    def cycle(self, now: float, velocity: FloatArray) -> Outcome:
        """Return what to do in this control cycle.

        Parameters
        ----------
        now : float
            [s]
        velocity : (3,) float64
            By the odometry [m/s, m/s, rad/s].
        """
        if self.supervisor.wants_plan or now - self._planned >= self._replan:
            self._planned = now
            self.maps["global"].drives_sideways = self.supervisor.controller.drives_sideways
            found: Plan = self.planner.plan(self.maps["global"].snapshot(), self._pose, self._goal)
            self.messages += self.supervisor.take_plan(self._number, found, now)
            self._plan = found.poses if len(found.poses) else self._plan
        local = self.maps["local"].snapshot().copy() if len(self.others) else self.maps["local"].snapshot()
        for corners in self.others:
            fill_polygon(local.costs, local.resolution, local.origin, corners, LETHAL)
        outcome = self.supervisor.cycle(now, Situation(
            now, self.period, self._pose, np.asarray(velocity, float), self._plan, local,
            self.maps["local"].footprint), [])
        self.messages += ["{:.1f} s: {}".format(now, text) for text in outcome.messages]
        return outcome
