# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses in kernels are those of ``se2``."""
import math

import numpy as np
import pytest

from m2wr_maps import pose_kernels, se2


@pytest.mark.parametrize("angle", [0.0, 3.0, -3.0, math.pi, -math.pi, 7.5, -20.0])
def test_angle_is_wrapped(angle):
    found = pose_kernels.wrapped(angle)
    assert -math.pi <= found < math.pi
    assert math.isclose(math.cos(found), math.cos(angle)) and found == se2.wrap(angle)


@pytest.mark.parametrize("seed", range(5))
def test_poses_equal_those_of_arrays(seed):
    a, b = np.random.default_rng(seed).uniform(-4.0, 4.0, (2, 3))
    out = np.empty(3)
    pose_kernels.compose(a, b, out)
    np.testing.assert_allclose(out, se2.compose(a, b), atol=1e-12)
    np.testing.assert_allclose(pose_kernels.between(a, b), se2.between(a, b), atol=1e-12)


def test_result_may_replace_an_argument():
    a, b = np.array([1.0, 2.0, 0.5]), np.array([-1.0, 0.5, 3.0])
    wanted = se2.compose(a, b)
    pose_kernels.compose(a, b, b)
    np.testing.assert_allclose(b, wanted, atol=1e-12)


@pytest.mark.parametrize("motion, found", [
    ((0.1, 0.2, 0.3), False), ((0.11, 0.0, 0.0), True), ((0.0, -0.21, 0.0), True), ((0.0, 0.0, -0.31), True)])
def test_motion_beyond_a_limit(motion, found):
    assert pose_kernels.exceeds(*motion, (0.1, 0.2, 0.3)) == found
