# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from m2wr_navigation.localization.field_kernels import distance_transform, quantise, visible_surface


@pytest.mark.parametrize("share", [0.0005, 0.02, 0.6])
def test_distances_are_those_of_scipy(share):
    occupied = np.random.default_rng(3).random((70, 110)) < share
    out = np.empty(occupied.shape, np.float32)
    distance_transform(occupied, 40.0, out)
    np.testing.assert_allclose(out, np.minimum(distance_transform_edt(~occupied), 40.0), atol=1e-5)


def test_without_obstacles_all_cells_are_at_the_limit():
    out = np.empty((5, 7), np.float32)
    distance_transform(np.zeros((5, 7), bool), 12.0, out)
    assert (out == 12.0).all()


@pytest.mark.parametrize("right, up, column", [(True, True, 3), (False, True, 5)])
def test_beams_end_at_the_side_they_come_from(right, up, column):
    occupied = np.zeros((9, 9), bool)
    occupied[:, 3:6] = True             # a wall from bottom to top, three cells thick
    out = np.empty((9, 9), bool)
    assert visible_surface(occupied, ~occupied, right, up, out) == 9
    assert out[:, column].all() and out.sum() == 9


def test_a_surface_next_to_unknown_space_is_not_seen():
    occupied, free = np.zeros((3, 3), bool), np.zeros((3, 3), bool)
    occupied[1, 1] = True
    out = np.empty((3, 3), bool)
    assert visible_surface(occupied, free, True, True, out) == 0


def test_steps_are_rounded_and_end_at_255():
    out = np.empty((1, 3), np.uint8)
    quantise(np.array([[0.0, 1.26, 999.0]], np.float32), 0.5, out)
    assert out.tolist() == [[0, 3, 255]]
