# SPDX-License-Identifier: BSD-3-Clause
"""Robots that others took for walls, before they knew where these are."""
import numpy as np
import pytest

from m2wr_exploration.team.placing import Placing
from m2wr_exploration.team.trails import Trails
from m2wr_navigation.costmap.costmap import Costmap

SQUARE = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])


def walls():
    return Costmap(np.full((100, 100), 254, np.uint8), 0.05, np.zeros(2), "map")


def test_a_body_with_its_margin_is_free_in_the_map_of_others():
    trails, placing = Trails(2, SQUARE), Placing(["robot1", "robot2"])
    trails.add(1, np.array([0.0, 0.0, 0.0]))
    assert (trails.cleared({0: walls()}, placing)[0].costs == 254).all()             # where robot2 is, is not known
    placing.join(0, 1, np.array([2.5, 2.0, np.pi / 2.0]))
    given = walls()
    free = trails.cleared({0: given}, placing)[0].costs == 0
    rows, columns = np.nonzero(free)
    assert 0.05 * (columns.mean() + 0.5) == pytest.approx(2.5) and 0.05 * (rows.mean() + 0.5) == pytest.approx(2.0)
    assert free.sum() == pytest.approx(0.6 * 0.6 / 0.05 ** 2, rel=0.05) and (given.costs == 254).all()
    assert (trails.cleared({1: walls()}, placing)[1].costs == 254).all()             # a robot is not in its own map


def test_a_trail_has_a_pose_for_each_step():
    trails, placing = Trails(2, SQUARE), Placing(["robot1", "robot2"], [np.zeros(3), np.zeros(3)])
    for x in np.arange(1.0, 3.0, 0.01):
        trails.add(1, np.array([x, 1.0, 0.0]))
    free = trails.cleared({0: walls()}, placing)[0].costs == 0
    assert free[20, 20:60].all() and not free[20, :13].any() and not free[20, 67:].any()


def test_where_bodies_have_been_nothing_is_known_for_comparisons():
    trails, placing = Trails(2, SQUARE), Placing(["robot1", "robot2"])
    trails.add(0, np.array([1.0, 1.0, 0.0]))
    trails.add(1, np.array([1.0, 1.0, 0.0]))
    own = trails.comparable({0: walls()}, placing)[0].costs == 255
    assert own[20, 20] and own.sum() == pytest.approx(0.6 * 0.6 / 0.05 ** 2, rel=0.05)
    placing.join(0, 1, np.array([2.5, 2.0, 0.0]))
    both = trails.comparable({0: walls()}, placing)[0].costs == 255
    assert both[20, 20] and both[60, 70] and both.sum() == 2 * own.sum()
