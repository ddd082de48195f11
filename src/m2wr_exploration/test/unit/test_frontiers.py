# SPDX-License-Identifier: BSD-3-Clause
"""Frontiers of small maps, whose figures are known."""
import numpy as np
import pytest

from exploration_grids import grid
from m2wr_exploration.frontiers import costs_of_occupancy, gain, look, with_room
from m2wr_navigation.costmap.costmap import Costmap

ROOM = """
########
#...???#
#...???#
#......#
########"""


def test_the_frontier_of_a_half_seen_room():
    view = look(grid(ROOM), np.array([1.25, 1.0]), 0.0)
    assert len(view.frontiers) == 1
    frontier = view.frontiers[0]
    assert sorted(map(tuple, frontier.cells.tolist())) == [(2, 4), (2, 5), (2, 6), (3, 4)]
    assert frontier.size == pytest.approx(4 * 0.5)
    assert frontier.centre == pytest.approx(np.mean([(2.25, 1.25), (2.75, 1.25), (3.25, 1.25), (2.25, 1.75)], axis=0))
    assert frontier.nearest == pytest.approx(np.hypot(1.0, 0.25))


def test_the_goal_is_reachable_and_beside_the_frontier():
    view = look(grid(ROOM), np.array([1.25, 1.0]), 0.0)
    frontier = view.frontiers[0]
    assert np.isfinite(view.distance[frontier.goal_cell])
    assert np.abs(frontier.cells - np.array(frontier.goal_cell)).sum(axis=1).min() == 1


def test_smaller_frontiers_are_counted_only():
    view = look(grid(ROOM), np.array([1.25, 1.0]), 2.1)
    assert not view.frontiers and view.small == 1


def test_unknown_space_behind_a_wall_is_no_frontier():
    closed = """
########
#..#???#
#..#???#
########"""
    view = look(grid(closed), np.array([1.0, 1.0]), 0.0)
    assert not view.frontiers and not view.small and not view.reason


def test_a_gap_without_room_for_the_robot_is_no_way():
    narrow = """
#########
#...#????
#........
#...#????
#########"""
    costmap = grid(narrow, 0.2)
    assert look(costmap, np.array([0.5, 0.5]), 0.0).frontiers
    view = look(costmap, np.array([0.5, 0.5]), 0.0, 0.25)
    assert not any(frontier.goal[0] > 0.9 for frontier in view.frontiers)
    assert costmap.costs.max() == 255 and (costmap.costs != 253).all()        # the map itself is not changed
    assert with_room(costmap, 0.0) is costmap


@pytest.mark.parametrize("place", [(-1.0, 1.0), (float("nan"), 1.0)])
def test_a_robot_outside_of_the_map_is_told(place):
    view = look(grid(ROOM), np.array(place), 0.0)
    assert not view.frontiers and "outside of the map" in view.reason


def test_a_robot_among_obstacles_is_told():
    view = look(grid("####\n####\n####\n####", 1.0), np.array([1.5, 1.5]), 0.0)
    assert "no free cell within 1 m" in view.reason


def test_a_map_of_one_cell_has_no_frontier():
    assert not look(grid("."), np.array([0.2, 0.2]), 0.0).frontiers


def test_occupancy_and_costs_of_a_published_costmap():
    occupancy = np.array([[-1, 0, 1, 98, 99, 100, 101, -128]], np.int8)
    assert costs_of_occupancy(occupancy).tolist() == [[255, 0, 1, 252, 253, 254, 255, 255]]


def test_gain_is_the_unknown_area_in_view():
    costs = np.zeros((41, 41), np.uint8)
    costs[:, 21:] = 255
    view = look(Costmap(costs, 0.1, np.zeros(2), "map"), np.array([1.0, 2.05]), 0.0)
    assert gain(view.costmap, view.frontiers[0], 1.0) == pytest.approx(0.5 * np.pi, abs=0.15)


ALCOVE = """
##########
#........#
#........#
#........#
#........#
#........#
####??####
####??####
##########"""
INSIDE = np.array([1.0, 1.2])


def alcove():
    """A room with an alcove of 0.4 m at its lower side, cells of 0.05 m."""
    drawn = grid(ALCOVE, 0.2)
    return Costmap(np.kron(drawn.costs, np.ones((4, 4), np.uint8)), 0.05, np.zeros(2), "map")


def test_a_corner_too_narrow_for_the_robot_is_looked_into():
    assert not look(alcove(), INSIDE, 0.0, 0.35).frontiers
    view = look(alcove(), INSIDE, 0.0, 0.35, 0.1)
    assert len(view.frontiers) == 1
    assert np.isfinite(view.distance[view.frontiers[0].goal_cell])
    assert view.frontiers[0].centre[1] == pytest.approx(0.6, abs=0.1)


def test_smaller_corners_are_left():
    assert not look(alcove(), INSIDE, 0.0, 0.35, 1.0).frontiers


def test_corners_are_found_below_the_inflation():
    costmap = alcove()
    costmap.costs[costmap.costs == 255] = 253
    assert not look(costmap, INSIDE, 0.0, 0.35, 0.1).frontiers
    assert len(look(costmap, INSIDE, 0.0, 0.35, 0.1, alcove()).frontiers) == 1


def test_a_hole_that_the_costmap_has_cleared_is_driven_into():
    """Beams without an end clear costmaps, not maps: what is unknown there is free to drive in, so not narrow."""
    costmap = grid("\n".join(["#" * 60] + ["#" + "." * 58 + "#"] * 58 + ["#" * 60]), 0.05)
    known = Costmap(costmap.costs.copy(), 0.05, np.zeros(2), "map")
    known.costs[20:45, 25:45] = 255
    view = look(costmap, INSIDE, 0.0, 0.3, 0.5, known)
    assert len(view.frontiers) == 1
    row, column = view.frontiers[0].goal_cell
    assert 30 <= row <= 34 and 33 <= column <= 37
    assert np.isfinite(view.frontiers[0].path)


def test_a_corner_counts_if_only_its_tip_is_wide():
    """A strip along a wall is too narrow for the robot, but for one cell, which is too small for a frontier."""
    costmap = grid("\n".join(["#" * 60] + ["#" + "." * 58 + "#"] * 58 + ["#" * 60]), 0.05)
    costmap.costs[10:40, 1:5] = 255
    costmap.costs[25, 5:8] = 255
    wide = look(costmap, INSIDE, 0.0, 0.35)
    assert [frontier.size < 0.25 for frontier in wide.frontiers] == [True]
    view = look(costmap, INSIDE, 0.25, 0.35, 0.5)
    assert len(view.frontiers) == 1 and view.small == 1
    assert view.frontiers[0].size > 1.0 and not view.frontiers[0].beside
