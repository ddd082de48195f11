# SPDX-License-Identifier: BSD-3-Clause
"""The global planner of move_base: plugin, parameters, topics, and the service ``~PLANNER/make_plan``."""
from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any, Callable, Dict, List

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetPlan
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from m2wr_maps.ros.message_conversion import ArrayGrid, path_message
from m2wr_navigation import registry
from m2wr_navigation.parameters import read, unknown
from m2wr_navigation.planners.grid_search import GlobalPlanner
from m2wr_navigation.planners.navfn import Navfn
from m2wr_navigation.ros.grid_messages import cloud_message, grid_message, potential_points
from m2wr_navigation.ros.reconfigure import serve

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_navigation.planners.planner import Plan
    from m2wr_node.array_types import FloatArray

#: Parameters of the real planners that have no meaning here.
WITHOUT_EFFECT = {"NavfnROS": ("planner_window_x", "planner_window_y"),
                  "GlobalPlanner": ("old_navfn_behavior", "outline_map", "planner_window_x", "planner_window_y",
                                    "publish_potential")}


class PlannerServer:
    """Runs a planner. One plan is made at a time.

    Parameters
    ----------
    name : str
        As in ``base_global_planner``.
    answer : callable
        Handles a request of ``~PLANNER/make_plan``.
    place : str, optional
        Its namespace below that of the node; the last part of its name by default.

    Raises
    ------
    UnknownPluginError
    """

    def __init__(self, name: str, answer: Callable[[Any], Any], place: str = "") -> None:
        kind = registry.find(registry.PLANNERS, name)
        self.name, self._lock = place or registry.short_name(name), threading.Lock()
        self._place = "~" + self.name
        given = rospy.get_param(self._place, {})
        given = given if isinstance(given, dict) else {}
        values, warnings = read(kind.PARAMETERS, given, self._place)
        for sentence in warnings + unknown(
                given, set(kind.PARAMETERS) | set(WITHOUT_EFFECT.get(registry.short_name(name), ())), self._place):
            rospy.logwarn("%s", sentence)
        self.planner = kind(values, time.monotonic)
        self._path = rospy.Publisher(self._place + "/plan", Path, queue_size=1)
        self._potential = rospy.Publisher(
            self._place + "/potential", OccupancyGrid if kind is GlobalPlanner else PointCloud2, queue_size=1)
        self._answer = answer
        self._keep: List[Any] = []
        if any(parameter.changeable for parameter in kind.PARAMETERS.values()):
            self._keep.append(serve(self._place, kind.PARAMETERS, values, self._reconfigure))
        else:
            for key, value in values.items():
                rospy.set_param("{}/{}".format(self._place, key), value)

    def offer(self) -> None:
        """Offer ``~PLANNER/make_plan``, once its node can answer."""
        self._keep.append(rospy.Service(self._place + "/make_plan", GetPlan, self._answer))

    def _reconfigure(self, values: Dict[str, Any]) -> None:
        with self._lock:
            self.planner.configure(values)

    def plan(self, costmap: Costmap, start: FloatArray, goal: FloatArray, tolerance: float = 0.0) -> Plan:
        """Make a plan and publish it; an empty one, too, so that no old one stays on a display.

        Parameters
        ----------
        costmap : Costmap
        start, goal : (3,) float64
            In its frame [m, m, rad].
        tolerance : float
            [m]

        Returns
        -------
        Plan
        """
        with self._lock:
            plan = self.planner.plan(costmap, start, goal, tolerance)
            stamp = rospy.Time.now()
            self._path.publish(path_message(plan.poses, np.full(len(plan.poses), stamp.to_sec()),
                                            Header(stamp=stamp, frame_id=costmap.frame)))
            self._show_potential(costmap, stamp)
            if plan.remark:
                rospy.logwarn_throttle(30.0, plan.remark)
            return plan

    def _show_potential(self, costmap: Costmap, stamp: rospy.Time) -> None:
        planner = self.planner
        if not isinstance(planner, Navfn) or not self._potential.get_num_connections():
            return
        potential = planner.search_memory.potential
        if isinstance(planner, GlobalPlanner) and planner.values["publish_potential"]:
            if potential.shape == costmap.shape:
                self._potential.publish(potential_grid(costmap, potential, planner.values["publish_scale"], stamp))
        elif planner.values.get("visualize_potential") and potential.shape == costmap.shape:
            self._potential.publish(cloud_message(potential_points(costmap, potential), ["x", "y", "z", "pot"],
                                                  costmap.frame, stamp))

    def close(self) -> None:
        """Unregister topics and services."""
        for publisher in (self._path, self._potential):
            publisher.unregister()
        for kept in self._keep:
            if isinstance(kept, rospy.Service):
                kept.shutdown("replaced")
            else:
                kept.set_service.shutdown("replaced")
                kept.descr_topic.unregister()
                kept.update_topic.unregister()


def potential_grid(costmap: Costmap, potential: Any, scale: int, stamp: rospy.Time) -> ArrayGrid:
    """Return a potential as a grid from 0 to ``scale``, -1 where there is none.

    Parameters
    ----------
    costmap : Costmap
    potential : (H, W) float32
    scale : int
    stamp : rospy.Time
    """
    message = grid_message(costmap, stamp)
    finite = np.isfinite(potential)
    most = float(potential[finite].max()) if finite.any() else 1.0
    cells = np.full(potential.shape, -1, np.int8)
    cells[finite] = np.minimum(potential[finite] * (scale / max(most, 1e-6)), scale)
    message.data = cells.ravel()
    return message
