# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from m2wr_navigation.controllers import rollout_kernels as kernels


def test_a_roll_out_is_an_arc_that_begins_at_the_start():
    out = np.empty((1000, 3))
    kernels.roll_out(np.zeros(3), np.zeros(3), np.array([0.5, 0.0, 0.5]), np.full(3, np.inf), 2.0, 1000, out)
    np.testing.assert_array_equal(out[0], 0.0)
    np.testing.assert_allclose(out[-1], [math.sin(1.0), 1.0 - math.cos(1.0), 1.0], atol=3e-3)


def test_with_acceleration_the_velocity_rises():
    out = np.empty((1000, 3))
    kernels.roll_out(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0]), np.full(3, 0.5), 2.0, 1000, out)
    assert out[-1, 0] == pytest.approx(1.0, abs=0.01)       # 0.5 * 0.5 * 2^2


@pytest.mark.parametrize("sample, expected", [((0.5, 0.0, 0.0), 20), ((0.0, 0.0, 1.0), 10), ((0.0, 0.0, 0.0), 1)])
def test_poses_are_as_close_as_wanted(sample, expected):
    assert kernels.step_count(np.array(sample), 1.0, 0.025, 0.1, 1000) == expected


def test_added_costs_decide_between_equal_samples():
    costs, grids = np.zeros((80, 80), np.uint8), np.zeros((3, 80, 80), np.float32)
    samples = np.array([[0.2, 0.0, 0.1], [0.2, 0.0, -0.1]])
    settings = np.array([1.0, 0.025, 0.1, 1.0, 1.0, 0.0, 0.0, 0.01, 0.0, 0.0, 9.0, 0.0, 1.0, 1000.0, 0.0])
    for extra, best in (([1.0, 0.0], 1), ([0.0, 1.0], 0), ([0.0, 0.0], 0)):
        assert best == kernels.score_samples(
            samples, np.array(extra), np.zeros((3, 2)), np.zeros(3), np.zeros(3), np.full(3, np.inf), settings, costs,
            0.05, np.array([-2.0, -2.0]), np.array([[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1], [0.1, -0.1]]), grids,
            np.empty(2), np.empty(2, np.int64), np.empty((2, 2)))


@pytest.mark.parametrize("sample, steps", [
    ([0.0, 0.0, 0.0], 1), ([0.5, 0.0, 0.0], 20), ([0.0, 0.0, 1.0], 10), ([1e300, 0.0, 0.0], 100)])
def test_long_roll_outs_have_the_greatest_number_of_poses(sample, steps):
    assert kernels.step_count(np.array(sample), 1.0, 0.025, 0.1, 100) == steps
