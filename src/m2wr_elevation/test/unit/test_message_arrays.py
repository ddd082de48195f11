# SPDX-License-Identifier: BSD-3-Clause
"""Contents of messages: what is inside comes back, and what is malformed is refused with its reason."""
import math

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2, PointField

from m2wr_elevation.message_arrays import MOST_POINTS, layer_data, occupancy, points_of, surface


def cloud(points, **changes):
    data = np.zeros(len(points), np.dtype([("pad", "<u2"), ("x", "<f4"), ("y", "<f4"), ("z", "<f4")]))
    for axis, name in enumerate("xyz"):
        data[name] = points[:, axis]
    message = PointCloud2(height=1, width=len(points), point_step=data.itemsize, data=data.tobytes(), fields=[
        PointField(name, 2 + 4 * axis, PointField.FLOAT32, 1) for axis, name in enumerate("xyz")])
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def test_points_come_back():
    points = np.arange(12.0).reshape(4, 3)
    np.testing.assert_array_equal(points_of(cloud(points)), points)
    assert points_of(cloud(points[:0])).shape == (0, 3)


@pytest.mark.parametrize("changes, told", [
    ({"data": b"123"}, "3 bytes for 4 points"), ({"is_bigendian": True}, "big-endian"),
    ({"point_step": 0}, "of 0 bytes"),
    ({"width": MOST_POINTS + 1}, "at most"), ({"fields": []}, "no field x"), ({"point_step": 12}, "no field z"),
    ({"fields": [PointField(name, 0, PointField.INT8, 1) for name in "xyz"]}, "no field x"),
    ({"fields": [PointField(name, 4000000000, PointField.FLOAT32, 1) for name in "xyz"]}, "no field x")])
def test_malformed_clouds_are_refused(changes, told):
    with pytest.raises(ValueError, match=told):
        points_of(cloud(np.zeros((4, 3)), **changes))


def test_layers_are_in_the_order_of_grid_map():
    layer = np.arange(6.0).reshape(2, 3)
    data = layer_data(layer)
    for i in range(3):              # along x, from the greatest
        for j in range(2):          # along y
            assert data[j * 3 + i] == layer[1 - j, 2 - i]


def test_costs_of_an_occupancy_grid():
    assert occupancy(np.array([[1.0, 0.5, 1e-6, 0.0, math.nan]])).tolist() == [[0, 50, 99, 100, -1]]


def test_the_surface_has_two_triangles_for_each_four_known_cells():
    height = np.zeros((4, 5))
    height[0, 0] = math.nan
    corners, colours = surface(height, np.ones((4, 5)), (1.0, 2.0), 0.1)
    assert len(corners) == len(colours) == 3 * 2 * 11 and np.all(np.isfinite(corners))
    assert corners[:, 0].min() == pytest.approx(1.05) and corners[:, 1].max() == pytest.approx(2.35)
    normals = np.cross(corners[1::3] - corners[::3], corners[2::3] - corners[::3])
    assert np.all(normals[:, 2] > 0.0)
    assert len(surface(np.zeros((300, 300)), np.ones((300, 300)), (0.0, 0.0), 0.1)[0]) <= 60000
