# SPDX-License-Identifier: BSD-3-Clause
"""The odometry motion model."""

import numpy as np
import pytest

from m2wr_gmapping.filter.motion_model import MotionNoise, sample_motion
from m2wr_maps.se2 import between


def test_motion_noise_follows_the_step():
    noise = MotionNoise(0.1, 0.2, 0.3, 0.4)
    assert np.allclose(noise.deviations([1.0, 0.0, 0.0]), [0.1, 0.03, 0.2])
    assert np.allclose(noise.deviations([0.0, 0.0, -2.0]), [0.6, 0.6, 0.8])
    assert np.allclose(noise.deviations([0.0, 0.0, 0.0]), 0.0)


def test_samples_have_the_mean_and_deviation_of_the_model():
    noise, step = MotionNoise(0.1, 0.05, 0.02, 0.1), np.array([0.5, 0.1, 0.3])
    normals = np.random.default_rng(1).standard_normal((200000, 3))
    poses = sample_motion(np.tile([1.0, 2.0, 0.7], (200000, 1)), step, noise, normals)
    moved = between(np.array([1.0, 2.0, 0.7]), poses)
    assert np.allclose(moved.mean(axis=0), step, atol=1e-3)
    assert np.allclose(moved.std(axis=0), noise.deviations(step), rtol=0.02)


def test_bad_steps_are_refused():
    with pytest.raises(ValueError, match="not finite"):
        sample_motion(np.zeros((2, 3)), [np.inf, 0, 0], MotionNoise(), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="one row"):
        sample_motion(np.zeros((2, 3)), [0, 0, 0], MotionNoise(), np.zeros((3, 3)))
