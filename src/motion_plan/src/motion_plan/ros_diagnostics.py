# SPDX-License-Identifier: BSD-3-Clause
"""Diagnostics of the nodes on /diagnostics, once a second of wall time and only with a subscriber."""
from __future__ import annotations

import math
import threading
from collections import deque
from typing import TYPE_CHECKING, Callable, Deque, Dict, List, NamedTuple, Optional, Sequence, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

if TYPE_CHECKING:
    from motion_plan.planar_types import Command, Pose
    from motion_plan.ros_support import Senses

PERIOD = 1.0                    # s of wall time
#: A robot with a command to drive for this time [s of ROS time] that moved less than this [m, rad] is stuck.
STUCK_SECONDS, STUCK_DISTANCE, STUCK_TURN = 3.0, 0.02, 0.05
#: Commands below these [m/s, rad/s] count as zero.
LEAST_LINEAR, LEAST_ANGULAR = 0.02, 0.05
STALE = 1.0                     # s of ROS time; older messages are not used for driving


class Sample(NamedTuple):
    """Pose (x, y [m], yaw [rad]) and command (linear [m/s], angular [rad/s]) at a ROS time [s]."""

    time: float
    pose: Pose
    command: Command


class Report(NamedTuple):
    """Part of a node: whether it drives, {name: value}, and the message while it does not drive."""

    active: bool
    values: Dict[str, str]
    rest: str


class StuckWatch:
    """Detects a robot that does not follow a command to drive."""

    def __init__(self) -> None:
        self._samples: Deque[Sample] = deque(maxlen=64)

    def add(self, now: float, pose: Optional[Pose], command: Optional[Command]) -> None:
        """Add a sample.

        Parameters
        ----------
        now : float
            ROS time [s].
        pose : (float, float, float) or None
            x, y [m] and yaw [rad]; None if not known.
        command : (float, float) or None
            Linear [m/s] and angular [rad/s]; None if there is none.
        """
        if pose is None or command is None or (self._samples and now < self._samples[-1].time):
            self._samples.clear()
        if pose is not None and command is not None:
            self._samples.append(Sample(now, pose, command))

    def stuck(self) -> bool:
        """Return whether it had a command to drive during the last seconds but did not move."""
        if not self._samples:
            return False
        newest = self._samples[-1]
        recent = [sample for sample in self._samples if newest.time - sample.time <= STUCK_SECONDS + PERIOD]
        if newest.time - recent[0].time < STUCK_SECONDS:
            return False
        if any(abs(sample.command[0]) < LEAST_LINEAR and abs(sample.command[1]) < LEAST_ANGULAR for sample in recent):
            return False
        return all(math.hypot(sample.pose[0] - newest.pose[0], sample.pose[1] - newest.pose[1]) < STUCK_DISTANCE
                   and abs(math.remainder(sample.pose[2] - newest.pose[2], 2 * math.pi)) < STUCK_TURN
                   for sample in recent)


class Rates:
    """Messages per second of ROS time, between two calls."""

    def __init__(self) -> None:
        self._last: Optional[Tuple[float, Dict[str, int]]] = None

    def look(self, now: float, counts: Dict[str, int]) -> Dict[str, Optional[float]]:
        """Return the rate of each count since the last call [Hz]; None if no time has passed.

        Parameters
        ----------
        now : float
            ROS time [s].
        counts : dict
            Number of messages so far, by topic.
        """
        before, self._last = self._last, (now, dict(counts))
        if before is None or now <= before[0]:
            return {name: None for name in counts}
        return {name: (count - before[1].get(name, 0)) / (now - before[0]) for name, count in counts.items()}


def judge(report: Report, ages: Dict[str, Optional[float]], stuck: bool, missing: List[str]) -> Tuple[int, str]:
    """Return level and message.

    Parameters
    ----------
    report : Report
    ages : dict
        Age [s] of the newest message by topic, None without a message.
    stuck : bool
    missing : list of str
        Required topics without a message.
    """
    if not report.active:
        return DiagnosticStatus.OK, report.rest
    if missing:
        return DiagnosticStatus.ERROR, 'no message on %s' % ' and '.join(missing)
    old = ['%s (%.1f s)' % (topic, age) for topic, age in sorted(ages.items()) if age is not None and age > STALE]
    if old:
        return DiagnosticStatus.WARN, 'no new message on %s: stopped' % ' and '.join(old)
    if stuck:
        return DiagnosticStatus.WARN, 'stuck: the robot does not follow the command to drive'
    return DiagnosticStatus.OK, 'driving'


class Diagnostics:
    """Publishes the state of one node from a thread of its own.

    Parameters
    ----------
    name : str
        Of the node, for the status.
    senses : motion_plan.ros_support.Senses
    report : callable
        Returns a Report; called under ``senses.lock``.
    needed : sequence of str
        Required topics of the node, out of those that ``senses`` counts.
    command : callable, optional
        Returns the present command (linear, angular), or None.
    """

    def __init__(self, name: str, senses: Senses, report: Callable[[], Report], needed: Sequence[str],
                 command: Optional[Callable[[], Optional[Command]]] = None) -> None:
        self._name, self._senses, self._report, self._needed, self._command = name, senses, report, needed, command
        self._rates, self._watch = Rates(), StuckWatch()
        self._publisher = rospy.Publisher('/diagnostics', DiagnosticArray, queue_size=2)
        threading.Thread(target=self._run, name='diagnostics', daemon=True).start()

    def _run(self) -> None:
        while not rospy.is_shutdown():
            rospy.rostime.wallsleep(PERIOD)
            if not self._publisher.get_num_connections():
                continue
            try:
                self._publisher.publish(self.look())
            except rospy.ROSException:
                return          # shutting down

    def look(self) -> DiagnosticArray:
        """Return the present message."""
        senses, now = self._senses, rospy.get_time()
        with senses.lock:
            report = self._report()
            times = {topic: senses.odom_time if topic == '/odom' else senses.scan_time for topic in self._needed}
            counts, pose = {topic: senses.counts[topic] for topic in self._needed}, senses.pose
        command = self._command() if self._command is not None and report.active else None
        self._watch.add(now, pose, command)
        ages = {topic: None if times[topic] is None else max(0.0, now - times[topic]) for topic in self._needed}
        stuck = self._watch.stuck()
        level, message = judge(report, ages, stuck, [topic for topic, age in ages.items() if age is None])
        values: List[Tuple[str, object]] = [('active', report.active), ('stuck', stuck)]
        for topic, rate in sorted(self._rates.look(now, counts).items()):
            values.append(('%s [Hz]' % topic, 'unknown' if rate is None else '%.1f' % rate))
        for topic, age in sorted(ages.items()):
            values.append(('age of the newest on %s [s]' % topic, 'no message' if age is None else '%.2f' % age))
        if command is not None:
            values.append(('command', '%.2f m/s, %.2f rad/s' % tuple(command)))
        values += sorted(report.values.items())
        status = DiagnosticStatus(name='motion_plan: ' + self._name, hardware_id='', level=level, message=message,
                                  values=[KeyValue(str(key), str(value)) for key, value in values])
        array = DiagnosticArray(status=[status])
        array.header.stamp = rospy.get_rostime()
        return array
