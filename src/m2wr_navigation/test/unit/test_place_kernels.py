# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from localization_room import room, scan
from m2wr_navigation.localization import place_kernels as kernels

APART = np.array([0.5, 0.3])


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
    beams, out = scan(true), np.empty(2)
    blocked, free = grid.clear_distance()
    kernels.agreement(grid.to_grid(np.array([true, true + away])), beams.mount, beams.polar, beams.reach, blocked, free,
                      grid.resolution, 0.1, 0.1, out)
    assert out[0] > -0.2 * beams.polar.shape[1] and out[1] < out[0] - 0.3 * beams.polar.shape[1]
