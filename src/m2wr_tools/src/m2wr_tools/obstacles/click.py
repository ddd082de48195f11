# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles by click: a point published by rviz's tool "Publish Point" adds or deletes an obstacle."""
from __future__ import annotations

import math
import queue
import time
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Optional, Tuple

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PointStamped

from m2wr_node.node_help import answer_help
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.ros.transform_buffer import TransformBuffer
from m2wr_sim.errors import ParameterError, SimError
from m2wr_sim.geometry import quaternion_from_rpy, rotate
from m2wr_tools.obstacles.obstacle import KINDS, Obstacle, read_colour
from m2wr_tools.obstacles.world import World, outline_of, overlapped_robots, robot_footprint
from m2wr_view.outlines import point_distances

_NEAR = 0.02            # m; a click on the side of an obstacle may be just outside of it
_TF_PATIENCE = 2.0      # s of wall time for a transform
_DEFAULT: Dict[str, List[float]] = {"box": [0.5, 0.5, 0.5], "cylinder": [0.25, 0.5], "sphere": [0.25]}


@dataclass(frozen=True)
class ClickConfig:
    """Parameters of the node."""

    obstacle: Obstacle
    yaw: float
    delete_on_click: bool
    frame: str
    namespace: str


def read_parameters(get: Callable[[str, Any], Any]) -> ClickConfig:
    """Return a :class:`ClickConfig`.

    Parameters
    ----------
    get : callable
        ``get(name, default)`` of private parameters.

    Raises
    ------
    SimError
        Naming the parameter that cannot be used.
    """
    shape = get("~shape", "box")
    if shape not in KINDS:
        raise ParameterError("parameter ~shape is %r; expected one of %s" % (shape, ", ".join(sorted(KINDS))))
    size, mass, yaw = get("~size", _DEFAULT[shape]), get("~mass", 0.0), get("~yaw", 0.0)
    for name, numbers in (("size", size), ("mass", [mass]), ("yaw", [yaw])):
        if not isinstance(numbers, (list, tuple)) or not all(
                isinstance(number, (int, float)) and not isinstance(number, bool) and math.isfinite(number)
                for number in numbers):
            raise ParameterError("parameter ~%s is %r; expected %s" % (
                name, size if name == "size" else numbers[0],
                "a list of numbers: " + ", ".join(KINDS[shape]) if name == "size" else "a finite number"))
    obstacle = Obstacle(shape, tuple(float(number) for number in size), float(mass) if mass else None,
                        read_colour(str(get("~colour", "orange"))))
    return ClickConfig(obstacle, float(yaw), bool(get("~delete_on_click", True)), str(get("~frame", "odom")).strip("/"),
                       str(get("~gazebo_namespace", "/gazebo")))


class ClickObstacles:
    """Answers clicks one after another.

    Parameters
    ----------
    config : ClickConfig
    world : World
    """

    def __init__(self, config: ClickConfig, world: World) -> None:
        self._config, self._world = config, world
        self._clicks: queue.Queue[Optional[PointStamped]] = queue.Queue()
        self._transforms: Optional[TransformBuffer] = None

    def click(self, message: PointStamped) -> None:
        """Take a geometry_msgs/PointStamped; answered by :meth:`run`."""
        self._clicks.put(message)

    def run(self) -> None:
        """Answer clicks until ROS ends."""
        at_shutdown(lambda: self._clicks.put(None))
        while True:
            message = self._clicks.get()
            if message is None or rospy.is_shutdown():
                return
            try:
                self.answer(message)
            except SimError as error:
                rospy.logwarn("click_obstacles: %s", error)

    def answer(self, message: PointStamped) -> None:
        """Add or delete an obstacle at a click; SimError if that is not possible."""
        x, y, z = self._point_in_world(message)
        if not all(math.isfinite(value) for value in (x, y, z)):
            raise ParameterError("a click at (%s, %s, %s) is refused: expected finite numbers" % (x, y, z))
        hit = self.hit(x, y)
        if hit and self._config.delete_on_click:
            self._world.delete(hit)
            rospy.loginfo("click_obstacles: %s is deleted", hit)
            return
        obstacle, place = self._config.obstacle, (x, y, 0.0)
        outline = outline_of(obstacle.kind, obstacle.size, (place, quaternion_from_rpy(0.0, 0.0, self._config.yaw)))
        robots = overlapped_robots(outline, self._world.robots(), robot_footprint())
        if robots:
            rospy.logwarn("click_obstacles: nothing is added at (%.2f, %.2f): it would overlap the robot %s", x, y,
                          ", ".join(robots))
            return
        name = self._world.add(obstacle, place, self._config.yaw)
        rospy.loginfo("click_obstacles: %s at (%.2f, %.2f); a click on it %s", name, x, y,
                      "deletes it" if self._config.delete_on_click else "adds another one")

    def hit(self, x: float, y: float) -> Optional[str]:
        """Return the name of the obstacle of add_obstacle or of a click that covers a point, or None.

        Parameters
        ----------
        x, y : float
            Point in world [m].
        """
        for name, (kind, size, pose) in sorted(self._world.obstacles().items()):
            if point_distances(np.array([[x, y]]), outline_of(kind, size, pose))[0] <= _NEAR:
                return name
        return None

    def _point_in_world(self, message: PointStamped) -> Tuple[float, float, float]:
        point = (message.point.x, message.point.y, message.point.z)
        frame = message.header.frame_id.strip("/")
        if frame in ("", "world", self._config.frame):
            return point
        transform = self._lookup(frame).transform
        q, shift = transform.rotation, transform.translation
        turned = rotate((q.x, q.y, q.z, q.w), point)
        return turned[0] + shift.x, turned[1] + shift.y, turned[2] + shift.z

    def _lookup(self, frame: str) -> Any:
        """Return the newest transform into the world's frame; waits in wall time, as the simulation may be paused."""
        if self._transforms is None:        # a listener costs CPU time; most clicks need none
            self._transforms = TransformBuffer()
            tf2_ros.TransformListener(self._transforms)
        deadline = time.monotonic() + _TF_PATIENCE
        while True:
            try:
                return self._transforms.lookup_transform(self._config.frame, frame, rospy.Time(0))
            except tf2_ros.TransformException as error:
                if time.monotonic() > deadline or rospy.is_shutdown():
                    raise ParameterError("a click in frame \"%s\" is refused: %s. Choose \"%s\" as rviz's Fixed Frame, "
                                         "or start what publishes the transform"
                                         % (frame, error, self._config.frame)) from error
            time.sleep(0.05)


def main() -> int:
    """Entry point; returns the exit code."""
    answer_help("click_obstacles", "Add and delete obstacles by clicks in rviz, with its tool \"Publish Point\".", {
        "shape": "one of %s (box)" % ", ".join(sorted(KINDS)), "size": "list of numbers, by shape [m]",
        "mass": "[kg]; 0: static (0)", "yaw": "[rad] (0)", "colour": "(orange)",
        "delete_on_click": "whether a click on an obstacle deletes it (true)",
        "frame": "tf frame with the axes of the world (odom)", "gazebo_namespace": "(/gazebo)"})
    start_node("click_obstacles", disable_rostime=True)
    try:
        config = read_parameters(rospy.get_param)
    except SimError as error:
        rospy.logfatal("click_obstacles: %s", error)
        return 1
    node = ClickObstacles(config, World(config.namespace))
    rospy.Subscriber("clicked_point", PointStamped, node.click, queue_size=10)
    rospy.loginfo("click_obstacles: click with rviz's \"Publish Point\" to add a %s", config.obstacle.kind)
    node.run()
    return 0
