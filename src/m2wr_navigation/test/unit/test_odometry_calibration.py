# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from localization_room import room, scan, settings
from m2wr_maps.se2 import between, compose
from m2wr_navigation.localization.localizer import Localizer
from m2wr_navigation.localization.odometry_calibration import LIMIT, UNKNOWN, OdometryCalibration

ERRORS = np.array([-0.02, 0.03, -0.01])         # scale of distances, scale of turns, curve [-, -, rad/m]
FIX = np.diag([0.01, 0.01, 0.005]) ** 2


def measured(step, errors=ERRORS):
    """What odometry with errors says of a step (3,) of the axle; the inverse of the correction for small steps."""
    way = step[0] / (1.0 + errors[0])
    return np.array([way, 0.0, (step[2] - errors[2] * way) / (1.0 + errors[1])])


def steps(count, rng):
    """Arcs of 5 cm, each meter with another curvature."""
    turns = np.repeat(rng.uniform(-0.06, 0.06, count // 20 + 1), 20)[:count]
    return np.column_stack([np.full(count, 0.05), np.zeros(count), turns])


def drive(calibration, count=1200, seed=3, spread=FIX, errors=ERRORS):
    """Drive, and let the calibration look at true poses with noise; returns the last true pose."""
    rng = np.random.default_rng(seed)
    true, odom = np.zeros(3), np.zeros(3)
    calibration.step(odom)
    calibration.begin(true)
    for step in steps(count, rng):
        true, odom = compose(true, step), compose(odom, measured(step, errors))
        calibration.step(odom)
        if calibration.is_due:
            prior = calibration.covariance
            seen = np.linalg.inv(np.linalg.inv(prior) + np.linalg.inv(spread))
            noise = rng.standard_normal(3) * np.sqrt(np.diag(spread))
            away = true + noise - calibration.track
            away[2] = (away[2] + np.pi) % (2.0 * np.pi) - np.pi
            assert calibration.look(calibration.track + seen @ np.linalg.inv(spread) @ away, seen)
    return true


def test_errors_of_scales_and_curve_are_learnt():
    found = OdometryCalibration()
    drive(found)
    assert found.errors == pytest.approx(ERRORS, abs=0.005)


def test_perfect_odometry_stays_as_it_is():
    found = OdometryCalibration()
    drive(found, errors=np.zeros(3))
    assert np.abs(found.errors).max() < 0.005


def test_known_errors_are_removed_from_the_steps():
    found, true, odom = OdometryCalibration(), np.zeros(3), np.zeros(3)
    found.errors = ERRORS.copy()
    found.step(odom)
    for step in steps(400, np.random.default_rng(1)):
        true, odom = compose(true, step), compose(odom, measured(step))
        found.step(odom)
    assert np.hypot(*(odom - true)[:2]) > 0.5                       # without a correction
    assert np.hypot(*(found.pose - true)[:2]) < 0.03 and abs(found.pose[2] - true[2]) < 1e-9


def test_nothing_is_learnt_where_the_scan_says_nothing():
    # one wall along x: the scan knows y and the heading only, and the robot drives along it
    found, odom = OdometryCalibration(), np.zeros(3)
    found.step(odom)
    found.begin(np.zeros(3))
    for _ in range(200):
        odom = compose(odom, [0.05, 0.0, 0.0])
        found.step(odom)
        if found.is_due:
            prior = found.covariance
            seen = np.linalg.inv(np.linalg.inv(prior) + np.diag([0.0, 1e4, 4e4]))
            assert found.look(found.track.copy(), seen)
    assert found.errors[0] == 0.0 and np.sqrt(found.covariance[0, 0]) > 0.2


@pytest.mark.parametrize("jump", [(2.0, 0.0, 0.0), (0.0, 0.0, 1.5)])
def test_a_jump_of_odometry_is_no_motion_to_learn_from(jump):
    found = OdometryCalibration()
    drive(found)
    before = found.errors.copy()
    found.step(compose(found._raw, jump))
    assert found.track is None and (found.errors == before).all()


def test_a_fit_far_off_the_track_loses_the_track_only():
    found = OdometryCalibration()
    drive(found)
    before = found.errors.copy()
    assert not found.look(found.track + [0.8, 0.5, 0.0], FIX)
    assert found.track is None and (found.errors == before).all()


def test_errors_are_bounded():
    found = OdometryCalibration()
    found.step(np.zeros(3))
    for k in range(1, 200):
        found.begin(np.zeros(3))
        found.step(np.array([0.5 * k, 0.0, 0.0]))
        found.look(found.track + [0.05, 0.0, 0.0], found.covariance * 0.01)
    assert np.abs(found.errors / UNKNOWN).max() == pytest.approx(LIMIT)


def to_and_fro(found, drift, count=240):
    """Drive to and fro along the room by odometry that measures too much."""
    pose = odom = np.array([0.7, 2.0, 0.0])
    for k in range(count):
        outcome = found.process("laser", scan(pose), odom)
        step = np.array([0.08 if k // 50 % 2 == 0 else -0.08, 0.0, 0.01])
        error = between(pose, compose(outcome.map_from_odom, odom))
        pose, odom = compose(pose, step), compose(odom, step * [1.0 + drift, 1.0, 1.0])
    return error


@pytest.mark.parametrize("learning, expected", [(True, -0.04 / 1.04), (False, 0.0)])
def test_a_localized_robot_learns_its_scale(learning, expected):
    found = Localizer(room(), settings(odom_learning=learning), np.random.default_rng(2))
    found.start_at(np.array([0.7, 2.0, 0.0]), np.diag([0.01, 0.01, 0.01]))
    error = to_and_fro(found, 0.04)
    assert found.calibration.errors[0] == pytest.approx(expected, abs=0.01)
    assert np.hypot(*error[:2]) < 0.05


def test_learning_that_is_turned_off_forgets():
    found = Localizer(room(), settings(), np.random.default_rng(2))
    found.start_at(np.array([0.7, 2.0, 0.0]), np.diag([0.01, 0.01, 0.01]))
    to_and_fro(found, 0.04, 60)
    assert found.calibration.errors.any()
    found.configure(settings(odom_learning=False))
    assert not found.calibration.errors.any()
