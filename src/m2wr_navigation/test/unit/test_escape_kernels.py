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


def test_obstacles_are_centres_of_lethal_and_unknown_cells():
    costs = np.zeros((20, 20), np.uint8)
    costs[10, 12], costs[11, 10], costs[0, 0], costs[9, 9] = 254, 255, 254, 253
    found = np.empty((10, 2))
    count = kernels.obstacles_around(costs, 0.1, np.zeros(2), 1.0, 1.0, (0.5, 0.5), found)
    np.testing.assert_allclose(found[:count], [[1.25, 1.05], [1.05, 1.15]])


def test_of_far_obstacles_the_cells_at_their_sides_count():
    costs = np.zeros((40, 40), np.uint8)
    costs[10:31, 30:33] = 254
    found = np.empty((100, 2))
    count = kernels.obstacles_around(costs, 0.1, np.zeros(2), 2.05, 2.05, (0.5, 1.3), found)
    columns = np.unique(np.floor(found[:count, 0] / 0.1 + 1e-6))
    np.testing.assert_array_equal(columns, [30.0, 32.0])
    assert count == kernels.obstacles_around(costs, 0.1, np.zeros(2), 2.05, 2.05, (0.5, 1.3), found[:count])


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


def test_the_way_out_of_one_wall_does_not_end_in_another():
    wall = [[0.2, 0.0]] + [[-0.7, y] for y in np.arange(-0.5, 0.55, 0.05)]
    assert way_out([[-0.8, 0.0, 0.0], [-0.6, 0.0, 0.0]], wall[:1]) == 1
    assert way_out([[-0.8, 0.0, 0.0], [-0.6, 0.0, 0.0]], wall) == -1
    assert way_out([[-0.8, 0.0, 0.0], [-0.3, 0.0, 0.0]], wall) == 1
