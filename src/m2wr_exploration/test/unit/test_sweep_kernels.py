# SPDX-License-Identifier: BSD-3-Clause
"""Where a robot stops, and the gap between two outlines."""
import numpy as np
import pytest

from m2wr_exploration.team.sweep_kernels import least_gap, stopping_poses

SQUARE = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])


def test_braking_distance_is_the_closed_form():
    poses = stopping_poses(np.array([1.0, 2.0, np.pi / 2]), np.array([0.5, 0.0]), 0.1, np.array([1.0, 3.0]), 0.005)
    assert poses[0] == pytest.approx([1.0, 2.0, np.pi / 2])
    assert poses[-1] == pytest.approx([1.0, 2.0 + 0.05 + 0.125, np.pi / 2], abs=1e-3)       # v t + v^2 / 2 a


def test_a_turn_ends_after_its_braking_angle():
    poses = stopping_poses(np.zeros(3), np.array([0.0, -0.8]), 0.1, np.array([1.0, 3.0]), 0.005)
    assert poses[-1] == pytest.approx([0.0, 0.0, -0.08 - 0.64 / 6.0], abs=2e-3)


def test_a_robot_that_does_not_move_has_one_pose():
    assert len(stopping_poses(np.zeros(3), np.zeros(2), 0.0, np.array([1.0, 3.0]), 0.05)) == 1


@pytest.mark.parametrize("x, yaw, gap", [(1.3, 0.0, 0.3), (0.8, 0.0, -0.2), (1.3, np.pi / 4, 0.8 - np.sqrt(0.5))])
def test_gap_of_squares_is_the_closed_form(x, yaw, gap):
    found = least_gap(np.zeros((1, 3)), np.array([(x, 0.0, yaw)]), SQUARE, 1.0)
    assert found == pytest.approx(gap)


def test_gap_is_the_least_of_all_poses():
    first, second = np.array([(0.0, 0.0, 0.0), (0.4, 0.0, 0.0)]), np.array([(5.0, 0.0, 0.0), (1.6, 0.0, 0.0)])
    assert least_gap(first, second, SQUARE, 1.0) == pytest.approx(0.2)
    assert least_gap(first, second + 9.0, SQUARE, 1.0) == 1.0
