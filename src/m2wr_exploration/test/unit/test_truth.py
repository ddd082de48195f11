# SPDX-License-Identifier: BSD-3-Clause
"""How well the walls of a map agree with the true ones."""
import numpy as np
import pytest

from exploration_grids import grid
from m2wr_exploration.study.truth import wall_shares

ROOM = grid("""
########
#......#
#......#
#......#
########""", 0.05)


def known(costs):
    return type(ROOM)(costs, ROOM.resolution, ROOM.origin.copy(), "map")


def test_the_truth_agrees_with_itself():
    assert wall_shares(ROOM, known(ROOM.costs.copy())) == (1.0, 1.0)


def test_a_map_without_walls_draws_none():
    assert wall_shares(ROOM, known(np.where(ROOM.costs == 254, 255, ROOM.costs).astype(np.uint8))) == (1.0, 0.0)
    assert wall_shares(ROOM, known(np.full(ROOM.shape, 255, np.uint8))) == (1.0, 1.0)       # nothing is known


def test_walls_that_are_wrong_or_missing_lower_the_shares():
    costs = ROOM.costs.copy()
    costs[2, 3] = 254                   # two cells from each wall
    right, drawn = wall_shares(ROOM, known(costs))
    assert right == pytest.approx(1.0 - 1.0 / np.count_nonzero(costs == 254)) and drawn == 1.0
    costs = ROOM.costs.copy()
    costs[:, 0] = 255
    right, drawn = wall_shares(ROOM, known(costs))
    assert right == 1.0 and 0.5 < drawn < 1.0
