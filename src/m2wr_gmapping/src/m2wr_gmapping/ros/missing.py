"""Saying what is missing while nothing comes of a run."""
import rospy
from sensor_msgs.msg import LaserScan

PERIOD = 10.0               # between two warnings [s], wall


def name_what_is_missing(intake, topic):
    """Warn as long as no scan has come on ``topic``, or simulated time has not begun; returns when both have."""
    while not rospy.is_shutdown():
        rospy.rostime.wallsleep(PERIOD)
        timeless = not rospy.rostime.is_wallclock() and not rospy.get_time()
        if rospy.is_shutdown() or (intake.arrived and not timeless):
            return
        if timeless:
            rospy.logwarn("use_sim_time is set, but no time has come on %s yet: expected a simulation or rosbag play "
                          "--clock; no transform is published until then", rospy.resolve_name("/clock"))
        if intake.arrived:
            continue
        try:
            others = sorted(name for name, kind in rospy.get_published_topics() if kind == LaserScan._type)
        except (OSError, rospy.ROSException):
            continue
        rospy.logwarn("no scan on %s yet; topics with scans: %s", topic, ", ".join(others) or "none")
