# SPDX-License-Identifier: BSD-3-Clause
"""The node: ``collision`` is true whenever the robot has collided."""
from __future__ import annotations

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Bool

from collision_topic.collisions import Collisions
from m2wr_node.ros.starting import start_node

_STATUS = "m2wr_sim: simulation"
_ROBOT = "jackal"


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("collision_publisher_node")
    robot = str(rospy.get_param("~robot", _ROBOT))
    collisions, publisher = Collisions(robot), rospy.Publisher("collision", Bool, queue_size=10)

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == _STATUS and collisions.update({value.key: value.value for value in status.values}):
                rospy.loginfo("%s has collided at %.2f s", robot, message.header.stamp.to_sec())
                publisher.publish(True)

    subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics, queue_size=10)
    rospy.spin()
    del subscriber
    return 0
