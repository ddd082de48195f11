# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from m2wr_maps.se2 import compose
from m2wr_navigation.base_velocity import JUDGED, SILENT, BaseVelocity

PERIOD = 0.05


def arc(velocity, time):
    """Pose after a time at constant velocity (v, omega) from (1, 2, 3)."""
    forward, turn = velocity
    if not turn:
        return compose([1.0, 2.0, 3.0], [forward * time, 0.0, 0.0])
    return compose([1.0, 2.0, 3.0], [forward / turn * math.sin(turn * time),
                                     forward / turn * (1.0 - math.cos(turn * time)), turn * time])


def run(found, velocity, told, duration, start=0.0):
    """Poses of an arc, and messages with ``told`` (None: none); returns the velocities."""
    out = []
    for k in range(int(round(duration / PERIOD))):
        now = start + k * PERIOD
        found.take_pose(now, arc(velocity, now))
        if told is not None:
            found.take_message(now, np.array(told, float))
        out.append(found.velocity(now))
    return np.array(out)


@pytest.mark.parametrize("velocity", [(0.5, 0.0), (0.3, 0.8), (-0.2, -1.5), (0.0, 1.0)])
def test_without_messages_tf_gives_the_velocity(velocity):
    found = BaseVelocity()
    last = run(found, velocity, None, 1.0)[-1]
    assert last == pytest.approx([velocity[0], 0.0, velocity[1]], abs=0.01)
    assert found.by_poses == "sends nothing"


def test_messages_that_tell_the_motion_are_used():
    found = BaseVelocity()
    told = (0.52, 0.0, 0.31)
    assert (run(found, (0.5, 0.3), told, 5.0) == told).all()
    assert found.by_poses == ""


@pytest.mark.parametrize("told", [(0.0, 0.0, 0.0), (-0.5, 0.0, 0.3), (0.5, 0.0, -0.3), (0.0, 0.5, 0.3)])
def test_messages_without_the_velocity_are_replaced(told):
    found = BaseVelocity()
    seen = run(found, (0.5, 0.3), told, 3.0)
    assert seen[int(0.5 * JUDGED / PERIOD)] == pytest.approx(told)
    assert seen[-1] == pytest.approx([0.5, 0.0, 0.3], abs=0.01)
    assert found.by_poses == "does not tell the velocity of the base"


def test_at_rest_messages_are_not_judged():
    found = BaseVelocity()
    run(found, (0.0, 0.0), (0.0, 0.0, 0.0), 10.0)
    assert found.by_poses == ""


def test_messages_that_are_right_again_are_used_again():
    found = BaseVelocity()
    run(found, (0.5, 0.0), (0.0, 0.0, 0.0), 3.0)
    assert found.by_poses
    run(found, (0.5, 0.0), (0.5, 0.0, 0.0), 3.0, 3.0)
    assert found.by_poses == ""


def test_messages_that_stop_are_replaced():
    found = BaseVelocity()
    run(found, (0.5, 0.0), (0.5, 0.0, 0.0), 1.0)
    last = run(found, (0.2, 0.0), None, 2.0 * SILENT, 1.0)[-1]
    assert found.by_poses == "is silent" and last[0] == pytest.approx(0.2, abs=0.01)


def test_a_clock_that_goes_back_begins_again():
    found = BaseVelocity()
    run(found, (0.5, 0.0), None, 1.0, 100.0)
    assert run(found, (0.1, 0.0), None, 1.0)[-1] == pytest.approx([0.1, 0.0, 0.0], abs=0.01)


def test_one_pose_or_old_ones_are_no_velocity():
    found = BaseVelocity()
    found.take_pose(0.0, np.zeros(3))
    assert not found.velocity(0.0).any()
    found.take_pose(5.0, np.array([3.0, 0.0, 0.0]))
    assert not found.velocity(5.0).any()
