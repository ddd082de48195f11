# SPDX-License-Identifier: BSD-3-Clause
"""The controller of move_base: plugin, parameters and topics."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List

import numpy as np
import rospy
from nav_msgs.msg import Path
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from m2wr_maps.ros.message_conversion import path_message
from m2wr_navigation import registry
from m2wr_navigation.parameters import read, unknown
from m2wr_navigation.ros.grid_messages import cloud_message
from m2wr_navigation.ros.reconfigure import serve

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Command
    from m2wr_node.array_types import FloatArray

_COSTS = ["x", "y", "z", "path_cost", "goal_cost", "occ_cost", "total_cost"]
_TRAJECTORIES = ["x", "y", "z", "theta", "cost"]


class ControllerServer:
    """A controller with its topics.

    Parameters
    ----------
    name : str
        As in ``base_local_planner``.
    frequency : float
        Rate of commands, which controllers search upwards [Hz].

    Raises
    ------
    UnknownPluginError
    """

    def __init__(self, name: str, frequency: float) -> None:
        kind = registry.find(registry.CONTROLLERS, name)
        self.name = registry.short_name(name)
        self._place = "~" + self.name
        given = rospy.get_param(self._place, {})
        given = dict(given) if isinstance(given, dict) else {}
        given.setdefault("controller_frequency", frequency)
        latch = rospy.get_param("~latch_xy_goal_tolerance", None)       # where the real DWA planner looks for it
        if latch is not None:
            given.setdefault("latch_xy_goal_tolerance", latch)
        given = kind.renamed(given)
        values, warnings = read(kind.PARAMETERS, given, self._place)
        for sentence in warnings + unknown(given, set(kind.PARAMETERS) | {
                "controller_frequency", "latch_xy_goal_tolerance", "odom_topic", "global_frame_id"}, self._place):
            rospy.logwarn("%s", sentence)
        self.controller = kind(values)
        self._server: Any = serve(self._place, kind.PARAMETERS, values, self._reconfigure)
        self._plans = [rospy.Publisher(self._place + "/" + which, Path, queue_size=1)
                       for which in ("global_plan", "local_plan")]
        self._clouds = [rospy.Publisher(self._place + "/" + which, PointCloud2, queue_size=1)
                        for which in ("cost_cloud", "trajectory_cloud")]

    def _reconfigure(self, values: Dict[str, Any]) -> None:
        self.controller.configure(values)

    def show(self, command: Command, frame: str) -> None:
        """Publish what a controller has decided.

        Parameters
        ----------
        command : Command
        frame : str
            Of the local costmap.
        """
        stamp = rospy.Time.now()
        for publisher, poses in zip(self._plans, (command.used_plan, command.local_plan)):
            if publisher.get_num_connections():
                publisher.publish(_path(poses, frame, stamp))
        for publisher, cloud, names in zip(self._clouds, (command.costs, command.trajectories),
                                           (_COSTS, _TRAJECTORIES)):
            if cloud is not None and publisher.get_num_connections():
                publisher.publish(cloud_message(cloud(), names, frame, stamp))

    def clear(self, frame: str) -> None:
        """Publish empty plans, so that no old ones stay on a display."""
        for publisher in self._plans:
            publisher.publish(_path(np.zeros((0, 3)), frame, rospy.Time.now()))

    def close(self) -> None:
        """Unregister topics and services."""
        publishers: List[Any] = self._plans + self._clouds
        for publisher in publishers:
            publisher.unregister()
        self._server.set_service.shutdown("replaced")
        self._server.descr_topic.unregister()
        self._server.update_topic.unregister()


def _path(poses: FloatArray, frame: str, stamp: rospy.Time) -> Path:
    return path_message(poses, np.full(len(poses), stamp.to_sec()), Header(stamp=stamp, frame_id=frame))
