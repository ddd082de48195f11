# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from m2wr_navigation.localization.motion_kernels import move_differential, move_omnidirectional

ALPHAS = np.array([0.1, 0.02, 0.05, 0.03, 0.07])
COUNT = 200000


def cloud(kernel, heading, step, corrected, start=(0.0, 0.0, 0.0), alphas=ALPHAS):
    poses = np.tile(np.array(start), (COUNT, 1))
    kernel(poses, heading, np.array(step), alphas, corrected, np.random.default_rng(1).standard_normal((COUNT, 3)))
    return poses


@pytest.mark.parametrize("kernel", [move_differential, move_omnidirectional])
def test_without_noise_particles_move_as_odometry(kernel):
    # odometry heads north and drives 1 m north, then turns by 0.5; a particle that heads east drives east
    pose = np.array([[2.0, 3.0, 0.0]])
    kernel(pose, math.pi / 2, np.array([0.0, 1.0, 0.5]), np.zeros(5), True, np.ones((1, 3)))
    np.testing.assert_allclose(pose, [[3.0, 3.0, 0.5]], atol=1e-12)


@pytest.mark.parametrize("kernel", [move_differential, move_omnidirectional])
def test_headings_stay_wrapped(kernel):
    pose = np.array([[0.0, 0.0, 3.0]])
    kernel(pose, 3.0, np.array([0.0, 0.0, 1.0]), np.zeros(5), True, np.zeros((1, 3)))
    np.testing.assert_allclose(pose[0, 2], 4.0 - 2.0 * math.pi)


def test_corrected_differential_noise_is_that_of_the_book():
    poses = cloud(move_differential, 0.0, (1.0, 0.0, 0.0), True)
    assert np.std(poses[:, 0] - 1.0) == pytest.approx(math.sqrt(0.05), rel=0.05)        # alpha3 t^2
    assert np.std(poses[:, 2]) == pytest.approx(math.sqrt(2 * 0.02), rel=0.02)          # alpha2 t^2, twice


def test_original_noise_takes_variances_for_deviations():
    poses = cloud(move_differential, 0.0, (1.0, 0.0, 0.0), False)
    assert np.std(poses[:, 0]) == pytest.approx(0.05, rel=0.02)
    assert np.std(poses[:, 2]) == pytest.approx(math.sqrt(2.0) * 0.02, rel=0.02)


def test_driving_backwards_is_no_turn():
    backwards = cloud(move_differential, 0.0, (-1.0, 0.0, 0.0), True, alphas=np.array([10.0, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(backwards, np.tile([-1.0, 0.0, 0.0], (COUNT, 1)), atol=1e-9)


@pytest.mark.parametrize("corrected", [True, False])
def test_a_turn_about_an_axle_beside_the_frame_is_one_turn(corrected):
    """Its axle is 0.05 m behind the frame: the noise is that of a turn on the spot, and no way is added."""
    turn = 0.6
    step = 0.05 * (math.cos(turn) - 1.0), 0.05 * math.sin(turn), turn
    beside = cloud(move_differential, 0.0, step, corrected)
    on_it = cloud(move_differential, 0.0, (0.0, 0.0, turn), corrected)
    np.testing.assert_allclose(beside.mean(axis=0), step, atol=2e-3)
    np.testing.assert_allclose(beside.std(axis=0)[2], on_it.std(axis=0)[2], rtol=0.02)
    assert np.hypot(*beside.std(axis=0)[:2]) < 1.1 * np.hypot(*on_it.std(axis=0)[:2]) + 0.02


def test_a_real_way_to_the_side_has_the_noise_of_two_turns():
    """90 degrees, 1 m, 90 degrees back: no turn of the base explains it."""
    poses = cloud(move_differential, 0.0, (0.0, 1.0, 0.0), True, alphas=np.array([0.1, 0.0, 0.0, 0.0, 0.0]))
    assert np.std(poses[:, 2]) == pytest.approx(math.sqrt(2.0 * 0.1) * math.pi / 2, rel=0.3)


@pytest.mark.parametrize("corrected, along, across, turning", [
    (True, math.sqrt(0.05), math.sqrt(0.07), math.sqrt(0.02)), (False, 0.05, 0.07, 0.02)])
def test_omnidirectional_noise_of_a_straight_way(corrected, along, across, turning):
    poses = cloud(move_omnidirectional, 0.0, (1.0, 0.0, 0.0), corrected)
    assert np.std(poses[:, 0]) == pytest.approx(along, rel=0.02)
    assert np.std(poses[:, 1]) == pytest.approx(across, rel=0.02)
    assert np.std(poses[:, 2]) == pytest.approx(turning, rel=0.02)


@pytest.mark.parametrize("corrected, along, across, turning", [
    (True, math.sqrt(0.03), math.sqrt(0.03), math.sqrt(0.1)), (False, 0.1, 0.1, 0.03)])
def test_omnidirectional_noise_of_a_turn(corrected, along, across, turning):
    poses = cloud(move_omnidirectional, 0.0, (0.0, 0.0, 1.0), corrected)
    assert np.std(poses[:, 0]) == pytest.approx(along, rel=0.02)
    assert np.std(poses[:, 1]) == pytest.approx(across, rel=0.02)
    assert np.std(poses[:, 2] - 1.0) == pytest.approx(turning, rel=0.02)
