# SPDX-License-Identifier: BSD-3-Clause
"""The visibility graph gives the exact shortest path."""
import math

import numpy as np
import pytest

from m2wr_navigation.planners.visibility_kernels import corners, sees, shortest


def grid(*rows):
    return np.array([[cell == "#" for cell in row] for row in rows], np.uint8)


def test_without_obstacles_the_path_is_straight():
    path, length = shortest(np.zeros((5, 9), np.uint8), (0, 0), (3, 4))
    assert length == pytest.approx(5.0) and len(path) == 2


def test_around_a_block_the_path_turns_at_its_corners():
    blocked = np.zeros((9, 9), np.uint8)
    blocked[0:6, 4] = 1
    path, length = shortest(blocked, (0, 2), (0, 6))
    # centre (0.5, 2.5) to the corners (6, 4) and (6, 5)
    assert length == pytest.approx(2.0 * math.hypot(5.5, 1.5) + 1.0)
    assert path[1:3].tolist() == [[12, 8], [12, 10]]


def test_no_path_has_infinite_length():
    blocked = np.zeros((5, 5), np.uint8)
    blocked[:, 2] = 1
    path, length = shortest(blocked, (2, 0), (2, 4))
    assert length == math.inf and len(path) == 0


def test_only_convex_corners_are_nodes():
    found = {tuple(corner) for corner in corners(grid("....", ".##.", ".#..", "....")).tolist()}
    assert found == {(2, 2), (2, 6), (6, 2), (6, 4), (4, 6)}


@pytest.mark.parametrize("ends, free", [
    ((1, 1, 1, 7), False), ((0, 0, 0, 8), False), ((0, 0, 0, 2), True), ((2, 2, 2, 4), True),
    ((1, 1, 3, 3), True), ((4, 0, 4, 8), True),
    ((3, 1, 1, 7), False), ((0, 4, 4, 4), False), ((0, 6, 4, 6), True)])
def test_a_line_is_free_unless_it_enters_a_blocked_cell(ends, free):
    blocked = np.zeros((4, 4), np.uint8)
    blocked[0, 2] = blocked[0, 1] = 1
    assert sees(blocked, *ends) == free == sees(blocked, *ends[2:], *ends[:2])


def test_sight_agrees_with_points_along_the_line():
    rng, blocked = np.random.default_rng(3), np.zeros((12, 12), np.uint8)
    blocked[rng.integers(0, 12, 25), rng.integers(0, 12, 25)] = 1
    seen = 0
    for _ in range(400):
        ends = 2 * rng.integers(0, 12, 4) + 1           # centres: no line along a side of cells
        along = np.linspace(0.0, 1.0, 2001)[:, None]
        points = 0.5 * (ends[:2] + along * (ends[2:] - ends[:2]))
        inside = np.abs(points - np.rint(points)).min(1) > 1e-3        # not on a side
        cells = np.floor(points[inside]).astype(int)
        if len(cells):
            assert sees(blocked, *ends) == (not blocked[cells[:, 0], cells[:, 1]].any()), ends
            seen += 1
    assert seen > 300
