# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from localization_room import room, scan, settings
from m2wr_navigation.localization.particle_filter import ParticleFilter

TRUE = np.array([1.2, 2.0, 0.7])


def started(**values):
    found = ParticleFilter(settings(**values), np.random.default_rng(4))
    found.start_at(TRUE, np.diag([0.04, 0.04, 0.02]))
    return found


def test_the_start_has_the_covariance_that_was_asked_for():
    particles = ParticleFilter(settings(max_particles=50000), np.random.default_rng(0))
    wanted = np.array([[0.3, 0.1, 0.0], [0.1, 0.2, 0.02], [0.0, 0.02, 0.05]])
    particles.start_at(TRUE, wanted)
    np.testing.assert_allclose(np.cov(particles.poses.T), wanted, atol=0.01)
    np.testing.assert_allclose(particles.poses.mean(axis=0), TRUE, atol=0.01)


def test_scans_and_draws_converge_to_the_truth():
    particles, grid = started(), room()
    for _ in range(6):
        particles.sense(scan(TRUE), grid)
        particles.resample(scan(TRUE), grid)
    cluster = particles.best_cluster()
    assert np.hypot(*(cluster.pose - TRUE)[:2]) < 0.05 and abs(cluster.pose[2] - TRUE[2]) < 0.03
    assert cluster.weight == pytest.approx(1.0)
    assert np.sqrt(np.diag(cluster.covariance)).max() < 0.1
    assert len(particles.poses) < 1000              # they agree, so few are enough


def test_anywhere_one_scan_puts_most_weight_at_the_truth():
    particles, grid = ParticleFilter(settings(), np.random.default_rng(1)), room()
    particles.start_anywhere(grid)
    assert len(particles.poses) == 5000 and np.ptp(particles.poses[:, 0]) > 5.0
    particles.sense(scan(TRUE), grid)
    near = np.hypot(*(particles.poses - TRUE)[:, :2].T) < 0.4
    assert particles.weights[near].sum() > 0.3


def test_a_worse_fit_adds_poses_where_the_scan_fits():
    particles, grid = started(max_particles=500), room()
    for _ in range(4):
        particles.sense(scan(TRUE), grid)
        particles.resample(scan(TRUE), grid)
    elsewhere = np.array([4.0, 1.0, -2.0])
    injected = []
    for _ in range(8):                              # the robot was carried away
        particles.sense(scan(elsewhere), grid)
        injected.append(particles.resample(scan(elsewhere), grid))
    assert max(injected) > 0
    assert np.hypot(*(particles.best_cluster().pose - elsewhere)[:2]) < 0.3


def test_without_rates_nothing_is_added():
    particles, grid = started(recovery_alpha_slow=0.0, recovery_alpha_fast=0.0), room()
    particles.sense(scan(TRUE), grid)
    for _ in range(5):
        particles.sense(scan(np.array([4.0, 1.0, -2.0])), grid)
        assert particles.resample(scan(TRUE), grid) == 0


def test_selective_resampling_waits_until_weights_differ():
    particles, grid = started(selective_resampling=True), room()
    poses = particles.poses
    assert particles.resample(scan(TRUE), grid) == 0 and particles.poses is poses
    particles.weights = np.zeros(len(poses))
    particles.weights[7] = 1.0
    particles.resample(scan(TRUE), grid)
    np.testing.assert_allclose(particles.poses.mean(axis=0), poses[7], atol=0.02)


def test_weights_stay_a_distribution_where_no_pose_is_likely():
    particles, grid = started(laser_model_type="likelihood_field_prob", laser_sigma_hit=0.001, laser_z_rand=0.0), room()
    particles.sense(scan(np.array([4.0, 1.0, -2.0])), grid)
    assert particles.weights.sum() == pytest.approx(1.0) and np.isfinite(particles.weights).all()


def test_equal_seeds_give_equal_particles():
    one, other = started(), started()
    for particles in (one, other):
        particles.move(np.zeros(3), np.array([0.3, 0.0, 0.1]))
        particles.sense(scan(TRUE), room())
        particles.resample(scan(TRUE), room())
    np.testing.assert_array_equal(one.poses, other.poses)


def test_few_particles_do_not_move_the_mean_by_chance():
    """Neither motion nor draws: along a wall nothing would bring it back."""
    particles, grid = started(max_particles=60, min_particles=60), room()
    before = particles.poses.mean(axis=0)
    particles.move(np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(particles.poses.mean(axis=0)[:2], before[:2], atol=1e-9)
    particles.weights = np.random.default_rng(1).random(60)
    particles.weights /= particles.weights.sum()
    before = (particles.weights[:, None] * particles.poses).sum(0)
    particles.resample(scan(TRUE), grid)
    np.testing.assert_allclose(particles.poses.mean(axis=0)[:2], before[:2], atol=1e-9)


def test_a_spread_cloud_is_no_measure_of_a_good_fit():
    """After a search of the whole map, the average begins when one place is left: else it stays low for minutes."""
    particles, grid = ParticleFilter(settings(), np.random.default_rng(1)), room()
    particles.start_anywhere(grid)
    particles.sense(scan(TRUE), grid)
    assert particles.slow == 0.0
    for _ in range(12):
        particles.resample(scan(TRUE), grid)
        particles.sense(scan(TRUE), grid)
        particles.best_cluster()
    assert particles.certain and particles.slow == pytest.approx(particles.fast, rel=0.1) and particles.slow > 0.6
