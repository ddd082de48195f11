# SPDX-License-Identifier: BSD-3-Clause
"""Saying what is missing while nothing comes of a run, and who usually brings it."""
import rospy
from sensor_msgs.msg import LaserScan

FIRST, PERIOD = 5.0, 10.0   # until the first warning, and between two [s], wall
APART = 10.0                # clocks of transforms and scans that much apart are two clocks [s]


def warn_about_missing_inputs(intake, topic):
    """Warn as long as no scan has come on ``topic``, or simulated time has not begun; returns when both have."""
    wait = FIRST
    while not rospy.is_shutdown():
        rospy.rostime.wallsleep(wait)
        wait = PERIOD
        timeless = not rospy.rostime.is_wallclock() and not rospy.get_time()
        if rospy.is_shutdown() or (intake.arrived and not timeless):
            return
        if timeless:
            rospy.logwarn("use_sim_time is set, but no time has come on %s yet: expected a simulation or rosbag play "
                          "--clock; no transform is published until then", rospy.resolve_name("/clock"))
        if intake.arrived:
            continue
        try:
            rospy.logwarn("%s", no_scan(topic, rospy.get_published_topics()))
        except (OSError, rospy.ROSException):
            continue


def no_scan(topic, published):
    """Return a sentence on scans that do not come on ``topic``; ``published`` are (topic, type) of all there are."""
    kinds = dict(published)
    others = sorted(name for name, kind in kinds.items() if kind == LaserScan._type)
    if kinds.get(topic, LaserScan._type) != LaserScan._type:
        found = "what is published there is a {}".format(kinds[topic])
    else:
        found = "its publisher is silent" if topic in kinds else "nobody publishes it"
    return "no {} on {} yet, {}; topics with scans: {}{}".format(
        LaserScan._type, topic, found, ", ".join(others) or "none",
        ". One of them is taken with scan:={}".format(others[0]) if others and topic not in others else "")


def usual_source(target, source, frames, newest, stamp, parameter):
    """Return who usually brings a transform that is missing, or what else is amiss; begins with a full stop, or empty.

    Parameters
    ----------
    target, source : str
        Frames of the odometry, or the base, and of the laser.
    frames : set of str
        All that are known.
    newest : float or None
        The newest time for which the transform is known, 0 where it holds at all times, None where for none [s].
    stamp : float
        The time for which it is wanted [s].
    parameter : str
        ``odom_frame`` or ``base_frame``, which says what ``target`` is.
    """
    if not frames:
        return ". Expected a robot or simulator that publishes its odometry, and robot_state_publisher"
    if target not in frames:
        return (". Nobody publishes {}, which the parameter {} names: {}".format(target, parameter, (
            "the odometry of a robot's driver or simulator would" if parameter == "odom_frame" else
            "expected the robot's frame that the laser is joined to")))
    if source not in frames:
        return (". Nobody says where {} sits: robot_state_publisher would, from robot_description, or "
                "static_transform_publisher; or scans and robot_description call it by two names".format(source))
    if newest is None:
        return (". Both are known, but nothing joins them: robot_state_publisher joins the links of robot_description, "
                "odometry its frame and the base")
    if newest and abs(newest - stamp) > APART:
        return (". Transforms and scans are {:.1f} s apart: expected the same clock; is use_sim_time set for all nodes "
                "or for none?".format(abs(newest - stamp)))
    return ""
