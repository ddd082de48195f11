# SPDX-License-Identifier: BSD-3-Clause
"""Covariance of the particles about the best one."""
import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.ros.pose_covariance import covariance

FLOOR = np.square(tuning.PARTICLES.covariance_floor)


def test_equal_particles_give_the_minimum_covariance():
    np.testing.assert_allclose(covariance(np.ones((4, 3)), np.full(4, 0.25), 2), np.diag(FLOOR))


def test_covariance_is_weighted_about_the_best_particle():
    poses = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.4, 0.1]])
    found = covariance(poses, np.array([0.5, 0.25, 0.25]), 0) - np.diag(FLOOR)
    np.testing.assert_allclose(found, [[0.01, 0, 0], [0, 0.04, 0.01], [0, 0.01, 0.0025]], atol=1e-12)


def test_headings_wrap_around_pi():
    found = covariance(np.array([[0, 0, 3.1], [0, 0, -3.1]]), np.array([0.5, 0.5]), 0) - np.diag(FLOOR)
    np.testing.assert_allclose(found[2, 2], 0.5 * (2 * np.pi - 6.2) ** 2)
