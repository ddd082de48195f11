# SPDX-License-Identifier: BSD-3-Clause
"""Past steps are corrected by what is known about the calibration later."""
import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.backend.step_history import CHECK_EVERY, FIRST_STEPS, StepHistory, path_of
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.frontend.information_kernels import DEPENDENT
from m2wr_maps.se2 import between, compose

STEP = np.array([0.5, 0.0, 0.0])


def filled(count, taught=(), distance=-0.03):
    """History of straight steps whose length no scan observes; those ``taught`` tell of an error of the distance."""
    history = StepHistory()
    for k in range(1, count + 1):
        record = tr.record_of(history.next_record())
        record.forward[0] = STEP[0]
        record.derivative[0, tr.DISTANCE] = STEP[0]
        if k in taught:
            record.information[tr.DISTANCE, tr.DISTANCE] = 1e6
            record.vector[tr.DISTANCE] = 1e6 * distance
            record.derivative[:] = 0.0
            record.applied[tr.DISTANCE] = distance
    return history


def straight(count):
    return path_of(np.array([1.0, 2.0, 0.5]), np.tile(STEP, (count + 1, 1)))


def test_path_of_steps_equals_composition():
    rng = np.random.default_rng(1)
    path = rng.normal(size=(20, 3))
    steps = np.concatenate([np.zeros((1, 3)), between(path[:-1], path[1:])])
    assert path_of(path[0], steps) == pytest.approx(path)


def test_steps_are_unchanged_before_anything_is_known():
    path = straight(40)
    assert filled(40).corrected(path)[1:] == pytest.approx(np.tile(STEP, (40, 1)))


def test_unobserved_steps_change_once_the_error_is_known():
    """Wheels that tell 3 % too much; only the last steps are observed, and they stay as they are."""
    steps = filled(40, range(31, 41)).corrected(straight(40))
    assert steps[1:31, 0] == pytest.approx(np.full(30, 0.97 * STEP[0]), abs=1e-3)
    assert steps[31:, 0] == pytest.approx(np.full(10, STEP[0]))
    assert not steps[0].any() and np.abs(steps[:, 1:]).max() < 1e-9


def test_correction_is_applied_once():
    """The steps stay those that were measured, whatever became of the path."""
    history, path = filled(40, range(31, 41)), straight(40)
    first = history.corrected(path)
    assert (history.corrected(path_of(path[0], first)) == first).all()


def test_more_steps_than_there_was_room_for():
    count = FIRST_STEPS + 50
    history = filled(count, [count])
    assert history.count == count + 1 == len(history.variances) == len(history.information)
    assert history.corrected(straight(count))[1, 0] == pytest.approx(0.97 * STEP[0], abs=2e-3)


def test_step_information_is_the_inverse_covariance():
    rng = np.random.default_rng(4)
    root, row, variances = rng.normal(size=(3, 3)) * 100.0, np.zeros(mk.RESULT_SIZE), np.array([1e-3, 2e-3, 1e-4])
    seen = root.T @ root + np.diag([1e6, 1e6, 0.0])      # corners: hardly anything is lost to the normals' noise
    row[mk.INFORMATION:] = seen[np.triu_indices(3)]
    history = StepHistory()
    history.next_record()
    history.set_information(row, variances)
    covariance = np.linalg.inv(history.information[1])
    wanted = np.linalg.inv(seen / DEPENDENT + np.diag(1.0 / variances)) + np.diag(np.square(tuning.DRIFT.step))
    assert covariance == pytest.approx(wanted, rel=0.1, abs=1e-6)
    assert history.variances[1] == pytest.approx(covariance[0, 0] + covariance[1, 1])


def test_plain_wall_leaves_the_variance_of_odometry():
    row, variances, history = np.zeros(mk.RESULT_SIZE), np.array([1e-3, 2e-3, 1e-4]), StepHistory()
    row[mk.INFORMATION:] = np.diag([850.0, 1e4, 1e4])[np.triu_indices(3)]
    history.next_record()
    history.set_information(row, variances)
    assert np.linalg.inv(history.information[1])[0, 0] == pytest.approx(variances[0] + np.square(tuning.DRIFT.step)[0])


def test_checks_become_rare():
    history, checks = StepHistory(), 0
    for _ in range(1000):
        history.next_record()
        if history.due:
            history.checked()
            checks += 1
    assert 1000 // (CHECK_EVERY + 1000 // 8) < checks < 40


def test_restored_history_continues():
    history, again = filled(20, [20]), StepHistory()
    history.corrected(straight(20))
    history.checked()
    again.restore(history.compact())
    assert again.count == 21 and not again.due
    for one in (history, again):
        tr.record_of(one.next_record()).derivative[0, tr.DISTANCE] = STEP[0]
    path = compose([0.0, 0.0, 0.3], straight(21))
    assert (again.corrected(path) == history.corrected(path)).all() and again.count == 22
