# SPDX-License-Identifier: BSD-3-Clause
"""The node: a topic for each source, ``~output``, and ``~active`` with the name of the source that drives."""
from __future__ import annotations

import functools
import math
import threading
from typing import List, Optional, Tuple

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import String

from cmd_vel_choice.selection import LONGEST, ConfigurationError, Selection, Source, read_sources
from m2wr_node.ros.starting import start_node

_PERIOD = 0.05          # s of wall time between two looks whether the source that drives has expired
_IDLE = "idle"


class VelocityMux:
    """Passes one of several velocity commands on.

    Parameters
    ----------
    sources : list of Source
    output : str
        Topic of the commands that pass, in the namespace of the node if it is relative.

    Raises
    ------
    ConfigurationError
        If the output is the topic of a source, too.
    """

    def __init__(self, sources: List[Source], output: str) -> None:
        self._selection, self._lock = Selection(), threading.Lock()
        self._told: Optional[str] = None
        self._output = rospy.Publisher(_private(output), Twist, queue_size=10)
        self._active = rospy.Publisher("~active", String, queue_size=1, latch=True)
        for source in sources:
            if rospy.resolve_name(_private(source.topic)) == self._output.resolved_name:
                raise ConfigurationError("%s listens to %s, which is also the output" % (
                    source.name, self._output.resolved_name))
        self._subscribers = [rospy.Subscriber(_private(source.topic), Twist, functools.partial(self._on_twist, source),
                                              queue_size=10, tcp_nodelay=True) for source in sources]

    def _on_twist(self, source: Source, twist: Twist) -> None:
        values = (twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y, twist.angular.z)
        if not all(map(math.isfinite, values)):
            rospy.logwarn_throttle(10.0, "a command of %s is ignored: (%g, %g, %g), (%g, %g, %g); expected finite "
                                   "numbers" % ((source.name,) + values))
            return
        with self._lock:
            if self._selection.passes(source, rospy.get_time()):
                self._tell()
                self._output.publish(twist)

    def look(self) -> None:
        """Publish who drives, if that has changed."""
        with self._lock:
            self._selection.expire(rospy.get_time())
            self._tell()

    def _tell(self) -> None:
        active = self._selection.active
        name = active.name if active is not None else _IDLE
        if name != self._told:
            self._told = name
            self._active.publish(name)


def _private(topic: str) -> str:
    return topic if topic[0] in "/~" else "~" + topic


def _configuration() -> Tuple[str, str]:
    """Return the text of the file that ``~yaml_cfg_file`` names, and its path."""
    path, parameter = rospy.get_param("~yaml_cfg_file", None), rospy.resolve_name("~yaml_cfg_file")
    if not isinstance(path, str) or not path:
        raise ConfigurationError("the parameter %s is %r; expected the path of a YAML file" % (parameter, path))
    try:
        with open(path, encoding="utf-8") as stream:
            return stream.read(LONGEST + 1), path
    except (OSError, ValueError) as error:
        raise ConfigurationError("%s: %s cannot be read: %s" % (parameter, path, error)) from None


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("yocs_cmd_vel_mux")
    try:
        node = VelocityMux(*read_sources(*_configuration()))
    except ConfigurationError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    while not rospy.is_shutdown():
        try:
            node.look()
        except rospy.ROSException:          # at the shutdown
            break
        rospy.rostime.wallsleep(_PERIOD)
    return 0
