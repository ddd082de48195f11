# SPDX-License-Identifier: BSD-3-Clause
"""The pose of the robot at a time, and jumps of the pose."""
import math

import pytest

from motion_plan.pose_history import JUMP_DISTANCE, PoseHistory


def history(*entries):
    made = PoseHistory()
    for stamp, x in entries:
        made.add(stamp, (x, 0.0, 0.0))
    return made


def test_between_two_poses_it_is_interpolated():
    assert history((1.0, 0.0), (2.0, 1.0)).at(1.25) == pytest.approx((0.25, 0.0, 0.0))


@pytest.mark.parametrize('stamp, x, expected', [
    (1.05, 0.05, False), (1.05, JUMP_DISTANCE, False), (1.05, 0.5, True), (1.0, 0.5, True),
    (2.0, 1.0, False),      # lost messages: a robot can drive that far in a second
    (2.0, 5.0, True), (0.5, 5.0, False)])       # a stamp in the past is a reset of time, not a jump
def test_a_jump_is_what_no_robot_can_drive(stamp, x, expected):
    assert history((0.95, 0.0), (1.0, 0.0)).is_jump(stamp, (x, 0.0, math.pi)) is expected


def test_the_first_pose_is_no_jump():
    assert PoseHistory().is_jump(1.0, (9.0, 9.0, 0.0)) is False
