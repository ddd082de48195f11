# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from m2wr_navigation.controllers.distance_kernels import BLOCKED, spread_distances


def spread(costs, seeds):
    out = np.empty(costs.shape, np.float32)
    spread_distances(costs, np.array(seeds, np.int64).reshape(-1, 2), np.empty((4, 4 * costs.size), np.int64),
                     np.empty(costs.shape, np.uint8), out)
    return out


def test_distances_are_straight_in_all_directions():
    found = spread(np.zeros((101, 101), np.uint8), [(50, 50)])
    rows, columns = np.mgrid[-50:51, -50:51]
    straight = np.hypot(rows, columns)
    far = straight > 10.0
    # the error of the first order scheme is greatest near the seed; steps with a common side are 41 % too long
    assert np.abs(found[far] / straight[far] - 1.0).max() < 0.08
    assert found[50, 100] == pytest.approx(50.0)


def test_the_way_leads_round_an_obstacle():
    costs = np.zeros((61, 61), np.uint8)
    costs[0:50, 30] = 254
    found = spread(costs, [(10, 10)])
    shortest = 2.0 * np.hypot(40.0, 20.0)       # by the end of the wall to the other side
    assert shortest < found[10, 50] < 1.06 * shortest
    assert (found[0:50, 30] == BLOCKED).all()


def test_a_spiral_is_followed_to_its_middle():
    costs = np.full((31, 31), 254, np.uint8)
    row, column, ways = 1, 1, [(0, 1), (1, 0), (0, -1), (-1, 0)]
    costs[row, column], length, k = 0, 28, 0
    steps = 0
    while length > 0:
        for _ in range(length):
            row, column = row + ways[k % 4][0], column + ways[k % 4][1]
            costs[row, column], steps = 0, steps + 1
        k += 1
        length -= 2 if k % 2 == 1 and k > 1 else 0
    assert 0.85 * steps < spread(costs, [(1, 1)])[row, column] <= steps


def test_enclosed_cells_are_not_reached():
    costs = np.zeros((5, 5), np.uint8)
    costs[1:4, 1:4] = 255
    costs[2, 2] = 0
    assert spread(costs, [(0, 0)])[2, 2] > BLOCKED


def test_from_inscribed_cells_a_way_leads_out():
    assert spread(np.full((1, 4), 253, np.uint8), [(0, 0)]).tolist() == [[0, 1, 2, 3]]


def test_no_way_leads_through_inscribed_cells():
    costs = np.zeros((5, 5), np.uint8)
    costs[0:4, 2] = 253
    found = spread(costs, [(0, 0)])
    assert found[0, 3] > 7.0                    # round the end, not 3
    assert found[0, 2] == pytest.approx(2.0) and found[3, 2] > 3.5


def test_without_seeds_nothing_is_reached():
    assert (spread(np.zeros((2, 2), np.uint8), []) > BLOCKED).all()
