# SPDX-License-Identifier: BSD-3-Clause
"""Between messages and the plain values that the rest of the package works with."""
import rospy
from rospy import rostime

from m2wr_sim.ros.pose_messages import read_pose, write_pose  # noqa: F401 (part of this module's interface)

_condition = rostime.get_rostime_cond()         # the one of the process
_new_time, _Time = rospy.Time.__new__, rospy.Time


def stamp_of(now_ns):
    """Return a simulated time [ns], not below 0, as a rospy.Time, to the nanosecond."""
    stamp = _new_time(_Time)            # the constructor's checks cost more than all else that a stamp needs
    stamp.secs, stamp.nsecs = divmod(now_ns, 1000000000)
    return stamp


def set_ros_time(stamp):
    """Make ``stamp`` this node's own ROS time and wake whoever sleeps in it, as a subscription to /clock would."""
    rostime._rostime_current = stamp
    _condition.acquire()
    try:
        if _condition._waiters:                 # for the most part nobody sleeps, and this is done with every clock
            _condition.notify_all()
    finally:
        _condition.release()


def read_vector(vector):
    """Return a geometry_msgs/Vector3 as a tuple."""
    return (vector.x, vector.y, vector.z)


def all_finite(numbers):
    """Tell whether all numbers are finite."""
    return all(abs(number) < float("inf") for number in numbers)
