# SPDX-License-Identifier: BSD-3-Clause
"""The corridor of a large grid never loses a passage, has no leaks, and holds a path that is nearly the best."""
import numpy as np
import pytest

from m2wr_navigation.planners import wave_kernels
from m2wr_navigation.planners.corridor_kernels import corridor, label_parts, part_of
from m2wr_navigation.planners.planner import cost_table
from planner_grids import blocks, inflated

TABLE = cost_table(50.0, 0.8, True)


def potential_at(costs, start, target, allowed=None):
    potential = np.full(costs.shape, np.inf, np.float32)
    allowed = np.zeros((0, 0), np.uint8) if allowed is None else allowed
    wave_kernels.wave(costs, TABLE, target, start, potential, allowed, True)
    return potential[start]


@pytest.mark.parametrize("seed", range(8))
def test_the_path_of_the_corridor_is_nearly_the_best(seed):
    costs = inflated(blocks(203, 60, seed), 0.3, 0.06)
    costs[1, 1] = costs[200, 200] = 0
    allowed, found = corridor(costs, TABLE, (1, 1), (200, 200), 3)
    best = potential_at(costs, (1, 1), (200, 200))
    assert found and (allowed == 0).sum() > 200
    assert best <= potential_at(costs, (1, 1), (200, 200), allowed) <= 1.03 * best


@pytest.mark.parametrize("seed", range(8))
def test_start_and_target_are_connected_as_in_the_grid(seed):
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((61, 83)) < 0.42, 254, 0).astype(np.uint8)
    free = np.argwhere(costs == 0)
    start = tuple(int(value) for value in free[len(free) // 2])
    reached, _ = wave_kernels.connected(costs, TABLE, start)
    for cell in free[::9]:
        target = int(cell[0]), int(cell[1])
        assert corridor(costs, TABLE, start, target, 1)[1] == bool(reached[target]), (start, target)


def test_a_wall_of_one_cell_and_a_gap_of_one_cell_are_seen():
    costs = np.zeros((80, 80), np.uint8)
    costs[:, 43] = 254
    assert not corridor(costs, TABLE, (40, 40), (40, 47), 2)[1]
    costs[77, 43] = 0
    allowed, found = corridor(costs, TABLE, (40, 40), (40, 47), 2)
    assert found and potential_at(costs, (40, 40), (40, 47), allowed) < np.inf


def test_parts_of_a_block_are_told_apart():
    costs = np.zeros((16, 16), np.uint8)
    costs[3, :8] = 254
    first, labels, parts = label_parts(costs, TABLE, (15, 15), (15, 14))
    of = [part_of(first, labels, parts, costs, TABLE, *cell) for cell in ((0, 0), (7, 7), (3, 3), (0, 8), (20, 0))]
    assert of[0] != of[1] and of[2] == -1 and of[3] not in of[:2] and of[4] == -1
    assert parts[of[3], 3] == 1.0 and parts[of[0], 3] == 0.0
