# SPDX-License-Identifier: BSD-3-Clause
"""The fast searches find what plain ones find: the potential, the cheapest path of A*, a better one of Theta*."""
import heapq
import math

import numpy as np
import pytest

from m2wr_navigation.planners import any_angle_kernels, grid_search_kernels, wave_kernels
from m2wr_navigation.planners.planner import cost_table
from planner_grids import blocks, inflated

TABLE = cost_table(50.0, 0.8, True)
ALL = np.zeros((0, 0), np.uint8)


def grid(seed, size=90):
    costs = inflated(blocks(size, 30, seed), 0.3, 0.06)
    costs[size // 2, :size // 3] = 255          # unknown cells, the most expensive ones
    return costs


def exact_potential(costs, target, quadratic):
    """The fixed point of the equation, by rounds over the whole grid in 64-bit numbers."""
    cost = np.pad(TABLE[costs].astype(float), 1, constant_values=np.inf)
    free = np.isfinite(cost)
    value = np.full(cost.shape, np.inf)
    value[target[0] + 1, target[1] + 1] = 0.0
    while True:
        across = np.minimum(np.roll(value, 1, 1), np.roll(value, -1, 1))
        along = np.minimum(np.roll(value, 1, 0), np.roll(value, -1, 0))
        low, high = np.minimum(across, along), np.maximum(across, along)
        with np.errstate(invalid="ignore"):
            apart = high - low
            both = 0.5 * (low + high + np.sqrt(np.maximum(2.0 * cost ** 2 - apart ** 2, 0.0)))
            new = np.where(quadratic & (apart < cost), both, low + cost)
        better = free & (new < value - 1e-9)
        if not better.any():
            return value[1:-1, 1:-1]
        value[better] = new[better]


def cheapest(costs, start, target):
    """Dijkstra on eight neighbours; no diagonal passes a blocked cell."""
    total, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        spent, (row, column) = heapq.heappop(queue)
        if (row, column) == target:
            return spent
        if spent > total[row, column]:
            continue
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                r, c = row + down, column + right
                if not (0 <= r < costs.shape[0] and 0 <= c < costs.shape[1]):
                    continue
                if not all(np.isfinite(TABLE[costs[cell]]) for cell in ((r, c), (row, c), (r, column))):
                    continue
                new = spent + 0.5 * math.hypot(down, right) * float(TABLE[costs[row, column]] + TABLE[costs[r, c]])
                if new < total.get((r, c), math.inf):
                    total[r, c] = new
                    heapq.heappush(queue, (new, (r, c)))
    return math.inf


@pytest.mark.parametrize("quadratic", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_the_potential_is_the_exact_one(seed, quadratic):
    costs, potential = grid(seed), np.full((90, 90), np.inf, np.float32)
    wave_kernels.wave(costs, TABLE, (1, 1), (-1, -1), potential, ALL, quadratic)
    exact = exact_potential(costs, (1, 1), quadratic)
    reached = np.isfinite(exact)
    assert (np.isfinite(potential) == reached).all() and reached.sum() > 4000
    assert (np.abs(potential - exact)[reached] <= 1e-4 * np.maximum(exact[reached], 1.0)).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_potential_of_a_part_of_the_wave_is_final(seed):
    costs, potential = grid(seed), np.full((90, 90), np.inf, np.float32)
    assert wave_kernels.wave(costs, TABLE, (1, 1), (60, 40), potential, ALL, True)[2]
    assert potential[60, 40] == pytest.approx(exact_potential(costs, (1, 1), True)[60, 40], rel=1e-4)


def a_star(costs, start, target):
    total, parent = np.full(costs.shape, np.inf, np.float32), np.empty(costs.shape, np.int32)
    _, _, found = grid_search_kernels.search(costs, TABLE, start, target, ALL, total, parent)
    return float(total[target]) if found else math.inf


@pytest.mark.parametrize("seed", range(8))
def test_a_star_finds_the_cheapest_path(seed):
    costs = grid(seed)
    for start, target in (((1, 1), (88, 88)), ((88, 1), (1, 70)), ((2, 88), (2, 1))):
        assert a_star(costs, start, target) == pytest.approx(cheapest(costs, start, target), rel=1e-5)


def test_a_star_knows_that_there_is_no_path():
    costs = np.zeros((40, 60), np.uint8)
    costs[:, 30] = 254
    assert a_star(costs, (1, 1), (1, 58)) == cheapest(costs, (1, 1), (1, 58)) == math.inf


@pytest.mark.parametrize("seed", range(8))
def test_theta_star_is_never_more_expensive(seed):
    costs, start, target = grid(seed), (1, 1), (88, 88)
    potential = np.full(costs.shape, np.inf, np.float32)
    wave_kernels.wave(costs, TABLE, target, start, potential, ALL, True)
    total, parent = np.full(costs.shape, np.inf, np.float32), np.empty(costs.shape, np.int32)
    assert any_angle_kernels.search(costs, TABLE, start, target, potential, total, parent)[2]
    corners = any_angle_kernels.straighten(costs, TABLE, grid_search_kernels.path_back(parent, start, target))
    spent = sum(any_angle_kernels.straight_cost(costs, TABLE, *begin, *end)
                for begin, end in zip(corners[:-1], corners[1:]))
    assert spent <= 1.001 * a_star(costs, start, target) and tuple(corners[0]) == start and tuple(corners[-1]) == target


def test_a_line_longer_than_the_limit_becomes_one():
    costs = np.zeros((20, 400), np.uint8)
    corners = np.array([[2, 2], [4, 92], [6, 182], [6, 380]], np.int32)
    assert any_angle_kernels.straighten(costs, TABLE, corners).tolist() == [[2, 2], [6, 380]]
    costs[:6, 100] = 254
    around = np.array([[2, 2], [8, 92], [8, 182], [6, 380]], np.int32)
    assert len(any_angle_kernels.straighten(costs, TABLE, around)) == 3
