# SPDX-License-Identifier: BSD-3-Clause
"""Past steps are corrected once the offset of the centre of rotation is known."""
import numpy as np
import pytest

from m2wr_gmapping.backend import odometry_recalibration_kernels as kernels
from m2wr_gmapping.backend.odometry_recalibration import CHECK_EVERY, MIN_SHIFT, Recalibration
from m2wr_gmapping.se2 import between, compose, inverse

AHEAD = np.array([0.6, -0.8])


def drive(count, centre, seed=3):
    """Path by odometry without the offset, the true path, and the rotations, of ``count`` steps."""
    rng = np.random.default_rng(seed)
    point = np.array([*(centre * AHEAD), 0.0])
    thought, right, turns = [rng.normal(size=3)], [], rng.uniform(-0.5, 0.5, count)
    right.append(thought[0])
    for turn in turns:
        step = np.array([*(rng.uniform(0.0, 0.5) * AHEAD), turn])
        thought.append(compose(thought[-1], step))
        # what goes round a point behind it: the same way and turn of that point
        right.append(compose(right[-1], compose(step, between([0.0, 0.0, turn], compose(
            inverse(point), compose([0.0, 0.0, turn], point))))))
    return np.array(thought), np.array(right), turns


def kept(turns, unobserved=(1.0, 0.0, 1.0)):
    recalibration = Recalibration(AHEAD)
    for turn in turns:
        recalibration.next_row()[:] = [*unobserved, turn, 0.0, 0.0, 0.0]
    return recalibration


@pytest.mark.parametrize("count", [1, 20, 600])
def test_unobserved_steps_are_corrected_for_the_centre(count):
    thought, right, turns = drive(count, 0.2)
    recalibration = kept(turns)
    changes, found = recalibration.correct(thought, 0.2)
    assert np.allclose(found[:, :2], right[:, :2], atol=1e-9) and (found[:, 2] == thought[:, 2]).all()
    steps = compose(between(thought[:-1], thought[1:]), changes[1:])
    assert np.allclose(steps, between(found[:-1], found[1:]), atol=1e-9) and not changes[0].any()


def test_a_correction_is_applied_once():
    thought, _, turns = drive(30, 0.2)
    recalibration = kept(turns)
    _, found = recalibration.correct(thought, 0.2)
    assert recalibration.correct(found, 0.2)[0] is None
    assert np.allclose(recalibration.correct(found, 0.0)[1], thought)


def test_a_step_moves_only_along_its_degenerate_direction():
    thought, _, turns = drive(1, 0.2)
    c, s = np.cos(0.7), np.sin(0.7)
    changes, _ = kept(turns, (c * c, c * s, s * s)).correct(thought, 0.2)
    whole, _ = kept(turns).correct(thought, 0.2)
    assert changes[1, :2] == pytest.approx(np.array([c, s]) * (whole[1, :2] @ [c, s]))
    assert kept(turns, (0.0, 0.0, 0.0)).correct(thought, 0.2)[0] is None


def test_small_shifts_are_skipped_and_checks_become_rare():
    thought, right, turns = drive(12, 0.002)
    assert 0.0 < np.abs(right - thought).max() < MIN_SHIFT and kept(turns).correct(thought, 0.002)[0] is None
    recalibration, checks = Recalibration(AHEAD), 0
    for count in range(1, 1001):
        recalibration.next_row()[:] = 0.0
        if recalibration.due:
            recalibration.correct(np.zeros((count + 1, 3)), 0.0)
            checks += 1
    assert 1000 // (CHECK_EVERY + 1000 // 8) < checks < 40
    assert kernels.STEP_SIZE == len(recalibration.next_row())
