# SPDX-License-Identifier: BSD-3-Clause
"""The filter: model, Jacobian, corrections, and what odometry and an IMU give together."""
import math

import numpy as np
import pytest

from m2wr_navigation.fusion import ekf_kernels as kernels
from m2wr_navigation.fusion.ekf import PLANE, PROCESS_NOISE, Ekf, Measurement
from m2wr_navigation.fusion.sources import GRAVITY, Source, SourceSettings, angles_of, matrix_of

ZERO = np.zeros((15, 15))


def measure(stamp, variance=1e-4, threshold=math.inf, **values):
    names = "x y z roll pitch yaw vx vy vz vroll vpitch vyaw ax ay az".split()
    used, whole = np.zeros(15, dtype=bool), np.zeros(15)
    for name, value in values.items():
        used[names.index(name)], whole[names.index(name)] = True, value
    return Measurement(stamp, used, whole, np.eye(15) * variance, threshold)


def test_a_circle_is_driven_as_the_closed_form_says():
    state, covariance = np.zeros(15), np.zeros((15, 15))
    state[6], state[11] = 0.5, 0.4
    for _ in range(2000):
        kernels.predict(state, covariance, ZERO, 1e-3)
    angle = 0.8
    assert np.allclose(state[:2], [1.25 * math.sin(angle), 1.25 * (1 - math.cos(angle))], atol=1e-3)
    assert state[5] == pytest.approx(angle) and state[2] == 0.0


def test_the_jacobian_is_that_of_the_model():
    rng = np.random.default_rng(3)
    for _ in range(20):
        state = rng.uniform(-0.7, 0.7, 15)
        exact = np.zeros((15, 15))
        for member in range(15):
            sides = []
            for sign in (1, -1):
                moved, unused = state.copy(), np.zeros((15, 15))
                moved[member] += sign * 1e-6
                kernels.predict(moved, unused, ZERO, 0.1)
                sides.append(moved)
            exact[:, member] = (sides[0] - sides[1]) / 2e-6
        spread = np.diag(rng.uniform(0.1, 1.0, 15))
        got = spread.copy()
        kernels.predict(state.copy(), got, ZERO, 0.1)
        assert np.allclose(got, exact @ spread @ exact.T, atol=1e-7)


def test_equal_measurements_average_by_their_variances():
    ekf = Ekf()
    ekf.add(measure(0.0, variance=1.0, x=0.0))
    ekf.add(measure(0.0, variance=3.0, x=4.0))
    assert ekf.state[0] == pytest.approx(1.0) and ekf.covariance[0, 0] == pytest.approx(0.75)


def test_yaw_is_corrected_the_short_way():
    ekf = Ekf()
    ekf.add(measure(0.0, variance=1.0, yaw=math.pi - 0.1))
    ekf.add(measure(0.0, variance=1.0, yaw=-math.pi + 0.1))
    assert abs(abs(ekf.state[5]) - math.pi) < 1e-6


def test_a_measurement_far_away_is_refused():
    ekf = Ekf()
    ekf.add(measure(0.0, variance=0.01, x=0.0))
    assert not ekf.add(measure(0.0, variance=0.01, threshold=3.0, x=1.0)) and ekf.state[0] == 0.0


def test_values_that_are_not_finite_are_left_out():
    ekf = Ekf()
    assert ekf.add(measure(0.0, x=1.0, y=math.nan)) and not ekf.add(measure(1.0, x=math.inf))
    assert not ekf.add(measure(1.0, variance=math.nan, x=1.0))
    assert np.isfinite(ekf.state).all() and ekf.state[0] == 1.0


def test_an_older_measurement_corrects_without_prediction():
    ekf = Ekf()
    ekf.add(measure(1.0, vx=1.0))
    ekf.add(measure(0.5, variance=1e-9, vx=2.0))
    assert ekf.stamp == 1.0 and ekf.state[0] == 0.0 and ekf.state[6] > 1.9


def test_plane_motion_keeps_height_and_tilt_at_zero():
    ekf = Ekf(two_d_mode=True)
    for turn in range(100):
        ekf.add(measure(0.02 * turn, vx=1.0, vz=0.3, vroll=0.2, az=1.0))
    assert np.abs(ekf.state[PLANE]).max() < 1e-9 and ekf.state[0] == pytest.approx(1.98, abs=0.02)


def test_prediction_to_now_leaves_the_filter_where_it_is():
    ekf = Ekf()
    ekf.add(measure(0.0, vx=1.0))
    state, covariance = ekf.predicted(0.5)
    assert state[0] == pytest.approx(0.5) and ekf.state[0] == 0.0 and covariance[0, 0] > ekf.covariance[0, 0]
    assert ekf.predicted(-1.0)[0][0] == 0.0


def test_a_given_pose_begins_again():
    ekf = Ekf()
    ekf.add(measure(0.0, vx=1.0))
    ekf.set_pose(5.0, np.array([1.0, 2, 0, 0, 0, 0.5]), np.eye(6) * 0.1)
    assert ekf.stamp == 5.0 and ekf.state[5] == 0.5 and not ekf.state[6:].any() and ekf.covariance[1, 1] == 0.1


def test_long_runs_keep_the_covariance_symmetric_and_positive():
    ekf, rng = Ekf(two_d_mode=True), np.random.default_rng(1)
    for turn in range(5000):
        ekf.add(measure(0.02 * turn, vx=rng.normal(), vyaw=rng.normal()))
    assert np.allclose(ekf.covariance, ekf.covariance.T, rtol=1e-6) and np.linalg.eigvalsh(ekf.covariance).min() > 0.0


def test_differences_of_poses_are_velocities_in_the_body():
    source = Source(SourceSettings([True] * 6 + [False] * 9, differential=True))
    turned = matrix_of((0.0, 0.0, math.sin(0.5), math.cos(0.5)))             # yaw 1 rad
    assert source.pose(0.0, np.zeros(3), turned, np.eye(6)) == []
    found, = source.pose(0.5, turned @ [0.1, 0.0, 0.0], turned, np.eye(6))
    assert np.allclose(found.values[6:12], [0.2, 0, 0, 0, 0, 0]) and found.used[6:12].all() and not found.used[:6].any()
    assert found.covariance[6, 6] == pytest.approx(1.0)


def test_relative_poses_begin_at_the_origin():
    source = Source(SourceSettings([True] * 6 + [False] * 9, relative=True))
    turned = matrix_of((0.0, 0.0, math.sin(0.5), math.cos(0.5)))
    first, = source.pose(0.0, np.array([5.0, 1.0, 0.0]), turned, np.eye(6))
    then, = source.pose(1.0, np.array([5.0, 1.0, 0.0]) + turned @ [2.0, 0, 0], turned, np.eye(6))
    assert np.allclose(first.values, 0.0) and np.allclose(then.values[:6], [2, 0, 0, 0, 0, 0])


def test_gravity_is_removed_along_the_orientation():
    source = Source(SourceSettings([False] * 12 + [True] * 3, remove_gravity=True))
    tilted = kernels.rotation(0.3, -0.2, 1.0, -1)
    found, = source.acceleration(0.0, tilted.T @ [0, 0, GRAVITY], np.eye(3), np.eye(3), tilted)
    assert np.allclose(found.values[12:], 0.0)


def test_angles_and_quaternions_agree():
    assert np.allclose(angles_of(kernels.rotation(0.3, -0.2, 1.0, -1)), [0.3, -0.2, 1.0])
    with pytest.raises(ValueError, match="unit quaternion"):
        matrix_of((0.0, 0.0, 0.0, 0.0))


def test_wheels_that_slip_are_corrected_by_an_imu():
    """A wheel factor of 1.1 when turning; the gyro has noise only."""
    rng, truth, wheels, heading = np.random.default_rng(5), np.zeros(2), np.zeros(2), [0.0, 0.0]
    ekf = Ekf(two_d_mode=True)
    for turn in range(3000):
        now, speed, rate = 0.02 * turn, 0.5, 0.3 * math.sin(0.006 * turn)
        if turn:
            heading[0] += rate * 0.02
            heading[1] += 1.1 * rate * 0.02
            truth += 0.01 * np.array([math.cos(heading[0]), math.sin(heading[0])])
            wheels += 0.01 * np.array([math.cos(heading[1]), math.sin(heading[1])])
        ekf.add(measure(now, variance=1e-3, vx=speed, vyaw=1.1 * rate))
        ekf.add(measure(now, variance=1e-6, vyaw=rate + rng.normal(0.0, 1e-3)))
    assert np.linalg.norm(ekf.state[:2] - truth) < 0.2 * np.linalg.norm(wheels - truth)
    assert len(PROCESS_NOISE) == 15
