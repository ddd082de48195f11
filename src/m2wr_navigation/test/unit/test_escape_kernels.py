# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from m2wr_navigation.controllers import escape_kernels as kernels

BOX = np.array([[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]])
ROLLED = np.array([1.0, 0.025, 0.1, 1000.0])


@pytest.mark.parametrize("point, margin, expected", [
    ((0.0, 0.0), 0.0, 0.1), ((0.15, 0.0), 0.0, 0.05), ((0.3, 0.0), 0.0, 0.0), ((0.21, 0.0), 0.03, 0.02)])
def test_overlap_is_the_depth_below_the_outline(point, margin, expected):
    assert kernels.overlap(np.array([point]), margin, BOX, 0.0, 0.0, 0.0) == pytest.approx((expected, expected))


def test_overlap_turns_with_the_robot():
    assert kernels.overlap(np.array([[1.0, 1.15]]), 0.0, BOX, 1.0, 1.0, math.pi / 2) == pytest.approx((0.05, 0.05))


def test_near_obstacles_are_centres_of_lethal_and_unknown_cells():
    costs = np.zeros((20, 20), np.uint8)
    costs[10, 12], costs[11, 10], costs[0, 0], costs[9, 9] = 254, 255, 254, 253
    found = np.empty((10, 2))
    count = kernels.near_obstacles(costs, 0.1, np.zeros(2), 1.0, 1.0, 0.5, found)
    np.testing.assert_allclose(found[:count], [[1.25, 1.05], [1.05, 1.15]])


def way_out(samples, points):
    return kernels.best_way_out(np.array(samples, float), np.zeros(3), np.zeros(3), np.full(3, np.inf), ROLLED,
                                np.array(points), 0.03, BOX)


def test_the_way_out_leads_away_from_the_wall():
    wall = [[0.2, y] for y in np.arange(-0.5, 0.55, 0.05)]
    assert way_out([[0.2, 0.0, 0.0], [-0.2, 0.0, 0.0], [0.0, 0.0, 0.5]], wall) == 1


def test_a_corner_does_not_cut_through_a_wall():
    wall = [[0.2, y] for y in np.arange(-0.5, 0.55, 0.05)]
    assert way_out([[0.0, 0.0, 0.8], [0.0, 0.0, -0.8], [0.1, 0.0, 0.4]], wall) == -1


def test_of_two_ways_out_the_slower_one_is_taken():
    assert way_out([[-0.5, 0.0, 0.0], [-0.2, 0.0, 0.0]], [[0.2, 0.0]]) == 1
