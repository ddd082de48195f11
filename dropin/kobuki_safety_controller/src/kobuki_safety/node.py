# SPDX-License-Identifier: BSD-3-Clause
"""The node: ``~events/bumper``, ``~events/cliff`` and ``~events/wheel_drop`` in, ``~cmd_vel`` out."""
from __future__ import annotations

import math
import threading

import rospy
from geometry_msgs.msg import Twist
from kobuki_msgs.msg import BumperEvent, CliffEvent, WheelDropEvent
from std_msgs.msg import Empty

from kobuki_safety.reaction import BUMPER, CLIFF, WHEEL, Reaction
from m2wr_node.numbers import number
from m2wr_node.ros.starting import start_node

_RATE = 10.0                # Hz, of the commands
_LONGEST = 60.0             # s, of time_to_extend_bump_cliff_events


class SafetyController:
    """Commands the robot while a sensor is active.

    Parameters
    ----------
    extension : float
        So long the last command is repeated after the last event [s].
    """

    def __init__(self, extension: float) -> None:
        self._reaction, self._lock = Reaction(extension), threading.Lock()
        self._output = rospy.Publisher("~cmd_vel", Twist, queue_size=10)
        self._subscribers = [
            rospy.Subscriber("~events/bumper", BumperEvent, lambda event: self._note(
                BUMPER, event.bumper, event.state == BumperEvent.PRESSED), queue_size=10),
            rospy.Subscriber("~events/cliff", CliffEvent, lambda event: self._note(
                CLIFF, event.sensor, event.state == CliffEvent.CLIFF), queue_size=10),
            rospy.Subscriber("~events/wheel_drop", WheelDropEvent, lambda event: self._note(
                WHEEL, event.wheel, event.state == WheelDropEvent.DROPPED), queue_size=10),
            rospy.Subscriber("~enable", Empty, lambda _: self._enable(True), queue_size=10),
            rospy.Subscriber("~disable", Empty, lambda _: self._enable(False), queue_size=10),
            rospy.Subscriber("~reset", Empty, self._reset, queue_size=10)]

    def _note(self, kind: str, sensor: int, active: bool) -> None:
        with self._lock:
            self._reaction.event(kind, sensor, active, rospy.get_time())

    def _enable(self, enabled: bool) -> None:
        with self._lock:
            self._reaction.enabled = enabled
        rospy.loginfo("the safety controller is %s", "enabled" if enabled else "disabled")

    def _reset(self, _: Empty) -> None:
        with self._lock:
            self._reaction.reset()
        rospy.logwarn("the safety controller has forgotten all bumpers, cliffs and wheels")

    def run(self) -> None:
        """Publish until the node is shut down."""
        rate = rospy.Rate(_RATE, reset=True)
        while not rospy.is_shutdown():
            with self._lock:
                velocities = self._reaction.command(rospy.get_time())
            try:
                if velocities is not None:
                    twist = Twist()
                    twist.linear.x, twist.angular.z = velocities
                    self._output.publish(twist)
                rate.sleep()
            except rospy.ROSException:          # at the shutdown
                break


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("kobuki_safety_controller")
    given = rospy.get_param("~time_to_extend_bump_cliff_events", 0.0)
    extension = number(given)
    if extension is None or not math.isfinite(extension) or not 0.0 <= extension <= _LONGEST:
        rospy.logfatal("%s: time_to_extend_bump_cliff_events is %.60r; expected 0 to %g s", rospy.get_name(), given,
                       _LONGEST)
        return 1
    SafetyController(float(extension)).run()
    return 0
