# SPDX-License-Identifier: BSD-3-Clause
"""Between messages and the plain values that the rest of the package works with."""
import rospy

from m2wr_sim.ros.pose_messages import read_pose, write_pose  # noqa: F401 (part of this module's interface)

_new_time, _Time = rospy.Time.__new__, rospy.Time


def stamp_of(now_ns):
    """Return a simulated time [ns], not below 0, as a rospy.Time, to the nanosecond."""
    stamp = _new_time(_Time)            # the constructor's checks cost more than all else that a stamp needs
    stamp.secs, stamp.nsecs = divmod(now_ns, 1000000000)
    return stamp


def read_vector(vector):
    """Return a geometry_msgs/Vector3 as a tuple."""
    return (vector.x, vector.y, vector.z)


def all_finite(numbers):
    """Tell whether all numbers are finite."""
    return all(abs(number) < float("inf") for number in numbers)
