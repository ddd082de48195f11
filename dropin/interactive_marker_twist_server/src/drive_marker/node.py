# SPDX-License-Identifier: BSD-3-Clause
"""The node ``marker_server``: a marker in rviz; moving it sends ``~cmd_vel``."""
from __future__ import annotations

import math
from typing import Tuple

import rospy
from geometry_msgs.msg import Pose, Twist, Vector3
from interactive_markers.interactive_marker_server import InteractiveMarkerServer
from visualization_msgs.msg import InteractiveMarker, InteractiveMarkerControl, InteractiveMarkerFeedback

from drive_marker.velocity import ConfigurationError, Settings, read_settings
from m2wr_node.ros.starting import start_node

#: Axis -> quaternion x y z w that takes a control's x axis to it.
_TURNS = {"x": (1.0, 0.0, 0.0, 1.0), "y": (0.0, 0.0, 1.0, 1.0), "z": (0.0, 1.0, 0.0, 1.0)}


class MarkerServer:
    """Publishes the velocity for each movement of the marker, which springs back to the robot.

    Parameters
    ----------
    settings : Settings
    link : str
        Frame of the robot.
    robot : str
        Name of the robot, for the name of the marker.
    """

    def __init__(self, settings: Settings, link: str, robot: str) -> None:
        self._settings, self._name = settings, robot + "_twist_marker"
        self._port = rospy.Publisher("~cmd_vel", Twist, queue_size=1)
        self._server = InteractiveMarkerServer("twist_marker_server")
        marker = InteractiveMarker(name=self._name, description="twist controller for " + robot, scale=1.0)
        marker.header.frame_id = link
        for axis in sorted(settings.scales):
            marker.controls.append(_control("move_" + axis, axis, InteractiveMarkerControl.MOVE_AXIS))
        marker.controls.append(_control("rotate_z", "z", InteractiveMarkerControl.ROTATE_AXIS))
        self._server.insert(marker, self._on_feedback)
        self._server.applyChanges()

    def _on_feedback(self, feedback: InteractiveMarkerFeedback) -> None:
        position, turn = feedback.pose.position, feedback.pose.orientation
        place: Tuple[float, float, float] = position.x, position.y, position.z
        yaw = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))
        if not math.isfinite(sum(place) + yaw):
            rospy.logwarn_throttle(10.0, "a movement of the marker is ignored: its pose is not finite")
            return
        x, y, z, rate = self._settings.velocity(place, yaw)
        self._port.publish(Twist(Vector3(x, y, z), Vector3(0.0, 0.0, rate)))
        self._server.setPose(self._name, Pose())
        self._server.applyChanges()


def _control(name: str, axis: str, mode: int) -> InteractiveMarkerControl:
    control = InteractiveMarkerControl(name=name, interaction_mode=mode)
    turn = control.orientation
    length = math.sqrt(sum(value * value for value in _TURNS[axis]))
    turn.x, turn.y, turn.z, turn.w = (value / length for value in _TURNS[axis])
    return control


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("twist_marker_server")
    given = rospy.get_param("~", {})
    try:
        settings = read_settings(given if isinstance(given, dict) else {})
    except ConfigurationError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    server = MarkerServer(settings, str(rospy.get_param("~link_name", "base_link")),
                          str(rospy.get_param("~robot_name", "robot")))
    rospy.spin()
    del server
    return 0
