# SPDX-License-Identifier: BSD-3-Clause
"""``fake_localization``: the interface of ``amcl`` with the true pose of a simulated robot."""
from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Deque, Dict, Optional

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

from m2wr_maps.ros.message_conversion import pose_message, poses_message
from m2wr_maps.se2 import compose, inverse
from m2wr_maps.transforms import transform_parts
from m2wr_navigation.parameters import Parameter, read, text, unknown
from m2wr_navigation.ros.amcl_messages import checked_pose, planar, pose_of_message
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.ros.transform_buffer import TransformBuffer, fault_of

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

PARAMETERS: Dict[str, Parameter] = {
    "odom_frame_id": text("odom", "frame of the odometry"),
    "base_frame_id": text("base_link", "frame of the robot"),
    "global_frame_id": text("map", "frame of the map and of the poses"),
    "delta_x": Parameter(0.0, "m", -1e6, 1e6, "origin of the map in the simulated world", False),
    "delta_y": Parameter(0.0, "m", -1e6, 1e6, "origin of the map in the simulated world", False),
    "delta_yaw": Parameter(0.0, "rad", -1e3, 1e3, "heading of the map in the simulated world", False),
    "transform_tolerance": Parameter(0.1, "s", 0.0, 10.0, "how far ahead the transform is valid", False),
}
QUEUE = 100                 # true poses that may wait for odometry
POLL = 0.01                 # wall time between two looks at the transforms [s]
PATIENCE = 5.0              # wall time without odometry, or without true poses, after which a warning is due [s]


class FakeLocalization:
    """Publishes pose, one particle and the transform of map to odometry from a simulator's true pose.

    Parameters
    ----------
    values : dict of str to object
        Parameters of :data:`PARAMETERS`.
    """

    def __init__(self, values: Dict[str, Any]) -> None:
        self._odom, self._base, self._map = (values[name].lstrip("/") for name in (
            "odom_frame_id", "base_frame_id", "global_frame_id"))
        self._ahead = rospy.Duration.from_sec(values["transform_tolerance"])
        delta = np.array([values["delta_x"], values["delta_y"], values["delta_yaw"]])
        self._map_from_world: FloatArray = inverse(delta)
        self._last: Optional[FloatArray] = None         # true pose in the world
        self._waiting: Deque[Odometry] = deque(maxlen=QUEUE)
        self._news = threading.Condition()
        self._closed = False
        self._pose = rospy.Publisher("amcl_pose", PoseWithCovarianceStamped, queue_size=1, latch=True)
        self._cloud = rospy.Publisher("particlecloud", PoseArray, queue_size=1, latch=True)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=100)
        self._buffer = TransformBuffer(rospy.Duration(10.0))
        self._listener = tf2_ros.TransformListener(self._buffer)
        threading.Thread(target=self._work, name="localization", daemon=True).start()
        self._truth = rospy.Subscriber("base_pose_ground_truth", Odometry, self._on_truth, queue_size=QUEUE,
                                       tcp_nodelay=True)
        rospy.Subscriber("initialpose", PoseWithCovarianceStamped, self._on_initial_pose, queue_size=2)
        at_shutdown(self._close)

    def _close(self) -> None:
        with self._news:
            self._closed = True
            self._news.notify()

    def _on_truth(self, message: Odometry) -> None:
        fault = fault_of(message.header)
        if fault:
            rospy.logwarn_throttle(10.0, "a pose on %s is refused: %s" % (self._truth.resolved_name, fault))
            return
        with self._news:
            if self._waiting and message.header.stamp < self._waiting[-1].header.stamp:
                self._waiting.clear()               # time jumped back
            self._waiting.append(message)
            self._news.notify()

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        """Move the map so that the robot is there."""
        try:
            pose, _ = pose_of_message(message.pose)
            frame = message.header.frame_id.lstrip("/")
            if frame not in ("", self._map):
                raise ValueError("its frame is {!r}; expected {!r}".format(frame, self._map))
            if self._last is None:
                raise ValueError("no true pose has arrived on {} yet".format(self._truth.resolved_name))
        except ValueError as error:
            rospy.logwarn("the pose on %s is ignored: %s", rospy.resolve_name("initialpose"), error)
            return
        self._map_from_world = compose(pose, inverse(self._last))
        rospy.loginfo("the robot is taken to be at (%.3f, %.3f) on the map", pose[0], pose[1])

    def _work(self) -> None:
        quiet = 0.0
        while True:
            with self._news:
                if not self._waiting and not self._closed:
                    self._news.wait(1.0)
                if self._closed:
                    return
                done = self._take_waiting()
            quiet = 0.0 if done else quiet + (POLL if self._waiting else 1.0)
            if quiet > PATIENCE:
                quiet = 0.0
                self._complain()
            if self._waiting:
                rospy.rostime.wallsleep(POLL)

    def _take_waiting(self) -> bool:
        """Publish for the newest pose with odometry; those before it are dropped. Returns whether there was one."""
        for place in range(len(self._waiting) - 1, -1, -1):
            message = self._waiting[place]
            try:
                base = planar(*transform_parts(self._buffer.lookup_transform_core(
                    self._odom, self._base, message.header.stamp)))
            except tf2_ros.TransformException:
                continue
            for _ in range(place + 1):
                self._waiting.popleft()
            try:
                self._publish(message, base)
            except ValueError as error:
                rospy.logwarn_throttle(10.0, "a pose on %s is refused: %s" % (self._truth.resolved_name, error))
            except rospy.ROSException:              # at the shutdown
                self._closed = True
            return True
        return False

    def _complain(self) -> None:
        if not self._waiting:
            rospy.logwarn("no true pose on %s; expected nav_msgs/Odometry of a simulator, such as its p3d plugin",
                          self._truth.resolved_name)
            return
        try:
            self._buffer.lookup_transform_core(self._odom, self._base, self._waiting[-1].header.stamp)
        except tf2_ros.TransformException as error:
            rospy.logwarn("%d true poses wait for the transform %s -> %s: %s", len(self._waiting), self._odom,
                          self._base, error)

    def _publish(self, message: Odometry, base: FloatArray) -> None:
        truth = checked_pose(message.pose.pose)
        self._last = truth
        on_map = compose(self._map_from_world, truth)
        stamp = message.header.stamp
        transform = TransformStamped(child_frame_id=self._odom)
        transform.header.frame_id, transform.header.stamp = self._map, stamp + self._ahead
        placed = pose_message(compose(on_map, inverse(base)))
        transform.transform.rotation = placed.orientation
        transform.transform.translation.x, transform.transform.translation.y = placed.position.x, placed.position.y
        self._tf.publish(TFMessage([transform]))
        answer = PoseWithCovarianceStamped()
        answer.header.frame_id, answer.header.stamp = self._map, stamp
        answer.pose.pose = pose_message(on_map)
        self._pose.publish(answer)
        self._cloud.publish(poses_message(on_map[None], self._map, stamp))


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("fake_localization")
    given = dict(rospy.get_param("~", {}) or {})
    values, warnings = read(PARAMETERS, given, rospy.get_name())
    for warning in warnings + unknown(given, PARAMETERS, rospy.get_name()):
        rospy.logwarn("%s", warning)
    node = FakeLocalization(values)
    rospy.spin()
    del node
    return 0
