# SPDX-License-Identifier: BSD-3-Clause
"""Setting this node's ROS time directly, without a subscription to /clock.

Need: the simulator makes the time, so it cannot subscribe to it; a controller in lockstep has the time of its turn, not
of the newest /clock.  rospy's ``_set_rostime`` also notifies at each call, even if no thread sleeps;
the difference in time is not measured yet.

Uses: ``rospy.rostime._rostime_current``, ``get_rostime_cond()`` (and ``_waiters`` of Python's Condition),
``set_rostime_initialized``; ``rospy.impl.simtime._clock_sub``.
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic); Python 3.11.
Without it: ``rospy.get_rostime()`` stays what plain rospy makes of it, wall time or /clock; one line in the log.
"""
from __future__ import annotations

import logging
from typing import Any

from rospy import rostime
from rospy.impl import simtime

log = logging.getLogger(__name__)

_condition = rostime.get_rostime_cond()         # the process has one
_counts_waiters = hasattr(_condition, "_waiters")           # otherwise each call notifies


def set_ros_time(stamp: Any) -> None:
    """Make ``stamp``, a rospy.Time, this node's ROS time, and wake threads that sleep in ROS time."""
    rostime._rostime_current = stamp
    _condition.acquire()
    try:
        if not _counts_waiters or _condition._waiters:     # usually no thread sleeps, and this comes with every step
            _condition.notify_all()
    finally:
        _condition.release()


def make_own_clock() -> None:
    """Make this node the source of its own ROS time: only :func:`set_ros_time` changes it from now on."""
    if not hasattr(rostime, "_rostime_current"):
        log.warning("this rospy has no rospy.rostime._rostime_current; ROS time in this node is not simulated time")
    rostime.set_rostime_initialized(True)
    subscriber = getattr(simtime, "_clock_sub", None)
    if subscriber is not None:
        subscriber.unregister()
        simtime._clock_sub = None
