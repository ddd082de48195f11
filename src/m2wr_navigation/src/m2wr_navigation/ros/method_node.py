# SPDX-License-Identifier: BSD-3-Clause
"""``method``: drives a robot to goals by a method without a map, from scan and odometry."""
from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, Any, Dict, Optional

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from m2wr_navigation import registry
from m2wr_navigation.methods.body import M2WR, RobotBody
from m2wr_navigation.methods.method import REACHED, RUNNING, Decision, Sensing
from m2wr_navigation.parameters import Parameter, flag, read, text, unknown
from m2wr_navigation.robot_body import body_of
from m2wr_navigation.ros.transforms import TransformError, Transforms
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.ros.transform_buffer import fault_of
from m2wr_sim.api import read_robot
from m2wr_sim.errors import SimError
from motion_plan.pose_history import PoseHistory
from motion_plan.ros_support import planar_pose

if TYPE_CHECKING:
    from m2wr_navigation.methods.method import Method

PARAMETERS: Dict[str, Parameter] = {
    "method": text("tangent_bug", "name of the method"),
    "goal_x": Parameter(math.inf, "m", -math.inf, math.inf, "first goal, in the frame of the odometry; inf: none",
                        False),
    "goal_y": Parameter(math.inf, "m", -math.inf, math.inf, "the same", False),
    "exit_on_goal": flag(False, "end when the goal is reached (exit code 0) or cannot be (1)", False),
}
STALE = 0.4                 # s without a scan or odometry, after which the robot stops; with CHECKED within 0.5 s
CHECKED = 0.05              # s between two looks at the age of messages
MOST_BEAMS = 100000
WIDEST = 4.0 * math.pi      # rad: greatest angle of a scan, so that all angles are exact


def beams_fault(message: LaserScan) -> str:
    """Return why a scan cannot be used, or an empty text."""
    fault: str = fault_of(message.header)
    if fault:
        return fault
    if not 2 <= len(message.ranges) <= MOST_BEAMS:
        return "it has {} readings; expected 2 to {}".format(len(message.ranges), MOST_BEAMS)
    if not (math.isfinite(message.angle_min) and math.isfinite(message.angle_increment) and message.angle_increment):
        return "angle_min {}, angle_increment {}; expected finite numbers, the second not 0".format(
            message.angle_min, message.angle_increment)
    if max(abs(message.angle_min), abs(message.angle_increment) * len(message.ranges)) > WIDEST:
        return "angle_min {:g}, angle_increment {:g} for {} readings; expected angles of at most two turns".format(
            message.angle_min, message.angle_increment, len(message.ranges))
    return ""


def robot_body() -> RobotBody:
    """Return the body of the robot in the parameter ``robot_description``, and of m2wr without one."""
    description = rospy.get_param("robot_description", "")
    if not isinstance(description, str) or not description:
        rospy.loginfo("there is no parameter %s: the robot is taken for m2wr", rospy.resolve_name("robot_description"))
        return M2WR
    try:
        if "<" not in description:
            raise ValueError("it is {!r}; expected the text of a URDF".format(description[:40]))
        return body_of(read_robot(description))
    except (SimError, ValueError) as error:
        rospy.logwarn("parameter %s: %s; the robot is taken for m2wr", rospy.resolve_name("robot_description"), error)
        return M2WR


class MethodNode:
    """Takes a decision with each scan.

    Parameters
    ----------
    values : dict of str to object
        Parameters of :data:`PARAMETERS`.
    method : Method
    """

    def __init__(self, values: Dict[str, Any], method: Method) -> None:
        self._values, self._method = values, method
        self._lock, self._history = threading.RLock(), PoseHistory()
        self._frame, self._speed = "odom", (0.0, 0.0)
        self._driving, self._closed = False, False
        self._arrived = {"scan": -math.inf, "odom": -math.inf}
        self.outcome = RUNNING
        self._transforms = Transforms()
        self._publisher = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        if math.isfinite(values["goal_x"]) and math.isfinite(values["goal_y"]):
            self._begin(values["goal_x"], values["goal_y"])
        rospy.Subscriber("odom", Odometry, self._on_odometry, queue_size=10, tcp_nodelay=True)
        self._scan = rospy.Subscriber("scan", LaserScan, self._on_scan, queue_size=1, tcp_nodelay=True)
        self._goal = rospy.Subscriber("move_base_simple/goal", PoseStamped, self._on_goal, queue_size=1)
        rospy.Timer(rospy.Duration.from_sec(CHECKED), self._watch, reset=True)
        at_shutdown(self._close)

    def _close(self) -> None:
        with self._lock:
            if self._driving:
                self._send(Decision(0.0, 0.0))
            self._closed = True

    def _send(self, decision: Decision) -> None:
        if self._closed:
            return
        message = Twist()
        if math.isfinite(decision.linear) and math.isfinite(decision.angular):
            message.linear.x, message.angular.z = decision.linear, decision.angular
        else:
            rospy.logerr_throttle(5.0, "the robot stops: %s gives the command (%s, %s)" % (
                self._values["method"], decision.linear, decision.angular))
        self._publisher.publish(message)

    def _begin(self, x: float, y: float) -> None:
        self._method.begin(np.array([x, y]))
        self._driving, self.outcome = True, RUNNING
        rospy.loginfo("goal (%.2f, %.2f) in %s, by %s", x, y, self._frame, self._values["method"])

    def _on_goal(self, message: PoseStamped) -> None:
        position, source = message.pose.position, message.header.frame_id.lstrip("/")
        try:
            if not (math.isfinite(position.x) and math.isfinite(position.y)):
                raise ValueError("its position is ({}, {}); expected finite numbers".format(position.x, position.y))
            x, y = position.x, position.y
            if source not in ("", self._frame):
                at = self._transforms.pose(self._frame, source)
                cosine, sine = math.cos(at[2]), math.sin(at[2])
                x, y = at[0] + cosine * x - sine * y, at[1] + sine * x + cosine * y
        except (ValueError, TransformError) as error:
            rospy.logwarn("the goal on %s is refused: %s", self._goal.resolved_name, error)
            return
        with self._lock:
            self._begin(float(x), float(y))

    def _on_odometry(self, message: Odometry) -> None:
        try:
            fault = fault_of(message.header)
            if fault:
                raise ValueError(fault)
            pose, speed = planar_pose(message)
        except ValueError as error:
            rospy.logwarn_throttle(5.0, "odometry is refused: %s" % error)
            return
        with self._lock:
            self._frame = message.header.frame_id.lstrip("/") or "odom"
            self._speed = speed
            self._arrived["odom"] = rospy.get_time()
            self._history.add(message.header.stamp.to_sec(), pose)

    def _on_scan(self, message: LaserScan) -> None:
        fault = beams_fault(message)
        if fault:
            rospy.logwarn_throttle(5.0, "a scan on %s is refused: %s" % (self._scan.resolved_name, fault))
            return
        with self._lock:
            self._arrived["scan"] = rospy.get_time()
            stamp = message.header.stamp.to_sec()
            pose = self._history.at(stamp)
            if not self._driving or pose is None or self._stale():
                return
            decision = self._method.step(Sensing(stamp, pose, self._speed, message.ranges, message.angle_min,
                                                 message.angle_increment))
            self._send(decision)
            if decision.outcome != RUNNING:
                self._end(decision)

    def _end(self, decision: Decision) -> None:
        self._driving, self.outcome = False, decision.outcome
        log = rospy.loginfo if decision.outcome == REACHED else rospy.logwarn
        log("%s: %s", decision.outcome, decision.reason)
        if self._values["exit_on_goal"]:
            rospy.signal_shutdown(decision.outcome)

    def _stale(self) -> str:
        """Return what did not arrive for too long, or an empty text."""
        now = rospy.get_time()
        return " and ".join(name for name, at in sorted(self._arrived.items()) if now - at > STALE)

    def _watch(self, _: Optional[Any]) -> None:
        """Stop the robot while scans or odometry do not arrive."""
        with self._lock:
            missing = self._stale() if self._driving else ""
            if missing:
                self._send(Decision(0.0, 0.0))
        if missing:
            names = ", ".join(rospy.resolve_name(name) for name in missing.split(" and "))
            rospy.logwarn_throttle(5.0, "the robot stops: nothing on %s for %.1f s" % (names, STALE))


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("method")
    given = dict(rospy.get_param("~", {}) or {})
    name = given.get("method", PARAMETERS["method"].default)
    try:
        kind = registry.find(registry.METHODS, str(name))
    except registry.UnknownPluginError as error:
        rospy.logfatal("parameter %s: %s", rospy.resolve_name("~method"), error)
        return 1
    table = dict(kind.PARAMETERS, **PARAMETERS)
    values, warnings = read(table, given, rospy.get_name())
    for warning in warnings + unknown(given, table, rospy.get_name()):
        rospy.logwarn("%s", warning)
    try:
        method = kind({key: values[key] for key in kind.PARAMETERS}, robot_body())
    except ValueError as error:
        rospy.logfatal("%s", error)
        return 1
    node = MethodNode(values, method)
    rospy.spin()
    return 0 if not values["exit_on_goal"] or node.outcome == REACHED else 1
