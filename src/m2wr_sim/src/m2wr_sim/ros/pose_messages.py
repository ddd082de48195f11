# SPDX-License-Identifier: BSD-3-Clause
"""Poses of messages as plain numbers; rospy is not imported, for programs that must start quickly."""
from typing import Any, Sequence, Tuple


def read_pose(pose: Any) -> Tuple[Tuple[float, float, float], Tuple[float, float, float, float]]:
    """Return ``(position, orientation)`` of a geometry_msgs/Pose."""
    return ((pose.position.x, pose.position.y, pose.position.z),
            (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w))


def write_pose(pose: Any, position: Sequence[float], orientation: Sequence[float]) -> None:
    """Fill a geometry_msgs/Pose.

    Parameters
    ----------
    pose : geometry_msgs.msg.Pose
    position : sequence of 3 floats
        x, y, z [m].
    orientation : sequence of 4 floats
        Quaternion x, y, z, w.
    """
    pose.position.x, pose.position.y, pose.position.z = position
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
