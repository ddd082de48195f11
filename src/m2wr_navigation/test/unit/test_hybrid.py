# SPDX-License-Identifier: BSD-3-Clause
"""Paths of hybrid A* can be driven with the turning radius, keep clear of obstacles, and end as they should."""
import math

import numpy as np
import pytest

from m2wr_navigation import registry
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.parameters import read

RADIUS = 0.5


def planned(costmap, start, goal, **given):
    kind = registry.find(registry.PLANNERS, "HybridAStar")
    values, warnings = read(kind.PARAMETERS, dict(given, turning_radius=RADIUS), "~HybridAStar")
    assert not warnings
    return kind(values).plan(costmap, np.array(start, float), np.array(goal, float))


def walled():
    """Return 6 x 6 m with a wall across that has one gap, at the top."""
    costmap = Costmap.filled((120, 120), 0.05, (0.0, 0.0), 0)
    costmap.costs[:90, 58:62] = 254
    return costmap


def steps_of(plan):
    steps = np.diff(plan.poses[:, :2], axis=0)
    turns = np.remainder(np.diff(plan.poses[:, 2]) + math.pi, 2.0 * math.pi) - math.pi
    middle = plan.poses[:-1, 2] + 0.5 * turns
    ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
    return np.hypot(*steps.T), turns, ahead


@pytest.mark.parametrize("start_yaw, goal_yaw", [(0.0, 0.0), (math.pi, -0.5 * math.pi), (-0.5 * math.pi, math.pi)])
def test_a_path_bends_no_more_than_the_robot_can(start_yaw, goal_yaw):
    costmap = walled()
    plan = planned(costmap, (1.0, 1.0, start_yaw), (5.0, 1.0, goal_yaw))
    assert not plan.reason
    assert plan.poses[0] == pytest.approx([1.0, 1.0, math.remainder(start_yaw, 2.0 * math.pi)], abs=1e-9) \
        or abs(plan.poses[0, 2]) == pytest.approx(math.pi)
    assert plan.poses[-1, :2] == pytest.approx([5.0, 1.0], abs=1e-6)
    assert math.cos(plan.poses[-1, 2] - goal_yaw) == pytest.approx(1.0)
    lengths, turns, ahead = steps_of(plan)
    # a chord is 2 r sin(turn / 2), and the robot moves along its mean heading
    assert (2.0 * RADIUS * np.sin(0.5 * np.abs(turns)) <= lengths * (1.0 + 1e-6) + 1e-9).all()
    assert ahead == pytest.approx(lengths, abs=1e-9)
    assert all(costmap.cost_at(x, y) == 0 for x, y in plan.poses[:, :2])


def test_backing_makes_a_turn_in_a_narrow_place_shorter():
    costmap = Costmap.filled((60, 100), 0.05, (0.0, 0.0), 254)
    costmap.costs[20:40, 5:95] = 0              # a corridor 1 m wide, too narrow to turn round ahead
    assert "no path with a turning radius of 0.5 m" in planned(costmap, (1.0, 1.5, 0.0), (4.0, 1.5, math.pi)).reason
    back = planned(costmap, (1.0, 1.5, math.pi), (4.0, 1.5, math.pi), reverse_factor=1.5)
    lengths, _, ahead = steps_of(back)
    assert not back.reason and back.length < 3.6 and (np.abs(ahead) == pytest.approx(lengths, abs=1e-9))
    assert np.sum(lengths[ahead < 0.0]) > 2.0


def test_in_a_narrow_place_a_robot_turns_round_by_backing():
    costmap = Costmap.filled((80, 100), 0.05, (0.0, 0.0), 254)
    costmap.costs[20:50, 5:95] = 0              # a corridor 1.5 m wide: a full turn ahead needs 2 m
    plan = planned(costmap, (1.5, 1.75, 0.0), (3.5, 1.75, math.pi), reverse_factor=1.5)
    lengths, turns, ahead = steps_of(plan)
    assert not plan.reason and (ahead < -1e-9).any() and (ahead > 1e-9).any()
    assert np.abs(ahead) == pytest.approx(lengths, abs=1e-9)
    assert (2.0 * RADIUS * np.sin(0.5 * np.abs(turns)) <= lengths * (1.0 + 1e-6) + 1e-9).all()
    assert all(costmap.cost_at(x, y) == 0 for x, y in plan.poses[:, :2])
    assert math.cos(plan.poses[-1, 2]) == pytest.approx(-1.0)


def test_in_the_open_backing_makes_a_path_shorter():
    costmap = Costmap.filled((200, 200), 0.05, (0.0, 0.0), 0)
    ends = (5.0, 5.0, 0.0), (5.0, 5.6, math.pi)
    ahead = planned(costmap, *ends)
    back = planned(costmap, *ends, reverse_factor=1.0, change_cost=0.0)
    assert back.length < 0.8 * ahead.length and back.length == pytest.approx(math.pi * RADIUS, rel=0.01)


def test_any_heading_gives_no_longer_a_path_than_a_given_one():
    costmap = walled()
    free = planned(costmap, (1.0, 1.0, 0.0), (5.0, 1.0, 1.0), any_goal_heading=True)
    bound = planned(costmap, (1.0, 1.0, 0.0), (5.0, 1.0, math.pi / 2.0))
    assert not free.reason and free.length < bound.length and free.poses[-1, :2] == pytest.approx([5.0, 1.0])


def test_a_second_plan_is_the_same():
    costmap = walled()
    kind = registry.find(registry.PLANNERS, "HybridAStar")
    planner = kind(read(kind.PARAMETERS, {}, "~")[0])
    first, again = (planner.plan(costmap, np.array([1.0, 1.0, 0.0]), np.array([5.0, 1.0, 0.0])) for _ in range(2))
    assert (first.poses == again.poses).all()


def test_a_goal_without_a_way_is_told():
    costmap = walled()
    costmap.costs[:, 58:62] = 254
    assert "there is no way through" in planned(costmap, (1.0, 1.0, 0.0), (5.0, 1.0, 0.0)).reason
