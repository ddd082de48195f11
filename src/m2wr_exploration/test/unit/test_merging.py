# SPDX-License-Identifier: BSD-3-Clause
"""Maps on each other, with known poses."""
import math

import numpy as np
import pytest

from exploration_grids import grid
from m2wr_exploration.team.merging import merge
from m2wr_navigation.costmap.costmap import Costmap


def test_what_one_map_knows_the_merged_one_knows():
    merged = merge([grid("#.??"), grid("??.#")], [np.zeros(3)] * 2)
    assert merged.costs.tolist() == [[254, 0, 0, 254]]


def test_an_obstacle_in_one_map_stays():
    assert merge([grid("..#"), grid(".#.")], [np.zeros(3)] * 2).costs.tolist() == [[0, 254, 254]]


def test_a_shifted_and_rotated_map_lies_where_it_belongs():
    merged = merge([grid("...")], [np.array([1.0, 0.0, 0.5 * math.pi])])
    assert merged.shape == (3, 1) and merged.origin == pytest.approx((0.5, 0.0))
    assert (merged.costs == 0).all()


def test_a_rotated_wall_has_no_holes():
    costs = np.full((40, 40), 0, np.uint8)
    costs[20] = 254
    source = Costmap(costs, 0.05, np.zeros(2), "map")
    merged = merge([source], [np.array([0.0, 0.0, 0.7])])
    rows, columns = np.nonzero(merged.costs == 254)
    assert len(set(columns.tolist())) >= int(2.0 * math.cos(0.7) / 0.05) - 1 and len(rows) >= 40


@pytest.mark.parametrize("poses, words", [
    ([], "at least one map"), ([np.array([np.nan, 0.0, 0.0])], "not finite"), ([np.array([1e9, 0.0, 0.0])], "")])
def test_poses_that_cannot_be_used_are_told(poses, words):
    if words:
        with pytest.raises(ValueError, match=words):
            merge([grid(".")], poses)
    else:
        with pytest.raises(ValueError, match="expected at most"):
            merge([grid("."), grid(".")], [np.zeros(3)] + poses)
