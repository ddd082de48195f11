# SPDX-License-Identifier: BSD-3-Clause
"""The node: ``~raw_cmd_vel`` in, ``~smooth_cmd_vel`` out, feedback from ``~odometry`` or ``~robot_cmd_vel``."""
from __future__ import annotations

import math
import threading
from typing import Any

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from m2wr_node.ros.starting import start_node
from velocity_ramp.smoother import COMMANDS, ODOMETRY, ConfigurationError, Settings, Smoother, read_settings


class VelocitySmoother:
    """Publishes commands within the limits, at a rate of ROS time.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings) -> None:
        self._settings, self._smoother, self._lock = settings, Smoother(settings), threading.Lock()
        self._quiet = rospy.get_param("~quiet", False) is True
        self._output = rospy.Publisher("~smooth_cmd_vel", Twist, queue_size=1)
        self._subscribers = [rospy.Subscriber("~raw_cmd_vel", Twist, self._on_command, queue_size=1, tcp_nodelay=True)]
        if settings.robot_feedback == ODOMETRY:
            self._subscribers.append(rospy.Subscriber(
                "~odometry", Odometry, lambda message: self._on_feedback(message.twist.twist), queue_size=1))
        elif settings.robot_feedback == COMMANDS:
            self._subscribers.append(rospy.Subscriber("~robot_cmd_vel", Twist, self._on_feedback, queue_size=1))

    def _on_command(self, twist: Twist) -> None:
        if not _finite(twist):
            rospy.logwarn_throttle(10.0, "a command is ignored: linear.x %g, angular.z %g; expected finite numbers" % (
                twist.linear.x, twist.angular.z))
            return
        with self._lock:
            self._smoother.command(twist.linear.x, twist.angular.z, rospy.get_time())

    def _on_feedback(self, twist: Any) -> None:
        if _finite(twist):
            with self._lock:
                self._smoother.feedback(twist.linear.x, twist.angular.z)

    def run(self) -> None:
        """Publish until the node is shut down."""
        rate = rospy.Rate(self._settings.frequency, reset=True)
        while not rospy.is_shutdown():
            with self._lock:
                velocities, zeroed = self._smoother.step(rospy.get_time()), self._smoother.zeroed
            if zeroed and not self._quiet:
                rospy.logwarn("the commands on %s have stopped at linear.x %g, angular.z %g; the robot is stopped" % (
                    (self._subscribers[0].resolved_name,) + zeroed))
            try:
                if velocities is not None:
                    twist = Twist()
                    twist.linear.x, twist.angular.z = velocities
                    self._output.publish(twist)
                rate.sleep()
            except rospy.ROSException:          # at the shutdown
                break


def _finite(twist: Any) -> bool:
    return math.isfinite(twist.linear.x) and math.isfinite(twist.angular.z)


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("yocs_velocity_smoother")
    given = rospy.get_param("~", {})
    try:
        node = VelocitySmoother(read_settings(given if isinstance(given, dict) else {}))
    except ConfigurationError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    node.run()
    return 0
