# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from m2wr_navigation.controllers.dwa import Dwa
from m2wr_navigation.controllers.velocity_samples import Oscillation, along_axis, make_samples
from m2wr_navigation.parameters import read


def values(**others):
    return read(Dwa.PARAMETERS, others, "~")[0]


@pytest.mark.parametrize("low, high, count, expected", [
    (0.0, 1.0, 3, [0.0, 0.5, 1.0]), (-1.0, 2.0, 2, [-1.0, 0.0, 2.0]), (-1.0, 1.0, 3, [-1.0, 0.0, 1.0]),
    (0.3, 0.3, 20, [0.3]), (0.0, 1.0, 1, [0.0, 1.0])])
def test_samples_of_an_axis_are_even_with_a_zero(low, high, count, expected):
    np.testing.assert_allclose(along_axis(low, high, count), expected)


def test_samples_keep_limits_and_are_reachable():
    samples = make_samples(values(), np.array([0.3, 0.0, 0.5]), 0.05)
    assert len(samples) > 50
    assert np.abs(samples[:, 0] - 0.3).max() <= 0.125 + 1e-9 and np.abs(samples[:, 2] - 0.5).max() <= 0.16 + 1e-9
    assert np.hypot(samples[:, 0], samples[:, 1]).max() <= 0.5501


def test_slow_samples_must_turn():
    samples = make_samples(values(), np.zeros(3), 0.05)
    slow = np.hypot(samples[:, 0], samples[:, 1]) < 0.1 - 1e-3
    assert (np.abs(samples[slow, 2]) >= 0.4 - 1e-3).all() and slow.any()


def test_a_barred_direction_opens_once_the_robot_has_moved():
    memory, pose = Oscillation(), np.zeros(3)
    memory.note(np.array([0.0, 0.0, 1.0]), pose, 0.1)
    assert not memory.barred.any()
    memory.note(np.array([0.0, 0.0, -1.0]), pose, 0.1)
    assert memory.barred[2].tolist() == [0.0, 1.0]
    memory.look(np.array([0.02, 0.0, 0.1]), 0.05, 0.2)
    assert memory.barred.any()
    memory.look(np.array([0.0, 0.0, 0.3]), 0.05, 0.2)
    assert not memory.barred.any()


def test_turning_while_driving_bars_nothing():
    memory = Oscillation()
    for rate in (1.0, -1.0, 1.0):
        memory.note(np.array([0.5, 0.0, rate]), np.zeros(3), 0.1)
    assert not memory.barred.any()
