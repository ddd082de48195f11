# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from m2wr_navigation.localization import particle_kernels as kernels


@pytest.mark.parametrize("bins", [2, 10, 100])
def test_kld_count_is_that_of_the_formula(bins):
    b = 2.0 / (9.0 * (bins - 1))
    expected = (bins - 1) / 0.02 * (1.0 - b + math.sqrt(b) * 0.99) ** 3
    assert 0.0 <= kernels.kld_count(bins, 0.01, 0.99) - expected < 1.0


def test_one_bin_needs_one_particle():
    assert kernels.kld_count(1, 0.01, 0.99) == 1


def test_particles_in_one_bin_need_the_least_number():
    poses = np.tile([0.1, 0.1, 0.1], (5000, 1))
    assert kernels.adaptive_count(poses, 100, 0.01, 0.99) == 100


def test_spread_particles_need_all():
    rng = np.random.default_rng(0)
    poses = np.column_stack([rng.uniform(-20, 20, (5000, 2)), rng.uniform(-3, 3, 5000)])
    assert kernels.adaptive_count(poses, 100, 0.01, 0.99) == 5000


def test_systematic_draws_are_within_one_of_expectation():
    weights = np.random.default_rng(2).random(50)
    weights /= weights.sum()
    drawn = np.empty(1000, np.int64)
    kernels.draw_systematically(weights, 0.37, drawn)
    assert (np.abs(np.bincount(drawn, minlength=50) - 1000 * weights) < 1.0).all()


@pytest.mark.parametrize("start", [0.0, 0.999999])
def test_systematic_draws_of_few_particles_stay_inside(start):
    drawn = np.empty(3, np.int64)
    kernels.draw_systematically(np.array([0.0, 1.0, 0.0]), start, drawn)
    assert drawn.tolist() == [1, 1, 1]


def test_clusters_are_connected_bins_and_headings_wrap():
    poses = np.array([[0.1, 0.1, 3.1], [0.6, 0.6, -3.1], [5.0, 5.0, 0.0], [5.6, 5.4, 0.2], [9.0, 0.0, 0.0]])
    labels = np.empty(5, np.int64)
    assert kernels.label_clusters(poses, labels) == 3
    assert labels[0] == labels[1] and labels[2] == labels[3]
    assert len({labels[0], labels[2], labels[4]}) == 3


def test_far_and_negative_poses_have_bins_of_their_own():
    poses = np.array([[-4000.0, 4000.0, 0.0], [4000.0, -4000.0, 0.0], [-0.1, -0.1, 0.0], [0.1, 0.1, 0.0]])
    labels = np.empty(4, np.int64)
    assert kernels.label_clusters(poses, labels) == 3 and labels[2] == labels[3]


def test_moments_are_weighted_and_headings_wrap():
    rng = np.random.default_rng(1)
    poses = rng.multivariate_normal([2.0, -1.0, math.pi], np.diag([0.04, 0.01, 0.02]), 20000)
    poses[:, 2] = (poses[:, 2] + math.pi) % (2 * math.pi) - math.pi
    weights = rng.random(20000)
    mean, covariance = np.empty(3), np.empty((3, 3))
    labels = np.zeros(20000, np.int64)
    kernels.cluster_moments(poses, weights, labels, 0, mean, covariance)
    np.testing.assert_allclose(mean[:2], np.average(poses[:, :2], axis=0, weights=weights), atol=1e-9)
    assert abs(math.remainder(mean[2] - math.pi, 2 * math.pi)) < 0.01
    np.testing.assert_allclose(covariance, np.diag([0.04, 0.01, 0.02]), atol=2e-3)
