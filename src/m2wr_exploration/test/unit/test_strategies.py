# SPDX-License-Identifier: BSD-3-Clause
"""The order in which each strategy takes frontiers."""
import itertools

import numpy as np
import pytest

from m2wr_exploration.frontiers import look
from m2wr_exploration.registry import STRATEGIES, find
from m2wr_exploration.strategies.tour_kernels import shortest_tour
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.parameters import read
from m2wr_navigation.registry import UnknownPluginError


def strategy(name, **given):
    kind = find(name)
    values, warnings = read(kind.PARAMETERS, given, "~")
    assert not warnings
    return kind(values)


@pytest.fixture
def view():
    """A corridor along x, 10 m long: a frontier of 0.6 m at its left end, 3 m away; one of 2 m at its right end."""
    costs = np.full((40, 100), 254, np.uint8)
    costs[17:23, 2:60], costs[10:30, 60:98] = 0, 0
    costs[17:23, :2], costs[10:30, 98:] = 255, 255
    return look(Costmap(costs, 0.1, np.zeros(2), "map"), np.array([3.2, 2.0]), 0.0)


def order(name, view, **given):
    return [round(float(frontier.centre[0])) for frontier in strategy(name, **given).order(view, view.frontiers)]


def test_nearest_takes_the_shorter_path(view):
    assert order("nearest", view) == [0, 10]


def test_explore_lite_takes_the_larger_one_by_default(view):
    assert order("explore_lite", view) == [10, 0]


def test_explore_lite_weighs_distance_by_its_scale(view):
    # 3 * 3.2 m * 0.1 - 6 cells * 0.1 = 0.36 against 3 * 6.6 m * 0.1 - 20 cells * 0.1 = -0.02: the larger one still;
    # with 10 it is 2.6 against 4.6
    assert order("explore_lite", view, potential_scale=3.0) == [10, 0]
    assert order("explore_lite", view, potential_scale=10.0) == [0, 10]


def test_information_weighs_the_visible_area_against_the_path(view):
    assert order("information", view, decay=0.5) == [0, 10]
    assert order("information", view, decay=1000.0, sensor_range=1.5) == [10, 0]


def test_tour_takes_the_near_dead_end_first(view):
    assert order("tour", view) == [0, 10]


@pytest.mark.parametrize("count", range(1, 7))
def test_the_shortest_tour_is_that_of_a_full_search(count):
    random = np.random.default_rng(count)
    places, start = random.uniform(0.0, 10.0, (count, 2)), random.uniform(0.0, 10.0, 2)
    first = np.hypot(*(places - start).T)
    between = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))

    def length(tour):
        return first[tour[0]] + sum(between[a, b] for a, b in zip(tour, tour[1:]))

    best = min(length(tour) for tour in itertools.permutations(range(count)))
    found = shortest_tour(first, between)
    assert sorted(found.tolist()) == list(range(count)) and length(found.tolist()) == pytest.approx(best)


def test_more_frontiers_than_a_tour_takes_are_all_there(view):
    assert len(strategy("tour", exact=1).order(view, view.frontiers)) == len(view.frontiers)


def test_an_unknown_strategy_is_told_with_those_that_there_are():
    with pytest.raises(UnknownPluginError, match="explore_lite, information, nearest, tour"):
        find("greedy")


def test_each_strategy_is_in_the_table():
    assert set(STRATEGIES) == {"explore_lite", "nearest", "information", "tour"}
