# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from localization_room import CELL, room
from m2wr_navigation.localization.localization_map import LocalizationMap, MapError


def test_random_poses_lie_in_free_cells_and_all_headings():
    grid = room(0.4, (3.0, -2.0))
    poses = grid.random_poses(5000, np.random.default_rng(0))
    placed = grid.to_grid(poses)
    cells = np.floor(placed[:, :2]).astype(int)
    assert (grid.cells[cells[:, 1], cells[:, 0]] == 0).all()
    assert np.histogram((poses[:, 2] - 0.4) % (2 * math.pi), 8, (0.0, 2 * math.pi))[0].min() > 500


def test_poses_return_from_the_grid():
    grid = room(-1.2, (0.5, 0.7))
    poses = np.array([[1.0, 2.0, 3.0], [-4.0, 0.5, -1.0]])
    np.testing.assert_allclose(grid.from_grid(grid.to_grid(poses)), poses, atol=1e-12)


def test_fields_have_the_distance_to_the_side_a_beam_comes_from():
    fields = room().fields(2.0)
    # row at y = 2 m: the left wall's front is cell 3, its back next to nothing known
    row = int(2.0 / CELL)
    towards_left = fields[row, :, 1].astype(float) * 2.0 / 255.0
    np.testing.assert_allclose(towards_left[3:13], CELL * np.arange(10), atol=0.005)


def test_a_map_of_solid_cells_only_uses_all_of_them():
    cells = np.full((4, 4), 100, np.int8)
    cells[0, 0], cells[0, 1] = 0, -1
    grid = LocalizationMap.from_message(cells.ravel(), 4, 4, 0.1, (0.0, 0.0, 0.0))
    assert (grid.fields(1.0) == 0).any()


@pytest.mark.parametrize("data, size, resolution, origin, words", [
    (np.zeros(5, np.int8), (2, 3), 0.1, (0.0, 0.0, 0.0), "with 5 values"),
    (np.zeros(0, np.int8), (0, 0), 0.1, (0.0, 0.0, 0.0), "0 x 0 cells"),
    (np.zeros(6, np.int8), (2, 3), 0.0, (0.0, 0.0, 0.0), "resolution"),
    (np.zeros(6, np.int8), (2, 3), math.nan, (0.0, 0.0, 0.0), "resolution"),
    (np.zeros(6, np.int8), (2, 3), 0.1, (math.nan, 0.0, 0.0), "origin"),
    (np.full(6, 100, np.int8), (2, 3), 0.1, (0.0, 0.0, 0.0), "none of its 6 cells is free")])
def test_unusable_maps_are_refused_with_reason(data, size, resolution, origin, words):
    with pytest.raises(MapError, match=words):
        LocalizationMap.from_message(data, size[0], size[1], resolution, origin)
