# SPDX-License-Identifier: BSD-3-Clause
"""Footprints are read without evaluating anything, refused with the reason, padded and measured."""
import math

import numpy as np
import pytest

from m2wr_navigation.costmap.footprint import FootprintError, checked, circle, padded, parse, placed, radii
from m2wr_navigation.costmap.footprint_kernels import (
    IN_COLLISION,
    IN_UNKNOWN,
    OUTSIDE,
    fill_polygon,
    outline_cost,
)

SQUARE = [[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]]


@pytest.mark.parametrize("value", [
    SQUARE, "[[-0.2,-0.1],[0.2,-0.1],[0.2,0.1],[-0.2,0.1]]", "[[-.2, -0.1], [2e-1, -.1], [0.2, .1], [-.2, 1e-1]]",
    "((-0.2,-0.1),(0.2,-0.1),(0.2,0.1),(-0.2,0.1))", SQUARE[::-1]])
def test_texts_and_lists_are_read_counter_clockwise(value):
    corners = parse(value)
    x, y = corners.T
    assert len(corners) == 4 and np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > 0
    assert sorted(map(tuple, corners.tolist())) == sorted(map(tuple, SQUARE))


@pytest.mark.parametrize("value, reason", [
    ("[]", "0 corners"), ([[0, 0], [1, 1]], "2 corners"), ([[0, 0], [1, 1], [1, 0], [0, 1]], "cross"),
    ([[0, 0], [1, 0], [2, 0]], "no area"), ("__import__('os')", "expected"), ([[0, 0], [1, 0], [1]], "two numbers"),
    ([[0, 0], [1, 0], ["a", 1]], "two numbers"), (7, "expected a list"), ([[0, 0], [1, 0], [1, 1e9]], "within"),
    ([[0, 0], [1, 0], [1, math.nan]], "within"), ("[[0,0],[1,0],[1,1]]; rm", "expected"),
    ([[0.1 * k, k * k] for k in range(2000)], "2000 corners")])
def test_an_unusable_footprint_is_refused_with_the_reason(value, reason):
    with pytest.raises(FootprintError, match=reason):
        parse(value)


def test_padding_moves_corners_outwards_by_their_signs():
    assert padded(np.array([[0.2, -0.1], [0.0, 0.3]]), 0.01) == pytest.approx(
        np.array([[0.21, -0.11], [0.0, 0.31]]))


def test_the_radii_are_those_of_the_sides_and_corners():
    inscribed, circumscribed = radii(checked(np.array(SQUARE)))
    assert inscribed == pytest.approx(0.1) and circumscribed == pytest.approx(math.hypot(0.2, 0.1))
    assert radii(circle(0.46)) == (pytest.approx(0.46 * math.cos(math.pi / 16)), pytest.approx(0.46))


def test_a_footprint_is_turned_and_moved():
    moved = placed(np.array([[1.0, 0.0]]), np.array([2.0, 3.0, 0.5 * math.pi]))
    assert moved[0] == pytest.approx([2.0, 4.0])


def cost_below(costs, x, y, yaw=0.0):
    return outline_cost(costs, 0.05, np.zeros(2), np.array(SQUARE), x, y, yaw)


def test_the_cost_of_an_outline_is_the_greatest_below_it():
    costs = np.zeros((40, 40), np.uint8)
    assert cost_below(costs, 1.0, 1.0) == 0
    costs[18, 20] = 77          # below the side at y = 0.9
    assert cost_below(costs, 1.0, 1.02) == 77
    costs[20, 20] = 254         # inside of it, not on it
    assert cost_below(costs, 1.0, 1.02) == 77


@pytest.mark.parametrize("value, answer", [(254, IN_COLLISION), (255, IN_UNKNOWN), (253, 253)])
def test_an_outline_tells_lethal_and_unknown_cells(value, answer):
    costs = np.zeros((40, 40), np.uint8)
    costs[:, 24] = value
    assert cost_below(costs, 1.02, 1.0) == answer and cost_below(costs, 0.5, 1.0) == 0


def test_an_outline_that_leaves_the_grid_is_outside():
    assert cost_below(np.zeros((40, 40), np.uint8), 0.1, 1.0) == OUTSIDE


def test_the_filled_cells_have_the_area_of_the_polygon():
    costs, corners = np.full((100, 100), 9, np.uint8), np.array([[0.5, 0.5], [4.0, 1.0], [3.0, 4.0], [2.0, 2.0]])
    x, y = corners.T
    area = 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    count = fill_polygon(costs, 0.05, np.zeros(2), corners, 0)
    assert count == (costs == 0).sum() and count * 0.05 ** 2 == pytest.approx(area, rel=0.02)


def test_a_polygon_beyond_the_grid_fills_only_its_part():
    corners = np.array([[-5.0, -5.0], [5.0, -5.0], [5.0, 0.5], [-5.0, 0.5]])
    assert fill_polygon(np.full((10, 10), 9, np.uint8), 0.1, np.zeros(2), corners, 0) == 50
