# SPDX-License-Identifier: BSD-3-Clause
"""Poses from other frames, without tf: the transform is an argument."""
import math

import pytest
from geometry_msgs.msg import Pose

from motion_plan.ros_poses import PoseError, moved_by, planar, planar_in


def pose(x=1.0, y=2.0, yaw=0.5):
    made = Pose()
    made.position.x, made.position.y = x, y
    made.orientation.z, made.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return made


def no_tf(target, source):
    raise AssertionError('tf was asked for %s in %s' % (source, target))


@pytest.mark.parametrize('frame', ['odom', '/odom', ''])
def test_a_pose_in_its_own_frame_or_without_one_is_unchanged(frame):
    assert planar_in('odom', frame, pose(), no_tf) == pytest.approx((1.0, 2.0, 0.5))


def test_from_another_frame_it_is_translated_and_rotated():
    asked = []

    def transform(target, source):
        asked.append((target, source))
        return 10.0, 20.0, math.pi / 2

    assert planar_in('odom', '/map', pose(), transform) == pytest.approx((8.0, 21.0, 0.5 + math.pi / 2))
    assert asked == [('odom', 'map')]


def test_there_and_back_is_where_it_was():
    there, back = (3.0, -1.0, 2.0), (-3.0 * math.cos(2.0) + math.sin(2.0), 3.0 * math.sin(2.0) + math.cos(2.0), -2.0)
    assert moved_by(back, moved_by(there, (0.7, 0.3, -3.0))) == pytest.approx((0.7, 0.3, -3.0))


@pytest.mark.parametrize('bad', [pose(x=math.nan), pose(y=math.inf), pose(yaw=math.nan)])
def test_numbers_that_are_not_finite_are_named(bad):
    with pytest.raises(PoseError, match='finite'):
        planar_in('odom', 'odom', bad, no_tf)


def test_an_all_zero_quaternion_means_no_rotation():
    assert planar(Pose()) == (0.0, 0.0, 0.0)
