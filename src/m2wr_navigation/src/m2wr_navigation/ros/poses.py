# SPDX-License-Identifier: BSD-3-Clause
"""Poses of goals: checked, and transformed to the frame of the global costmap."""
from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import rospy

from m2wr_maps.ros.message_conversion import pose_message
from m2wr_maps.se2 import compose
from m2wr_navigation.ros.transforms import TransformError, yaw_of
from m2wr_node.ros.transform_buffer import fault_of, frame

if TYPE_CHECKING:
    from m2wr_navigation.ros.transforms import Transforms
    from m2wr_node.array_types import FloatArray

__all__ = ["GoalError", "goal_pose", "pose_message"]

PATIENCE = 0.5              # s of wall time in which tf may catch up with the stamp of a goal
PAUSE = 0.02                # s between two looks
LEAST_SQUARE = 1e-6         # squared length of a quaternion (move_base.cpp)
TILT = 1e-3                 # 1 - cosine of the angle between its z axis and the vertical (move_base.cpp)


class GoalError(ValueError):
    """A goal cannot be used; the text says why.

    Parameters
    ----------
    message : str
    quaternion : bool
        Whether its quaternion is the reason.
    """

    def __init__(self, message: str, quaternion: bool = False) -> None:
        super().__init__(message)
        self.quaternion = quaternion


def goal_pose(target: Any, into: str, transforms: Transforms) -> FloatArray:
    """Return x, y, yaw (3,) of a goal in another frame [m, m, rad].

    Parameters
    ----------
    target : geometry_msgs.msg.PoseStamped
    into : str
        Frame of the global costmap.
    transforms : Transforms

    Raises
    ------
    GoalError
    """
    position, turn = target.pose.position, target.pose.orientation
    numbers = (turn.x, turn.y, turn.z, turn.w)
    square = sum(number * number for number in numbers)
    if not (all(map(math.isfinite, numbers)) and square >= LEAST_SQUARE):
        raise GoalError("the goal has the quaternion {}; expected finite numbers and a length above 0.001".format(
            numbers), True)
    if abs(1.0 - 2.0 * (turn.x * turn.x + turn.y * turn.y) / square - 1.0) > TILT:
        raise GoalError("the goal has the quaternion {}, which is tilted; expected a rotation about z".format(
            numbers), True)
    if not (math.isfinite(position.x) and math.isfinite(position.y)):
        raise GoalError("the goal is at ({}, {}); expected finite numbers".format(position.x, position.y))
    fault = fault_of(target.header)
    if fault:
        raise GoalError("the goal is not used: " + fault)
    pose = np.array([position.x, position.y, yaw_of(turn)])
    source = frame(target.header.frame_id)
    if not source:
        raise GoalError("the goal has no frame; expected one such as {}".format(into))
    if source == into:
        return pose
    return compose(_transform(into, source, target.header.stamp, transforms), pose)


def _transform(into: str, source: str, stamp: rospy.Time, transforms: Transforms) -> FloatArray:
    """Return the transform (3,) at a stamp; if tf lags behind, the newest one."""
    deadline = time.monotonic() + PATIENCE
    while not stamp.is_zero():
        try:
            return transforms.pose(into, source, stamp)
        except TransformError:
            if time.monotonic() > deadline or rospy.is_shutdown():
                break
            time.sleep(PAUSE)
    try:
        return transforms.pose(into, source)
    except TransformError as error:
        raise GoalError("the goal is in frame {}: {}".format(source, error)) from error
