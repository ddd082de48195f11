# SPDX-License-Identifier: BSD-3-Clause
"""Frontiers that are set aside: how long, and when they are forgotten."""
import numpy as np
import pytest

from m2wr_exploration.frontiers import look
from m2wr_exploration.set_aside import SetAside
from m2wr_navigation.costmap.costmap import Costmap


@pytest.fixture
def map_and_frontier():
    costs = np.zeros((40, 40), np.uint8)
    costs[:, 30:] = 255
    costmap = Costmap(costs, 0.1, np.zeros(2), "map")
    return costmap, look(costmap, np.array([1.0, 1.0]), 0.0).frontiers[0]


def test_the_pause_doubles_and_tries_end(map_and_frontier):
    costmap, frontier = map_and_frontier
    aside = SetAside(0.5, 10.0, 3)
    assert aside.allows(0.0, frontier)
    aside.add(0.0, costmap, frontier, "first")
    assert not aside.allows(9.9, frontier) and aside.allows(10.0, frontier) and aside.may_later(frontier)
    aside.add(10.0, costmap, frontier, "second")
    assert not aside.allows(29.9, frontier) and aside.allows(30.0, frontier)
    aside.add(30.0, costmap, frontier, "third")
    assert not aside.allows(1e9, frontier) and not aside.may_later(frontier) and aside.reason(frontier) == "third"
    assert len(aside.entries) == 1


def test_a_changed_map_makes_it_new_again(map_and_frontier):
    costmap, frontier = map_and_frontier
    aside = SetAside(0.5, 10.0, 1)
    aside.add(0.0, costmap, frontier, "blocked")
    assert not aside.forget_changed(costmap)
    costmap.costs[:, 30:34] = 0
    assert [entry.reason for entry in aside.forget_changed(costmap)] == ["blocked"]
    assert aside.allows(1.0, frontier)


def test_a_final_entry_waits_for_a_change_of_the_map(map_and_frontier):
    costmap, frontier = map_and_frontier
    aside = SetAside(0.5, 10.0, 3)
    aside.add(0.0, costmap, frontier, "blocked", True)
    assert not aside.allows(1e9, frontier) and not aside.may_later(frontier)
    costmap.costs[:, 30:34] = 0
    assert aside.forget_changed(costmap) and aside.allows(0.0, frontier)
