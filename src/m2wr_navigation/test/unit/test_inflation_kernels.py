# SPDX-License-Identifier: BSD-3-Clause
"""Inflated costs are those of the exact Euclidean distance."""
import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from m2wr_navigation.costmap.inflation_kernels import GREATEST_RADIUS, cost_table, inflate

RESOLUTION, INSCRIBED_RADIUS, SCALING = 0.05, 0.2, 10.0


def blocks(shape, count, seed=3):
    rng, costs = np.random.default_rng(seed), np.zeros(shape, np.uint8)
    for _ in range(count):
        row, column = rng.integers(0, shape[0] - 2), rng.integers(0, shape[1] - 3)
        costs[row:row + 2, column:column + 3] = 254
    return costs


def expected(costs, table, radius):
    squares = np.rint(distance_transform_edt(costs != 254) ** 2).astype(int)
    return np.where(squares <= radius * radius, table[np.minimum(squares, radius * radius)], 0)


@pytest.mark.parametrize("radius", [1, 2, 6, 11, 40, GREATEST_RADIUS])
@pytest.mark.parametrize("shape", [(60, 90), (37, 21), (5, 200)])
def test_costs_are_those_of_the_exact_distance(shape, radius):
    costs, table = blocks(shape, 6), cost_table(radius, RESOLUTION, INSCRIBED_RADIUS, SCALING)
    want = expected(costs, table, radius)
    inflate(costs, table, radius, 0, shape[0], 0, shape[1], False)
    assert (costs == want).all()


@pytest.mark.parametrize("cells, cost", [(0, 254), (1, 253), (4, 253), (5, None), (8, None)])
def test_the_table_has_the_formula_of_costmap_2d(cells, cost):
    beyond = cells * RESOLUTION - INSCRIBED_RADIUS
    want = int(252 * math.exp(-SCALING * beyond)) if cost is None else cost
    assert cost_table(10, RESOLUTION, INSCRIBED_RADIUS, SCALING)[cells * cells] == want


def test_a_window_gets_what_the_whole_grid_would_get():
    costs, table = blocks((80, 80), 12), cost_table(9, RESOLUTION, INSCRIBED_RADIUS, SCALING)
    whole, part = costs.copy(), costs.copy()
    inflate(whole, table, 9, 0, 80, 0, 80, False)
    inflate(part, table, 9, 20, 50, 10, 60, False)
    assert (part[20:50, 10:60] == whole[20:50, 10:60]).all()
    part[20:50, 10:60] = costs[20:50, 10:60]
    assert (part == costs).all(), "cells outside of the window were written"


@pytest.mark.parametrize("inflate_unknown", [False, True])
def test_unknown_cells_become_inscribed_only_unless_asked(inflate_unknown):
    costs = np.full((30, 30), 255, np.uint8)
    costs[15, 15] = 254
    inflate(costs, cost_table(10, RESOLUTION, INSCRIBED_RADIUS, SCALING), 10, 0, 30, 0, 30, inflate_unknown)
    assert costs[15, 19] == 253 and costs[15, 28] == 255
    assert (costs[15, 21] != 255) == inflate_unknown


def test_a_cost_is_never_lowered():
    costs = np.zeros((20, 20), np.uint8)
    costs[10, 10], costs[10, 12] = 254, 200
    inflate(costs, cost_table(5, RESOLUTION, 0.0, SCALING), 5, 0, 20, 0, 20, False)
    assert costs[10, 12] == 200
