# SPDX-License-Identifier: BSD-3-Clause
"""The node ``twist_mux``: topics, locks and diagnostics."""
from __future__ import annotations

import functools
import math
import threading
from typing import List

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist
from std_msgs.msg import Bool

from m2wr_node.ros.starting import start_node
from twist_choice.choice import Choice, ConfigurationError, Source, read_sources

_PERIOD = 1.0           # s of wall time between two diagnostics


class TwistMux:
    """Passes one of several velocity commands on to ``cmd_vel_out``.

    Parameters
    ----------
    choice : Choice
    """

    def __init__(self, choice: Choice) -> None:
        self._choice, self._lock = choice, threading.Lock()
        self._output = rospy.Publisher("cmd_vel_out", Twist, queue_size=1)
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=1)
        own = self._output.resolved_name
        for topic in choice.topics:
            if rospy.resolve_name(topic.topic) == own:
                raise ConfigurationError("%s listens to %s, which is also the output; remap cmd_vel_out" % (
                    topic.name, own))
        self._subscribers = [rospy.Subscriber(topic.topic, Twist, functools.partial(self._on_twist, topic),
                                              queue_size=1, tcp_nodelay=True) for topic in choice.topics]
        self._subscribers += [rospy.Subscriber(lock.topic, Bool, functools.partial(self._on_lock, lock),
                                               queue_size=1, tcp_nodelay=True) for lock in choice.locks]

    def _on_twist(self, topic: Source, twist: Twist) -> None:
        values = (twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y, twist.angular.z)
        if not all(map(math.isfinite, values)):
            rospy.logwarn_throttle(10.0, "a command on %s is ignored: (%g, %g, %g), (%g, %g, %g); expected finite "
                                   "numbers" % ((topic.topic,) + values))
            return
        with self._lock:
            if self._choice.passes(topic, rospy.get_time()):
                self._output.publish(twist)

    def _on_lock(self, lock: Source, message: Bool) -> None:
        with self._lock:
            self._choice.hear_lock(lock, message.data, rospy.get_time())

    def report(self) -> None:
        """Publish the state on ``/diagnostics``."""
        with self._lock:
            status = self._status(rospy.get_time())
        array = DiagnosticArray(status=[status])
        array.header.stamp = rospy.Time.now()
        self._diagnostics.publish(array)

    def _status(self, now: float) -> DiagnosticStatus:
        choice = self._choice
        chosen, strongest = choice.chosen(now), choice.lock_priority(now)
        values: List[KeyValue] = []
        for kind, sources, stopped, words in (("velocity", choice.topics, choice.masked, ("unmasked", "masked")),
                                              ("lock", choice.locks, choice.locked, ("free", "locked"))):
            for source in sources:
                values.append(KeyValue("%s %s" % (kind, source.name), "%s (listening to %s @ %gs with priority #%d)" % (
                    words[stopped(source, now)], source.topic, source.timeout, source.priority)))
        values.append(KeyValue("current priority", str(chosen.priority if chosen else 0)))
        values.append(KeyValue("current topic", chosen.topic if chosen else "none"))
        age = choice.age(chosen, now) if chosen else math.inf
        values.append(KeyValue("data age in [sec]", "%.3f" % age if age < math.inf else "no data"))
        return DiagnosticStatus(
            level=DiagnosticStatus.WARN if strongest else DiagnosticStatus.OK, name="%s: Twist mux status" % (
                rospy.get_name().lstrip("/")), hardware_id="none", values=values,
            message="a lock holds back priorities below %d" % strongest if strongest else "ok")


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("twist_mux")
    try:
        topics = rospy.get_param("~topics", None)
        if topics is None:
            raise ConfigurationError("the parameter %s is missing; load a file with a list of {name, topic, timeout, "
                                     "priority}" % rospy.resolve_name("~topics"))
        node = TwistMux(Choice(read_sources(topics, rospy.resolve_name("~topics")),
                               read_sources(rospy.get_param("~locks", []), rospy.resolve_name("~locks"))))
    except ConfigurationError as error:
        rospy.logfatal("%s", error)
        return 1
    while not rospy.is_shutdown():
        try:
            node.report()
        except rospy.ROSException:          # at the shutdown
            break
        rospy.rostime.wallsleep(_PERIOD)
    return 0
