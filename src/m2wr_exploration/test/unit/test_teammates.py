# SPDX-License-Identifier: BSD-3-Clause
"""Beams that end on other robots are no measurement."""
import numpy as np

from m2wr_exploration.team.teammates import without


def test_only_the_beam_on_the_robot_is_taken_away():
    ranges = np.array([2.0, 2.0, np.inf], np.float32)
    found = without(ranges, np.array([0.0, 1.5, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([(3.2, 0.0)]))
    assert np.isnan(found[0]) and found[1] == 2.0 and np.isinf(found[2])


def test_a_wall_before_the_robot_stays():
    found = without(np.array([1.0], np.float32), np.zeros(1), np.zeros(3), np.array([(3.0, 0.0)]))
    assert found.tolist() == [1.0]
