# SPDX-License-Identifier: BSD-3-Clause
import numpy as np

from m2wr_navigation.controllers.arrival import Arrival

GOAL = np.zeros(3)


def looks(distances, latch=False):
    arrival = Arrival()
    return [arrival.look(np.array([distance, 0.0, 0.0]), GOAL, 0.1, latch) for distance in distances]


def test_a_turn_may_move_the_robot_a_little():
    assert looks([0.12, 0.09, 0.14, 0.16, 0.12, 0.1]) == [False, True, True, False, False, True]


def test_with_the_latch_once_is_enough():
    assert looks([0.12, 0.09, 5.0], True) == [False, True, True]


def test_the_third_arrival_counts_for_good():
    assert looks([0.09, 0.2, 0.09, 0.2, 0.09, 0.2]) == [True, False, True, False, True, True]


def test_a_new_goal_begins_again():
    arrival = Arrival()
    assert arrival.look(GOAL, GOAL, 0.1, True)
    arrival.reset()
    assert not arrival.look(np.array([0.2, 0.0, 0.0]), GOAL, 0.1, True)
