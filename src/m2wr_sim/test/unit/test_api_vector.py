# SPDX-License-Identifier: BSD-3-Clause
"""Many worlds at once: each row is what a simulation of its own would give."""
import numpy as np
import pytest

from m2wr_sim.api import Sim, VectorSim, read_robot, read_world

COUNT = 3
POSES = [(0.0, 8.0, 0.0), (1.0, 8.0, 1.0), (-2.0, 7.5, -2.0)]
COMMANDS = [(0.5, 0.2), (-0.3, 0.6), (0.0, -0.9)]


@pytest.fixture(scope="module")
def scene():
    """Return a world and a robot, read once."""
    return read_world("world02"), read_robot("m2wr")


@pytest.fixture
def vector(scene):
    """Return three worlds."""
    with VectorSim(COUNT, *scene, pose=POSES, seed=20) as made:
        yield made


def rows(result):
    """Return everything in a result as bytes, a row a world."""
    return [b"".join(np.ascontiguousarray(array[index]).tobytes() for array in (
        result.time, result.pose, result.odometry, result.ranges, result.contacts)) for index in range(COUNT)]


def test_each_row_is_what_a_simulation_of_its_own_gives(scene, vector):
    vector.step(COMMANDS, 0.5)
    result = vector.step(None, 0.25)
    assert result.ranges.shape == (COUNT, 720) and result.ranges.dtype == np.float32
    for index in range(COUNT):
        with Sim(*scene, pose=POSES[index], seed=20 + index, sensing="now") as sim:
            sim.step(COMMANDS[index], 0.5)
            alone = sim.step(None, 0.25)
        assert result.time[index] == alone.time
        assert tuple(result.pose[index]) == alone.pose
        assert tuple(result.odometry[index]) == alone.odometry.pose + (
            alone.odometry.linear_x, alone.odometry.linear_y, alone.odometry.angular_z)
        assert np.array_equal(result.ranges[index], alone.scan.ranges)


def test_a_reset_repeats_and_may_take_only_some(vector):
    first = rows(vector.step(COMMANDS, 0.5))
    second = rows(vector.step(None, 0.5))
    started = vector.reset(20)
    assert np.all(started.time == 0.0) and np.allclose(started.pose, POSES)
    assert rows(vector.step(COMMANDS, 0.5)) == first
    assert rows(vector.step(None, 0.5)) == second
    vector.reset(20)
    vector.step(COMMANDS, 0.5)
    partly = vector.reset(20, where=[False, True, False])
    assert list(partly.time) == [0.5, 0.0, 0.5]
    after = rows(vector.step(COMMANDS, 0.5))
    assert after[1] == first[1] and after[0] == second[0] and after[2] == second[2]


def test_new_seed_changes_the_noise_and_new_poses_the_start(vector):
    before = vector.reset(20)
    other = vector.reset(21)
    assert np.array_equal(before.pose, other.pose) and not np.array_equal(before.ranges[0], other.ranges[0])
    moved = vector.reset(poses=[(0.5, 7.0, 0.25)] * COUNT)
    assert np.allclose(moved.pose, (0.5, 7.0, 0.25))


def test_contacts_are_counted_by_row(vector):
    # a wall at y = 5, to the south
    vector.reset(poses=[(0.0, 7.0, -np.pi / 2), (0.0, 7.0, np.pi / 2), (0.0, 7.0, 0.0)])
    total = np.zeros(COUNT, int)
    for _ in range(40):
        total += vector.step((0.5, 0.0), 0.1).contacts
    assert total[0] > 0 and total[2] == 0


def test_before_the_first_tick_rows_hold_nan(scene):
    with VectorSim(1, *scene, pose=POSES[0], sensing="due") as vector:
        assert np.isnan(vector.reset().ranges).all()
        early = vector.step(None, 0.02)
        assert np.isnan(early.odometry).all() and np.isfinite(early.ranges).any()
        assert len(vector) == 1


@pytest.mark.parametrize("arguments, text", [
    (((0.1, 0.2, 0.3),), "commands of shape \\(3,\\) for 3 worlds"), (([(0.1, 0.2)] * 2,), "commands of shape")])
def test_wrong_numbers_of_commands_are_refused(vector, arguments, text):
    with pytest.raises(ValueError, match=text):
        vector.step(*arguments)


def test_wrong_numbers_of_worlds_and_choices_are_refused(scene, vector):
    with pytest.raises(ValueError, match="expected at least one"):
        VectorSim(0, *scene)
    with pytest.raises(ValueError, match="pose of shape"):
        VectorSim(2, *scene, pose=POSES)
    with pytest.raises(ValueError, match="one truth value for each"):
        vector.reset(where=[True])
