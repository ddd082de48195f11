# SPDX-License-Identifier: BSD-3-Clause
"""Frontiers are shared out by value, and claims count."""
import numpy as np

from m2wr_exploration.team.auction import assign

NONE = np.zeros((0, 2))
FAR = np.array([(0.0, 0.0), (20.0, 0.0)])


def test_each_robot_gets_the_frontier_near_to_it():
    costs = np.array([(9.0, 2.0), (3.0, 8.0)])
    assert assign(costs, FAR, NONE, 10.0).tolist() == [1, 0]


def test_the_second_robot_avoids_what_the_first_one_will_see():
    places = np.array([(0.0, 0.0), (1.0, 0.0), (20.0, 0.0)])
    costs = np.array([(1.0, 2.0, 8.0), (2.0, 2.0, 8.0)])
    assert assign(costs, places, NONE, 10.0).tolist() == [0, 2]


def test_a_claimed_frontier_is_not_assigned():
    assert assign(np.array([(1.0, 9.0)]), FAR, np.array([(0.1, 0.0)]), 10.0).tolist() == [1]
    assert assign(np.array([(1.0, 9.0)]), FAR, FAR, 10.0).tolist() == [-1]


def test_what_cannot_be_reached_is_not_assigned():
    assert assign(np.array([(np.inf, np.inf), (1.0, np.inf)]), FAR, NONE, 10.0).tolist() == [-1, 0]


def test_without_frontiers_none_is_assigned():
    assert assign(np.zeros((3, 0)), NONE, NONE, 10.0).tolist() == [-1, -1, -1]
