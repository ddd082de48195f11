# SPDX-License-Identifier: BSD-3-Clause
"""Robots that do not know where the others began: what is certain joins, what contradicts leaves."""
import math

import numpy as np
import pytest

from exploration_grids import grid
from m2wr_exploration.team import placing as module
from m2wr_exploration.team.map_match import Match
from m2wr_exploration.team.placing import Placing
from m2wr_maps.se2 import compose, inverse
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint import placed

NAMES = ["robot1", "robot2", "robot3"]
POSE = np.array([2.0, -1.0, 0.5])


def area(square_metres):
    """A map with a known area, without walls."""
    costs = np.full((20, 100), 255, np.uint8)
    costs.ravel()[:int(round(square_metres / 0.25))] = 0
    return Costmap(costs, 0.5, np.zeros(2), "map")


@pytest.fixture
def results(monkeypatch):
    """What the comparison of maps finds: the last one again and again."""
    found = []
    monkeypatch.setattr(module, "match", lambda first, second: found.pop(0) if len(found) > 1 else found[0])
    monkeypatch.setattr(module, "agreement_of", lambda first, second, pose: 1.0)
    return found


def good(pose=POSE):
    return Match(np.array(pose), 1.5, 20.0, 1.0, 0.2, "")


def test_points_and_areas():
    assert placed(np.array([[3.0, 0.0]]), np.array([1.0, 2.0, math.pi / 2.0])) == pytest.approx(np.array([[1.0, 5.0]]))
    assert area(12.0).known_area == pytest.approx(12.0)


def test_known_starts_are_one_group_from_the_beginning():
    made = Placing(NAMES, [np.zeros(3), POSE, np.zeros(3)])
    assert made.whole and made.summary() == "" and made.update({0: area(20.0), 1: area(20.0)}) == []
    assert made.relative(1, 0) == pytest.approx(inverse(POSE))


def test_a_place_counts_when_it_is_found_again_on_grown_maps(results):
    made = Placing(NAMES[:2])
    results.append(good())
    assert made.relative(0, 1) is None
    assert "they are compared again when they have changed" in made.update({0: area(20.0), 1: area(20.0)})[0]
    assert made.update({0: area(20.0), 1: area(21.0)}) == [] and not made.whole
    assert "robot2 lies at (2.00, -1.00), 0.500 rad on that of robot1" in made.update({0: area(20.0), 1: area(22.5)})[0]
    assert made.whole and made.relative(0, 1) == pytest.approx(POSE)
    assert made.relative(1, 0) == pytest.approx(inverse(POSE))


@pytest.mark.parametrize("other", [(2.5, -1.0, 0.5), (2.0, -1.0, 0.6)])
def test_two_results_that_differ_do_not_count(results, other):
    made = Placing(NAMES[:2])
    results.extend([good(), good(other), good(POSE)])
    for size in (20.0, 23.0, 26.0):
        made.update({0: area(20.0), 1: area(size)})
        assert not made.whole
    made.update({0: area(20.0), 1: area(29.0)})
    assert made.whole and made.relative(0, 1) == pytest.approx(POSE)


def test_what_is_not_certain_is_refused_with_the_reason(results):
    made = Placing(NAMES[:2])
    results.append(Match(POSE, 0.5, 5.0, 1.0, 0.9, "another place fits 90 % as well"))
    for size in (20.0, 30.0, 40.0):
        assert made.update({0: area(size), 1: area(size)}) == [
            "the maps of robot1 and robot2 are not placed on each other: another place fits 90 % as well"]
    assert not made.whole and made.summary() == "it is not certain where the maps of robot2 lie on that of robot1"


def test_a_third_robot_joins_by_the_second_one():
    made = Placing(NAMES)
    second, third = np.array([1.0, 0.0, math.pi / 2.0]), np.array([0.0, 3.0, 0.0])
    made.join(1, 2, third)
    assert made.groups == [0, 1, 1] and made.relative(0, 2) is None
    made.join(0, 1, second)
    assert made.groups == [0, 0, 0] and made.relative(0, 2) == pytest.approx(compose(second, third))


def room(*more):
    """A room of 4 by 2 m with more walls (row, column)."""
    drawn = [list("#" * 40)] + [list("#" + "." * 38 + "#") for _ in range(20)] + [list("#" * 40)]
    for row, column in more:
        drawn[row][column] = "#"
    return grid("\n".join("".join(line) for line in drawn), 0.1)


def joined(pose):
    made = Placing(NAMES[:2])
    made.join(0, 1, np.array(pose, float))
    return made


ODD = [(10, column) for column in range(1, 15)] + [(row, 25) for row in range(1, 5)]


def test_a_robot_whose_map_agrees_stays():
    made = joined([0.0, 0.0, 0.0])
    assert made.update({0: room(*ODD), 1: room(*ODD)}) == [] and made.whole


def test_a_robot_whose_map_contradicts_leaves_its_group():
    made = joined([0.0, 1.0, 0.0])              # wrong: each long wall is in the free space of the other map
    told = made.update({0: room(*ODD), 1: room(*ODD)})
    assert "the map of robot2 is taken from that of robot1 again" in told[0] and "contradict" in told[0]
    assert made.groups == [0, 1]


def test_a_robot_leaves_when_another_place_fits_as_well():
    made = joined([0.0, 0.0, 0.0])              # turned by half a turn, this room looks the same
    told = made.update({0: room(), 1: room()})
    assert "again: another place fits" in told[0] and not made.whole


def test_a_robot_whose_map_fits_better_elsewhere_leaves(results):
    made = joined([0.0, 0.0, 0.0])
    results.append(good())
    assert "it fits better at (2.00, -1.00), 0.500 rad" in made.update({0: area(20.0), 1: area(20.0)})[0]


def test_a_place_that_is_confirmed_becomes_more_exact():
    made = joined([0.1, 0.0, 0.0])
    assert made.update({0: room(*ODD), 1: room(*ODD)}) == [] and made.relative(0, 1) == pytest.approx(
        np.zeros(3), abs=0.02)


def test_a_group_is_checked_without_the_map_of_its_first_robot():
    made = Placing(NAMES)
    made.join(0, 1, np.zeros(3))
    made.join(0, 2, np.array([0.1, 0.0, 0.0]))
    assert made.update({1: room(*ODD), 2: room(*ODD)}) == []
    assert made.relative(1, 2) == pytest.approx(np.zeros(3), abs=0.02)


def test_a_place_is_kept_where_too_little_wall_makes_it_exact(results):
    made = joined([0.1, 0.0, 0.01])
    results.append(good([0.0, 0.0, 0.0]))
    assert made.update({0: area(20.0), 1: area(20.0)}) == []
    assert made.relative(0, 1) == pytest.approx(np.array([0.1, 0.0, 0.01]))


def test_a_large_placed_map_is_checked_when_a_share_is_new(results):
    made = joined([0.0, 0.0, 0.0])
    results.extend([good([0.0, 0.0, 0.0]), good()])
    assert made.update({0: area(200.0), 1: area(200.0)}) == [] and len(results) == 1
    assert made.update({0: area(200.0), 1: area(203.0)}) == [] and made.whole
    assert "it fits better" in made.update({0: area(200.0), 1: area(209.0)})[0]
