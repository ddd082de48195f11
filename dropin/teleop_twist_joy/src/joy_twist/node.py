# SPDX-License-Identifier: BSD-3-Clause
"""The node ``teleop_node``: ``joy`` in, ``cmd_vel`` out."""
from __future__ import annotations

import math

import rospy
from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Joy

from joy_twist.mapping import ConfigurationError, Teleop, read_mapping
from m2wr_node.ros.starting import start_node


class TeleopNode:
    """Publishes what :class:`~joy_twist.mapping.Teleop` answers.

    Parameters
    ----------
    teleop : Teleop
    """

    def __init__(self, teleop: Teleop) -> None:
        self._teleop = teleop
        self._output = rospy.Publisher("cmd_vel", Twist, queue_size=1, latch=True)
        self._subscriber = rospy.Subscriber("joy", Joy, self._on_joy, queue_size=1, tcp_nodelay=True)

    def _on_joy(self, message: Joy) -> None:
        if not all(map(math.isfinite, message.axes)):
            rospy.logwarn_throttle(10.0, "a message on %s is ignored: an axis is not finite; expected numbers from -1 "
                                   "to 1" % self._subscriber.resolved_name)
            return
        values = self._teleop.answer(message.axes, message.buttons)
        if values is not None:
            self._output.publish(Twist(Vector3(*values[:3]), Vector3(*values[3:])))


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("teleop_twist_joy_node")
    given = rospy.get_param("~", {})
    try:
        node = TeleopNode(Teleop(read_mapping(given if isinstance(given, dict) else {})))
    except ConfigurationError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    rospy.spin()
    del node
    return 0
