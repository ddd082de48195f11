# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from localization_room import room, scan
from m2wr_navigation.localization import place_kernels as kernels
from m2wr_navigation.localization.beams import Beams, ScanGeometry
from m2wr_navigation.localization.localization_map import LocalizationMap

APART = np.array([0.5, 0.3])


def agreement(grid, beams, *poses):
    """How well a scan agrees with poses."""
    blocked, free = grid.clear_distance()
    out = np.empty(len(poses))
    kernels.agreement(grid.to_grid(np.array(poses)), beams.mount, beams.polar, beams.reach, blocked, free,
                      grid.occupied, grid.resolution, 0.1, 0.1, out)
    return out


def test_poses_apart_in_place_or_heading_are_places():
    poses = np.array([(0.0, 0.0, 3.1), (0.1, 0.1, -3.1), (0.0, 0.0, 2.0), (2.0, 0.0, 3.1), (2.1, 0.0, 3.0)])
    places = np.empty((10, 3))
    assert kernels.distinct(poses, places, 0, APART) == 3
    np.testing.assert_array_equal(places[:3], poses[[0, 2, 3]])


def test_no_more_places_than_there_is_room_for():
    places = np.zeros((2, 3))
    assert kernels.distinct(np.array([(5.0, 0.0, 0.0), (9.0, 0.0, 0.0)]), places, 1, APART) == 2
    np.testing.assert_array_equal(places[:, 0], [0.0, 5.0])


def test_each_pose_finds_its_nearest_place_or_none():
    places = np.array([(0.0, 0.0, 0.0), (0.4, 0.0, 0.1), (3.0, 0.0, 2.0)])
    poses = np.array([(0.1, 0.0, 0.0), (0.3, 0.0, 0.0), (3.0, 0.1, -2.0), (9.0, 0.0, 0.0)])
    owner = np.empty(4, np.int64)
    kernels.nearest(poses, places, APART, owner)
    assert owner.tolist() == [0, 1, -1, -1]


@pytest.mark.parametrize("away", [(0.4, 0.0, 0.0), (0.0, -0.4, 0.0), (0.0, 0.0, 0.2), (2.0, 0.5, 3.0)])
def test_ranges_agree_best_at_the_true_place(away):
    grid, true = room(), np.array([1.2, 2.0, 0.7])
    beams = scan(true)
    out = agreement(grid, beams, true, true + away)
    assert out[0] > -0.2 * beams.polar.shape[1] and out[1] < out[0] - 0.3 * beams.polar.shape[1]


LEVEL = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
STEP = 2.0 * np.pi / 90


@pytest.mark.parametrize("beyond", [-1, None])
def test_what_leaves_the_known_map_contradicts_nothing(beyond):
    # a wall on the left, and nothing else; 1 m on the right the map ends, or is unknown from there on
    cells = np.zeros((80, 60), np.int8)
    cells[:, :2] = 100
    if beyond is None:
        cells = cells[:, :42]
    else:
        cells[:, 42:] = beyond
    grid = LocalizationMap(cells, 0.05, (0.0, 0.0, 0.0))
    angles = np.linspace(-np.pi, np.pi, 90, endpoint=False)
    lengths = np.where(np.abs(np.abs(angles) - np.pi) < 0.9, -1.0 / np.minimum(np.cos(angles), -0.1), np.inf)
    geometry = ScanGeometry(-np.pi, STEP, 0.05, 1.7)
    for steps in (0, 4, 16):                    # the rounding of beams without return depends on their direction
        pose, seen = np.array([1.1, 2.0, steps * STEP]), np.roll(lengths, -steps)
        assert agreement(grid, Beams.from_scan(seen, geometry, LEVEL), pose)[0] > -0.03 * 90
        behind = Beams.from_scan(np.where(np.isinf(seen), 1.6, seen), geometry, LEVEL)
        assert agreement(grid, behind, pose)[0] < -0.25 * 90


def test_a_wall_of_corners_is_a_wall():
    cells = np.zeros((40, 40), np.int8)
    cells[:, 20:] = -1
    cells[np.arange(40), 19 + np.arange(40) % 2] = 100      # diagonal neighbours only
    grid = LocalizationMap(cells, 0.05, (0.0, 0.0, 0.0))
    beams = Beams.from_scan(np.full(41, 3.0), ScanGeometry(-0.2, 0.01, 0.05, 2.9), LEVEL)
    assert not beams.hit.any()
    assert agreement(grid, beams, np.array([0.3, 1.0, 0.0]))[0] < 41 * np.log(0.2)
