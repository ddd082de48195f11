"""What the steps of a path are told once it is known where the robot turns about."""
import numpy as np
import pytest

from m2wr_gmapping import hindsight_kernels as kernels
from m2wr_gmapping.hindsight import LOOK_EVERY, WORTH, Hindsight
from m2wr_gmapping.se2 import between, compose, inverse

AHEAD = np.array([0.6, -0.8])


def drive(count, centre, seed=3):
    """A path that odometry has led without a centre, the right one, and turns, all of ``count`` steps."""
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


def kept(turns, silent=(1.0, 0.0, 1.0)):
    hindsight = Hindsight(AHEAD)
    for turn in turns:
        hindsight.room()[:] = [*silent, turn, 0.0, 0.0, 0.0]
    return hindsight


@pytest.mark.parametrize("count", [1, 20, 600])
def test_steps_that_no_scan_held_become_what_they_are_with_the_centre(count):
    thought, right, turns = drive(count, 0.2)
    hindsight = kept(turns)
    changes, found = hindsight.look(thought, 0.2)
    assert np.allclose(found[:, :2], right[:, :2], atol=1e-9) and (found[:, 2] == thought[:, 2]).all()
    steps = compose(between(thought[:-1], thought[1:]), changes[1:])
    assert np.allclose(steps, between(found[:-1], found[1:]), atol=1e-9) and not changes[0].any()


def test_what_was_told_once_is_not_told_again():
    thought, _, turns = drive(30, 0.2)
    hindsight = kept(turns)
    _, found = hindsight.look(thought, 0.2)
    assert hindsight.look(found, 0.2)[0] is None
    assert np.allclose(hindsight.look(found, 0.0)[1], thought)


def test_a_step_moves_only_in_the_direction_in_which_its_scan_was_silent():
    thought, _, turns = drive(1, 0.2)
    c, s = np.cos(0.7), np.sin(0.7)
    changes, _ = kept(turns, (c * c, c * s, s * s)).look(thought, 0.2)
    whole, _ = kept(turns).look(thought, 0.2)
    assert changes[1, :2] == pytest.approx(np.array([c, s]) * (whole[1, :2] @ [c, s]))
    assert kept(turns, (0.0, 0.0, 0.0)).look(thought, 0.2)[0] is None


def test_little_is_not_worth_a_new_map_and_looks_become_seldom():
    thought, right, turns = drive(12, 0.002)
    assert 0.0 < np.abs(right - thought).max() < WORTH and kept(turns).look(thought, 0.002)[0] is None
    hindsight, looks = Hindsight(AHEAD), 0
    for count in range(1, 1001):
        hindsight.room()[:] = 0.0
        if hindsight.due:
            hindsight.look(np.zeros((count + 1, 3)), 0.0)
            looks += 1
    assert 1000 // (LOOK_EVERY + 1000 // 8) < looks < 40
    assert kernels.STEP_SIZE == len(hindsight.room())
