# SPDX-License-Identifier: BSD-3-Clause
"""The calibration of odometry and mount: its derivatives, its filter and its smoother against plain numpy."""
import math

import numpy as np
import pytest

from m2wr_gmapping.frontend import calibration_kernels as ck
from m2wr_gmapping.frontend import track as tr
from m2wr_maps.se2 import between, compose, inverse

MOUNTS = [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (-0.3, 0.1, math.pi), (0.1, -0.2, 1.2)]
STEPS = [(0.3, 0.0, 0.0), (0.0, 0.0, 0.5), (0.25, 0.02, -0.4), (-0.2, 0.0, 0.1)]
ERRORS = np.array([0.02, -0.03, 0.015, -0.05, 0.04, 0.03])


def corrected(data, step):
    """The corrected step (3,) of the laser, its derivative (3, 6), and the forward distance of the base."""
    out, jacobian = np.empty(3), np.empty((3, 6))
    forward = ck.corrected_step(tr.calibration_of(data), *step, out, jacobian)
    return out, jacobian, forward


def calibrated(mount, value=np.zeros(6)):
    data = tr.new_calibration(np.array(mount))
    tr.calibration_of(data).value[:] = value
    return data


def positive(rng, size, rank=None):
    root = rng.normal(size=(size if rank is None else rank, size))
    return root.T @ root


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("base_step", STEPS)
def test_zero_calibration_changes_no_step(mount, base_step):
    """The step of the laser by odometry, with the base at its place."""
    step = compose(inverse(mount), compose(base_step, mount))
    found, _, forward = corrected(calibrated(mount), step)
    assert found == pytest.approx(step, abs=1e-12) and forward == pytest.approx(base_step[0])


def test_distance_scale_and_missed_rotation():
    """A robot whose laser is at the centre, half of whose wheels' errors are known."""
    value = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    assert corrected(calibrated((0.0, 0.0, 0.0), value), (0.0, 0.0, 0.5))[0] == pytest.approx([0.0, 0.0, 0.6])
    found = corrected(calibrated((0.0, 0.0, 0.0), value), (1.0, 0.0, 0.0))[0]
    assert found == pytest.approx([1.1 * math.cos(0.15), 1.1 * math.sin(0.15), 0.3])


def numerical(path, mount, value):
    """Derivative (3, 6) of the pose after steps by the calibration, in the axes of that pose."""
    def end(at):
        pose = np.zeros(3)
        for step in path:
            pose = compose(pose, corrected(calibrated(mount, at), step)[0])
        return pose
    small, middle = 1e-6, end(value)
    return np.stack([(between(middle, end(value + small * unit)) - between(middle, end(value - small * unit)))
                     / (2.0 * small) for unit in np.eye(6)], -1)


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("step", STEPS)
def test_step_jacobian_equals_numerical_derivative(mount, step):
    assert corrected(calibrated(mount, ERRORS), step)[1] == pytest.approx(numerical([step], mount, ERRORS), abs=1e-7)


@pytest.mark.parametrize("mount", MOUNTS)
def test_propagated_jacobian_equals_numerical_derivative(mount):
    path, jacobian, data = STEPS * 5, np.zeros((3, 6)), calibrated(mount, ERRORS)
    for step in path:
        moved, of_step, _ = corrected(data, step)
        ck.propagate_jacobian(moved, of_step, jacobian)
    assert jacobian == pytest.approx(numerical(path, mount, ERRORS), abs=1e-6)


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_observation_equals_sum_of_covariances(rank):
    """The error of a segment is known no better than the wheels' noise lets it be."""
    rng = np.random.default_rng(rank)
    for _ in range(50):
        seen, noise, error = positive(rng, 3, rank), rng.uniform(0.01, 3.0, 3), rng.normal(size=3)
        information, vector = ck.observation(seen, noise, seen @ error)
        wanted = np.linalg.inv(np.linalg.inv(seen + 1e-9 * np.eye(3)) + np.diag(noise))
        assert np.allclose(information, wanted, atol=1e-6) and np.allclose(vector, wanted @ error, atol=1e-6)
        assert (information == information.T).all()


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_update_equals_information_form(rank):
    rng, used = np.random.default_rng(rank), 0
    for _ in range(50):
        data = tr.new_calibration(np.zeros(3))
        calibration = tr.calibration_of(data)
        calibration.value[:], calibration.covariance[:] = rng.normal(size=6), positive(rng, 6) + 0.1 * np.eye(6)
        value, covariance = calibration.value.copy(), calibration.covariance.copy()
        jacobian, seen, error = rng.normal(size=(3, 6)), positive(rng, 3, rank), rng.normal(size=3)
        if not ck.update(calibration, jacobian, seen, seen @ error):
            continue
        used += 1
        wanted = np.linalg.inv(np.linalg.inv(covariance) + jacobian.T @ seen @ jacobian)
        assert np.allclose(calibration.covariance, wanted)
        assert np.allclose(calibration.value, value + wanted @ jacobian.T @ seen @ error)
    assert used > 40


def test_observation_without_information_changes_nothing():
    data = tr.new_calibration(np.array([0.1, 0.0, 0.3]))
    before = data.copy()
    assert ck.update(tr.calibration_of(data), np.ones((3, 6)), np.zeros((3, 3)), np.zeros(3))
    assert (data == before).all()


def test_straight_drive_teaches_nothing_about_turns():
    data = tr.new_calibration(np.array([0.2, 0.0, 0.0]))
    jacobian, seen = np.zeros((3, 6)), np.diag([1e4, 1e4, 1e4])
    moved, of_step, _ = corrected(data, (0.5, 0.0, 0.0))
    ck.propagate_jacobian(moved, of_step, jacobian)
    calibration = tr.calibration_of(data)
    assert ck.update(calibration, jacobian, seen, seen @ [0.01, 0.005, 0.002])
    turns, prior = [tr.ROTATION, tr.MOUNT_X, tr.MOUNT_Y], np.square(tr.CALIBRATION_PRIOR)
    assert (calibration.value[turns] == 0.0).all()
    assert calibration.covariance.diagonal()[turns] == pytest.approx(prior[turns])
    assert (calibration.covariance.diagonal()[[tr.DISTANCE, tr.DRIFT, tr.MOUNT_YAW]]
            < 0.95 * prior[[tr.DISTANCE, tr.DRIFT, tr.MOUNT_YAW]]).all()


def test_plain_wall_teaches_nothing_about_distance():
    """Across the wall and in heading only."""
    data = tr.new_calibration(np.zeros(3))
    calibration, seen = tr.calibration_of(data), np.diag([0.0, 1e4, 1e4])
    assert ck.update(calibration, corrected(data, (0.5, 0.0, 0.0))[1], seen, seen @ [0.3, 0.002, 0.002])
    assert calibration.value[tr.DISTANCE] == 0.0 and calibration.value[tr.DRIFT] != 0.0
    assert calibration.covariance[tr.DISTANCE, tr.DISTANCE] == pytest.approx(tr.CALIBRATION_PRIOR[tr.DISTANCE]**2)


def test_outlier_changes_nothing():
    data = tr.new_calibration(np.zeros(3))
    before, seen, jacobian = data.copy(), np.diag([1e4, 1e4, 1e4]), corrected(data, (0.5, 0.0, 0.0))[1]
    spread = np.sqrt((jacobian @ np.diag(np.square(tr.CALIBRATION_PRIOR)) @ jacobian.T)[0, 0] + 1e-4)
    assert not ck.update(tr.calibration_of(data), jacobian, seen, seen @ [4.0 * spread, 0.0, 0.0])
    assert (data == before).all()
    assert ck.update(tr.calibration_of(data), jacobian, seen, seen @ [3.5 * spread, 0.0, 0.0])


def arc(distance, turn):
    """Step (3,) of the centre of rotation."""
    half = 0.5 * turn
    chord = distance * (math.sin(half) / half if half else 1.0)
    return np.array([chord * math.cos(half), chord * math.sin(half), turn])


def estimated(mount, errors, seen, drives=400, seed=1):
    """Calibration after random drives with scans of that information (3,), of a robot with those errors (6,)."""
    rng, data = np.random.default_rng(seed), tr.new_calibration(np.array(mount))
    calibration, true_mount = tr.calibration_of(data), np.array(mount) + errors[3:]
    wheels, seen = np.square([0.002, 0.002, 0.002]), np.diag(seen)
    for _ in range(drives):
        jacobian, predicted, true, travelled = np.zeros((3, 6)), np.zeros(3), np.zeros(3), 0.0
        distance, turn = (rng.uniform(-0.1, 0.2), rng.uniform(-0.15, 0.15)) * rng.integers(0, 2, 2)
        for _ in range(5):
            told = arc(distance / (1.0 + errors[0]), (turn - errors[2] * distance / (1.0 + errors[0]))
                       / (1.0 + errors[1]))
            moved, of_step, forward = corrected(data, compose(inverse(mount), compose(told, mount)))
            ck.propagate_jacobian(moved, of_step, jacobian)
            predicted, travelled = compose(predicted, moved), travelled + forward
            true = compose(true, compose(inverse(true_mount), compose(arc(distance, turn), true_mount)))
        error = between(predicted, true) + rng.normal(0.0, np.sqrt(wheels + 1e-6))
        information, vector = ck.observation(seen, wheels, seen @ error)
        ck.drift(calibration.covariance, travelled, tr.CALIBRATION_PRIOR, tr.CALIBRATION_CHANGE)
        ck.update(calibration, jacobian, information, vector)
    return calibration


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("yaw, shift", [(0.035, 0.05), (-0.035, -0.05), (0.0, 0.0)])
def test_all_errors_are_estimated_for_any_mount(mount, yaw, shift):
    """A mount that is 2 degrees and 5 cm off."""
    errors = np.array([0.02, -0.025, 0.012, shift, -shift, yaw])
    found = estimated(mount, errors, (1e6, 1e6, 1e6))
    assert found.value[:3] == pytest.approx(errors[:3], abs=0.002)
    assert found.value[3:5] == pytest.approx(errors[3:5], abs=0.006)
    assert found.value[5] == pytest.approx(errors[5], abs=math.radians(0.2))
    deviations = np.sqrt(found.covariance.diagonal())
    assert (np.abs(found.value - errors) < 4.0 * deviations).all() and (deviations < 0.3 * tr.CALIBRATION_PRIOR).all()


def test_heading_alone_leaves_the_mount_unknown():
    found = estimated((0.2, 0.0, 0.0), ERRORS, (0.0, 0.0, 1e6))
    assert (found.value[[tr.DISTANCE, tr.MOUNT_X, tr.MOUNT_Y, tr.MOUNT_YAW]] == 0.0).all()
    assert found.value[[tr.ROTATION, tr.DRIFT]] == pytest.approx(ERRORS[[tr.ROTATION, tr.DRIFT]], abs=0.003)


def test_uncertainty_grows_up_to_the_prior():
    prior = np.square(tr.CALIBRATION_PRIOR)
    covariance = np.diag(0.1 * prior)
    ck.drift(covariance, -30.0, tr.CALIBRATION_PRIOR, tr.CALIBRATION_CHANGE)
    assert covariance.diagonal() == pytest.approx(prior * (0.1 + 30.0 * tr.CALIBRATION_CHANGE))
    ck.drift(covariance, 1e4, tr.CALIBRATION_PRIOR, tr.CALIBRATION_CHANGE)
    assert covariance.diagonal() == pytest.approx(np.where(tr.CALIBRATION_CHANGE > 0.0, prior, 0.1 * prior))


def test_fused_step_depends_on_unobserved_directions():
    rng = np.random.default_rng(2)
    seen, noise, jacobian = positive(rng, 3), rng.uniform(0.1, 1.0, 3), rng.normal(size=(3, 6))
    out = ck.share_of_odometry(seen, noise, jacobian)
    assert np.allclose(out, np.linalg.solve(seen + np.diag(1.0 / noise), np.diag(1.0 / noise) @ jacobian))
    out = ck.share_of_odometry(np.diag([0.0, 1e9, 1e9]), noise, jacobian)
    assert np.allclose(out[0], jacobian[0]) and np.abs(out[1:]).max() < 1e-6


# ---- smoothing


def run_of(count, seed=8):
    """Records of a run that few steps teach, and the calibration that each was made with."""
    rng, records = np.random.default_rng(seed), np.zeros((count, tr.RECORD_SIZE))
    for k in range(count):
        step = tr.record_of(records[k])
        if k and rng.random() < 0.5:
            row = rng.normal(size=(2, 6)) / tr.CALIBRATION_PRIOR
            step.information[:] = row.T @ row
            step.vector[:] = step.information @ (tr.CALIBRATION_PRIOR * rng.normal(0.5, 0.3, 6))
        step.applied[:], step.derivative[:] = rng.normal(0.0, 0.01, 6), rng.normal(size=(3, 6))
        step.forward[0] = rng.uniform(-0.5, 2.0)
    return records


#: Changes of which every component has some: a matrix of certain ones could not be inverted by numpy.
CHANGES = np.array([1.0, 0.3, 1.0, 0.1, 0.1, 0.1]) / 300.0


def test_smoother_equals_batch_least_squares():
    """No component reaches the limit of ``drift``, so that each change has the same variance in the batch."""
    count, records = 30, run_of(30)
    prior, changes = np.square(tr.CALIBRATION_PRIOR), CHANGES
    first = tr.record_of(records[0])
    first.information[:], first.forward[0] = np.diag(50.0 / prior), 0.0
    first.vector[:] = first.information @ (0.2 * tr.CALIBRATION_PRIOR)
    matrix, wanted = np.zeros((6 * count, 6 * count)), np.zeros(6 * count)
    matrix[:6, :6] += np.diag(1.0 / prior)
    for k in range(count):
        step, here = tr.record_of(records[k]), slice(6 * k, 6 * k + 6)
        matrix[here, here] += step.information
        wanted[here] = step.vector
        if k:
            tie, joint = np.diag(1.0 / (prior * changes * abs(step.forward[0]))), slice(6 * k - 6, 6 * k + 6)
            matrix[joint, joint] += np.block([[tie, -tie], [-tie, tie]])
    best = np.linalg.solve(matrix, wanted).reshape(-1, 6)
    out = ck.smooth(records, tr.CALIBRATION_PRIOR, changes)
    assert np.ptp(best, axis=0).min() > 1e-5
    assert out == pytest.approx(best, abs=1e-6)
    change = ck.changed_steps(records, tr.CALIBRATION_PRIOR, changes)
    wanted = [tr.record_of(row).derivative @ (now - tr.record_of(row).applied) for row, now in zip(records, best)]
    assert change == pytest.approx(np.array(wanted), abs=1e-5)


def test_smoother_gives_one_value_if_nothing_changes():
    """All steps know what any of them told, as one least-squares problem says."""
    records = run_of(40)
    out = ck.smooth(records, tr.CALIBRATION_PRIOR, np.zeros(6))
    steps = [tr.record_of(row) for row in records]
    total = np.diag(1.0 / np.square(tr.CALIBRATION_PRIOR)) + sum(step.information for step in steps)
    assert out == pytest.approx(np.tile(np.linalg.solve(total, sum(step.vector for step in steps)), (40, 1)), abs=1e-9)
