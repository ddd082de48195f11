# SPDX-License-Identifier: BSD-3-Clause
"""Poses of messages and as plain numbers, for what must start quickly: rospy is not imported here."""


def read_pose(pose):
    """Return ``(position, orientation)`` of a geometry_msgs/Pose."""
    return ((pose.position.x, pose.position.y, pose.position.z),
            (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w))


def write_pose(pose, position, orientation):
    """Fill a geometry_msgs/Pose."""
    pose.position.x, pose.position.y, pose.position.z = position
    pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
