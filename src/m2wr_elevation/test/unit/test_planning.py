# SPDX-License-Identifier: BSD-3-Clause
"""The cheapest way goes round what costs more than the way round it."""
import math

import numpy as np
import pytest

from m2wr_elevation.elevation_map import MapSettings
from m2wr_elevation.planning import FORBIDDEN_COST, UNKNOWN_COST, cost_of, follow, route


def length(way):
    return sum(math.hypot(two[0] - one[0], two[1] - one[1]) for one, two in zip(way, way[1:]))


def test_on_level_ground_the_way_is_straight():
    way = route(np.ones((21, 41)), (10, 2), (10, 38))
    assert way[0] == (10, 2) and way[-1] == (10, 38) and {row for row, _ in way} == {10}


def test_the_way_leads_round_a_crater():
    rows, columns = np.mgrid[0:41, 0:41]
    crater = np.hypot(rows - 20, columns - 20) < 8
    way = route(np.where(crater, FORBIDDEN_COST, 1.0), (20, 2), (20, 38))
    assert not any(crater[at] for at in way) and 36.0 < length(way) < 46.0


def test_a_gentle_slope_is_crossed_where_the_way_round_is_long():
    cost = np.ones((41, 41))
    cost[:, 18:22] = 3.0
    cost[:5, 18:22] = 1.0
    assert length(route(cost, (38, 2), (38, 38))) == pytest.approx(36.0)


def test_slopes_cost_and_the_unknown_too():
    settings = MapSettings()
    none, some = np.zeros((1, 4)), np.array([[0.0, 0.5, 1.0, math.nan]])
    layers = {"slope": some * settings.most_slope, "step": none, "roughness": none, "traversability": 1.0 - some}
    cost = cost_of(layers, settings)[0]
    assert cost[0] == 1.0 < cost[1] < cost[2] == FORBIDDEN_COST and cost[3] == UNKNOWN_COST


def test_a_goal_behind_a_wall_without_gap_has_no_way():
    cost = np.ones((5, 9))
    cost[:, 4] = math.inf
    assert route(cost, (2, 0), (2, 8)) == []


def test_a_goal_outside_is_refused():
    with pytest.raises(ValueError, match="goal is cell"):
        route(np.ones((5, 5)), (0, 0), (5, 0))


def test_the_robot_turns_towards_its_way_before_it_drives():
    way = np.column_stack((np.linspace(0.0, 3.0, 31), np.zeros(31)))
    assert follow(way, 0.0, 0.0, 0.0) == pytest.approx((0.3, 0.0))
    speed, rate = follow(way, 0.0, 0.0, 1.5)
    assert speed == 0.0 and rate == -1.0
    assert follow(way, 1.0, -0.2, 0.0)[1] > 0.0
