# SPDX-License-Identifier: BSD-3-Clause
"""Converts between messages and the plain values that the rest of the package uses."""
from typing import Any, Iterable, Tuple

import rospy

from m2wr_sim.ros.pose_messages import read_pose, write_pose  # noqa: F401 (part of this module's interface)

_new_time, _Time = rospy.Time.__new__, rospy.Time


def stamp_of(now_ns: int) -> rospy.Time:
    """Return a simulated time [ns], not below 0, as a rospy.Time, to the nanosecond."""
    stamp = _new_time(_Time)            # without the constructor, whose checks take most of the time
    stamp.secs, stamp.nsecs = divmod(now_ns, 1000000000)
    return stamp


def read_vector(vector: Any) -> Tuple[float, float, float]:
    """Return a geometry_msgs/Vector3 as a tuple."""
    return (vector.x, vector.y, vector.z)


def all_finite(numbers: Iterable[float]) -> bool:
    """Return whether all numbers are finite."""
    return all(abs(number) < float("inf") for number in numbers)
