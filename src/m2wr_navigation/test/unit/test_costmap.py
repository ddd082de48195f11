# SPDX-License-Identifier: BSD-3-Clause
"""Cells and points of a costmap."""
import numpy as np
import pytest

from m2wr_navigation.costmap.costmap import Costmap


@pytest.fixture
def costmap():
    return Costmap.filled((4, 6), 0.5, (-1.0, 2.0), 7)


@pytest.mark.parametrize("point, cell", [
    ((-1.0, 2.0), (0, 0)), ((-0.51, 2.49), (0, 0)), ((-0.49, 2.51), (1, 1)), ((1.99, 3.99), (3, 5)),
    ((2.0, 3.0), None), ((0.0, 4.0), None), ((-1.01, 3.0), None), ((float("nan"), 3.0), None),
    ((0.0, float("inf")), None)])
def test_a_point_is_in_its_cell_or_outside(costmap, point, cell):
    assert costmap.cell(*point) == cell


def test_the_centre_of_a_cell_is_half_a_cell_from_its_corner(costmap):
    assert costmap.centre(0, 0) == (-0.75, 2.25)
    assert costmap.cell(*costmap.centre(3, 5)) == (3, 5)


def test_many_points_give_the_cells_of_single_ones(costmap):
    points = np.random.default_rng(1).uniform((-1.0, 2.0), (2.0, 4.0), (50, 2))
    assert [tuple(cell) for cell in costmap.cells(points)] == [costmap.cell(*point) for point in points]


def test_a_copy_shares_no_memory(costmap):
    other = costmap.copy()
    other.costs[0, 0], other.origin[0] = 9, 5.0
    assert costmap.costs[0, 0] == 7 and costmap.origin[0] == -1.0


def test_the_cost_of_a_point_outside_is_none(costmap):
    assert costmap.cost_at(0.0, 3.0) == 7 and costmap.cost_at(9.0, 3.0) is None
