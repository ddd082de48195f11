# SPDX-License-Identifier: BSD-3-Clause
"""``map_merge``: one map of the maps of several robots, with the names of the package multirobot_map_merge."""
from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid

from m2wr_exploration.ros.map_input import TELL, MapInput
from m2wr_exploration.team.map_match import match
from m2wr_exploration.team.merging import merge
from m2wr_navigation.parameters import Parameter, flag, read, text, unknown
from m2wr_navigation.ros.grid_messages import grid_message
from m2wr_node.numbers import number
from m2wr_node.ros.starting import start_node

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

NODE: Dict[str, Parameter] = {
    "robot_map_topic": text("map", "topic of the map of each robot, in the namespace of the robot"),
    "robot_map_updates_topic": text("map_updates", "topic of its changes"),
    "robot_namespace": text("", "text that the namespace of a robot contains; empty: any"),
    "known_init_poses": flag(True, "whether map_merge/init_pose_x, init_pose_y and init_pose_yaw of each robot count; "
                             "false: maps are placed by what they have in common"),
    "merged_map_topic": text("map", "topic of the merged map"),
    "world_frame": text("world", "frame of the merged map"),
    "merging_rate": Parameter(4.0, "Hz", 0.01, 100.0, "rate at which the maps are merged"),
    "discovery_rate": Parameter(0.05, "Hz", 0.001, 10.0, "rate at which new robots are looked for"),
    "estimation_rate": Parameter(0.5, "Hz", 0.001, 10.0, "rate at which maps are placed, without known poses"),
    "estimation_confidence": Parameter(1.0, "", 0.0, 100.0, "least confidence of a place, without known poses"),
}
INIT_POSE = ("init_pose_x", "init_pose_y", "init_pose_yaw")
MOST_ROBOTS = 64


def robots_of(topics: Sequence[Sequence[str]], map_topic: str, namespace: str, merged: str) -> List[str]:
    """Return the namespaces of robots that publish a map.

    Parameters
    ----------
    topics : sequence of (str, str)
        Names and types of all topics.
    map_topic : str
        At the end of the name of the topic of a map.
    namespace : str
        Text that the namespace of a robot contains.
    merged : str
        The topic of the merged map, which is no robot's.
    """
    end = "/" + map_topic.strip("/")
    found = {name[:-len(end)] for name, kind in topics
             if kind == "nav_msgs/OccupancyGrid" and name != merged and name.endswith(end)}
    return sorted(robot for robot in found if namespace.strip("/") in robot)


def init_pose(given: Mapping[str, Any], robot: str) -> FloatArray:
    """Return where a robot began (3,) [m, m, rad].

    Parameters
    ----------
    given : mapping of str to object
        Its parameters below ``map_merge``.
    robot : str
        Namespace, for messages.

    Raises
    ------
    ValueError
        If one is missing or no finite number.
    """
    values = []
    for name in INIT_POSE:
        value = number(given.get(name)) if isinstance(given, Mapping) else None
        if value is None or not np.isfinite(value):
            raise ValueError("{}/map_merge/{} is {!r}; expected a number; the map of this robot is left out. Set "
                             "known_init_poses to false if the start poses are not known".format(
                                 robot, name, given.get(name) if isinstance(given, Mapping) else None))
        values.append(float(value))
    return np.array(values)


class Places:
    """Where the maps of robots lie on each other, found without start poses; the first robot's frame is the common one.

    Parameters
    ----------
    confidence : float
        Least confidence of a place.
    """

    def __init__(self, confidence: float) -> None:
        self.confidence = confidence
        self.poses: Dict[str, FloatArray] = {}

    def estimate(self, maps: Mapping[str, Costmap]) -> List[Tuple[str, str]]:
        """Place the maps that have no place yet on the merged map of those that have one.

        Parameters
        ----------
        maps : mapping of str to Costmap
            By the namespace of the robot.

        Returns
        -------
        list of (str, str)
            Robots, and what is to be told about them.
        """
        told = []
        if maps and not self.poses:
            self.poses[sorted(maps)[0]] = np.zeros(3)
        for robot in sorted(set(maps) - set(self.poses)):
            placed = [name for name in self.poses if name in maps]
            if not placed:
                break
            try:
                together = merge([maps[name] for name in placed], [self.poses[name] for name in placed])
                found = match(together, maps[robot])
            except ValueError as error:
                told.append((robot, "{}: its map cannot be placed: {}".format(robot, error)))
                continue
            if found.confidence >= self.confidence:
                self.poses[robot] = found.pose
                told.append((robot, "{}: its map lies at ({:.2f}, {:.2f}), {:.3f} rad; confidence {:.2f}".format(
                    robot, *found.pose, found.confidence)))
            else:
                told.append((robot, "{}: its map is not placed, confidence {:.2f}: {}".format(
                    robot, found.confidence, found.reason or "estimation_confidence asks for more")))
        return told


class MapMergeNode:
    """Finds robots, and publishes their merged map."""

    def __init__(self) -> None:
        given = dict(rospy.get_param("~", {}) or {})
        self.values, warnings = read(NODE, given, rospy.get_name())
        for warning in warnings + unknown(given, list(NODE), rospy.get_name()):
            rospy.logwarn("%s", warning)
        self.inputs: Dict[str, MapInput] = {}
        self.poses: Dict[str, FloatArray] = {}
        self.places = Places(self.values["estimation_confidence"])
        self._told: Dict[str, str] = {}
        self.merged = rospy.Publisher(self.values["merged_map_topic"], OccupancyGrid, queue_size=1, latch=True)

    def discover(self, topics: Sequence[Sequence[str]]) -> None:
        """Subscribe to the maps of new robots.

        Parameters
        ----------
        topics : sequence of (str, str)
            Names and types of all topics.
        """
        for robot in robots_of(topics, self.values["robot_map_topic"], self.values["robot_namespace"],
                               rospy.resolve_name(self.values["merged_map_topic"])):
            if robot in self.inputs:
                continue
            if len(self.inputs) == MOST_ROBOTS:
                return self._tell("", "more than {} robots publish a map; the others are left out".format(MOST_ROBOTS))
            if self.values["known_init_poses"]:
                try:
                    self.poses[robot] = init_pose(rospy.get_param(robot + "/map_merge", {}), robot)
                except ValueError as error:
                    self._tell(robot, str(error))
                    continue
            rospy.loginfo("the map on %s/%s is merged", robot, self.values["robot_map_topic"])
            self.inputs[robot] = MapInput(robot + "/" + self.values["robot_map_topic"].strip("/"),
                                          robot + "/" + self.values["robot_map_updates_topic"].strip("/"))
        return None

    def _tell(self, robot: str, message: str) -> None:
        if self._told.get(robot) != message:
            self._told[robot] = message
            rospy.logwarn("%s", message)

    def maps(self) -> Dict[str, Costmap]:
        """Return the newest map of each robot that has sent one."""
        found = {robot: each.snapshot() for robot, each in list(self.inputs.items())}
        return {robot: costmap for robot, costmap in found.items() if costmap is not None}

    def estimate(self) -> None:
        """Place the maps whose start poses are not known."""
        for robot, message in self.places.estimate(self.maps()):
            self._tell(robot, message)

    def publish(self) -> bool:
        """Publish the merged map; return whether there is one."""
        poses = self.poses if self.values["known_init_poses"] else dict(self.places.poses)
        maps = {robot: costmap for robot, costmap in self.maps().items() if robot in poses}
        if not maps:
            rospy.logwarn_throttle(TELL, "waiting: no map on a topic that ends with /%s, or no pose for it" % (
                self.values["robot_map_topic"].strip("/")))
            return False
        names = sorted(maps)
        try:
            made = merge([maps[name] for name in names], [poses[name] for name in names], self.values["world_frame"])
        except ValueError as error:
            rospy.logwarn_throttle(TELL, "the maps cannot be merged: %s" % error)
            return False
        self.merged.publish(grid_message(made, rospy.Time.now()))
        return True

    def _keep_estimating(self) -> None:
        while not rospy.is_shutdown():
            self.estimate()
            rospy.rostime.wallsleep(1.0 / self.values["estimation_rate"])

    def spin(self) -> int:
        """Run until the node is shut down; return 0."""
        if not self.values["known_init_poses"]:
            threading.Thread(target=self._keep_estimating, daemon=True).start()
        looked: Optional[float] = None
        while not rospy.is_shutdown():
            now = time.monotonic()
            if looked is None or now - looked >= 1.0 / self.values["discovery_rate"]:
                looked = now
                self.discover(_published())
            self.publish()
            rospy.rostime.wallsleep(1.0 / self.values["merging_rate"])
        return 0


def _published() -> List[Tuple[str, str]]:
    """Return names and types of all topics; none if the master does not answer."""
    try:
        return [(str(name), str(kind)) for name, kind in rospy.get_published_topics()]
    except (OSError, rospy.ROSException) as error:
        rospy.logwarn_throttle(TELL, "the master does not say which topics there are: %s" % error)
        return []


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("map_merge")
    return MapMergeNode().spin()
