# SPDX-License-Identifier: BSD-3-Clause
"""Warnings about missing scans, transforms and clock, with their usual publisher."""
from __future__ import annotations

from typing import TYPE_CHECKING, Collection, Iterable, Optional, Tuple

import rospy
from sensor_msgs.msg import LaserScan

if TYPE_CHECKING:
    from m2wr_maps.ros.scan_input import Intake

FIRST, PERIOD = 5.0, 10.0   # until the first warning, and between two [s], wall
APART = 10.0                # a larger difference of stamps means different clocks [s]


def warn_about_missing_inputs(intake: Intake, topic: str) -> None:
    """Warn while no scan has arrived on ``topic`` or simulated time is 0; returns when both have started.

    Parameters
    ----------
    intake : Intake
    topic : str
        Resolved name.
    """
    wait = FIRST
    while not rospy.is_shutdown():
        rospy.rostime.wallsleep(wait)
        wait = PERIOD
        timeless = not rospy.rostime.is_wallclock() and not rospy.get_time()
        if rospy.is_shutdown() or (intake.arrived and not timeless):
            return
        if timeless:
            rospy.logwarn("use_sim_time is set, but there is no message on %s yet: expected a simulation or rosbag "
                          "play --clock; no transform is published until then", rospy.resolve_name("/clock"))
        if intake.arrived:
            continue
        try:
            rospy.logwarn("%s", no_scan(topic, rospy.get_published_topics()))
        except (OSError, rospy.ROSException):
            continue


def no_scan(topic: str, published: Iterable[Tuple[str, str]]) -> str:
    """Return a message about missing scans.

    Parameters
    ----------
    topic : str
        Resolved name.
    published : iterable of (str, str)
        All published topics and their types.
    """
    kinds = dict(published)
    others = sorted(name for name, kind in kinds.items() if kind == LaserScan._type)
    if kinds.get(topic, LaserScan._type) != LaserScan._type:
        found = "its type is {}".format(kinds[topic])
    else:
        found = "its publisher sends nothing" if topic in kinds else "it has no publisher"
    return "no {} on {} yet, {}; topics with scans: {}{}".format(
        LaserScan._type, topic, found, ", ".join(others) or "none",
        ". Use one of them with scan:={}".format(others[0]) if others and topic not in others else "")


def usual_source(target: str, source: str, frames: Collection[str], newest: Optional[float], stamp: float,
                 parameter: str) -> str:
    """Return the usual publisher of a missing transform, or another reason; starts with a full stop, or is empty.

    Parameters
    ----------
    target, source : str
        Frames of the odometry, or the base, and of the laser.
    frames : collection of str
        All known frames.
    newest : float or None
        Newest time for which the transform is known, 0 for a static one, None if unknown [s].
    stamp : float
        Requested time [s].
    parameter : str
        ``odom_frame...`` or that of the base's frame, which says what ``target`` is.
    """
    if not frames:
        return ". Expected a robot or simulator that publishes its odometry, and robot_state_publisher"
    if target not in frames:
        return (". No node publishes {}, the value of the parameter {}: {}".format(target, parameter, (
            "expected the odometry of a driver or simulator" if parameter.startswith("odom_frame") else
            "expected the robot's frame to which the laser is connected")))
    if source not in frames:
        return (". No node publishes {}: expected robot_state_publisher with robot_description, or "
                "static_transform_publisher; the scans' frame may differ from the link's name".format(source))
    if newest is None:
        return (". Both are known, but not connected: robot_state_publisher connects the links of robot_description, "
                "odometry its frame and the base")
    if newest and abs(newest - stamp) > APART:
        return (". Transforms and scans are {:.1f} s apart: expected the same clock; is use_sim_time set for all nodes "
                "or for none?".format(abs(newest - stamp)))
    return ""
