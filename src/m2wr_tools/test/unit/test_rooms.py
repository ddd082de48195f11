# SPDX-License-Identifier: BSD-3-Clause
"""Rooms: they fill their rectangle, and their walls have doors where rooms must be connected."""
import numpy as np
import pytest

from m2wr_tools.buildings.rooms import DOOR, POST, Rect, borders, enclose, split

WHOLE = Rect(0.0, 0.0, 20.0, 12.0)


@pytest.mark.parametrize("seed", range(5))
def test_rooms_fill_the_rectangle_and_have_the_least_size(seed):
    rooms = split(WHOLE, 3.0, np.random.default_rng(seed))
    assert sum(room.width * room.depth for room in rooms) == pytest.approx(240.0) and len(rooms) > 2
    assert all(min(room.width, room.depth) >= 3.0 - 1e-9 for room in rooms)


def test_borders_are_the_lines_that_two_rooms_share():
    left, low, high = Rect(0.0, 0.0, 2.0, 4.0), Rect(2.0, 0.0, 5.0, 1.5), Rect(2.0, 1.5, 5.0, 4.0)
    found = {(line.first, line.second): line for line in borders([left, low, high])}
    assert set(found) == {(0, 1), (0, 2), (1, 2)}
    assert found[0, 2].vertical and (found[0, 2].at, found[0, 2].low, found[0, 2].high) == (2.0, 1.5, 4.0)
    assert not found[1, 2].vertical and found[1, 2].wall(2.5, 3.0) == (2.5, 1.5, 3.0, 1.5)


def length(walls):
    return sum(np.hypot(x1 - x0, y1 - y0) for x0, y0, x1, y1 in walls)


@pytest.mark.parametrize("seed", range(10))
def test_rooms_without_random_doors_are_connected(seed):
    rooms = [Rect(0.0, 0.0, 4.0, 4.0), Rect(4.0, 0.0, 8.0, 4.0)]
    walls = enclose(rooms, [False] * 2, [False] * 2, (0.0, 0.0), np.random.default_rng(seed))
    between = [wall for wall in walls if wall[0] == wall[2] == 4.0]
    assert 4.0 - DOOR[1] <= length(between) <= 4.0 - DOOR[0]
    assert min(length([wall]) for wall in between) >= POST - 1e-9


def test_corridors_are_open_and_solid_blocks_have_no_door():
    rooms = [Rect(0.0, 0.0, 4.0, 2.0), Rect(4.0, 0.0, 8.0, 2.0), Rect(0.0, 2.0, 8.0, 6.0)]
    walls = enclose(rooms, [True, True, False], [False, False, True], (1.0, 1.0), np.random.default_rng(1))
    assert not [wall for wall in walls if wall[0] == wall[2] == 4.0]
    assert length([wall for wall in walls if wall[1] == wall[3] == 2.0]) == pytest.approx(8.0)
