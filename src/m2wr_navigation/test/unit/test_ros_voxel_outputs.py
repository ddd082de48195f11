# SPDX-License-Identifier: BSD-3-Clause
"""Columns and ray ends are written so that the standard classes and the viewers read them."""
import io

import numpy as np
import pytest
import roslib.message
import rospy
from sensor_msgs.msg import PointCloud

from layer_scene import MIDDLE, costmap, laser, layer, see
from m2wr_navigation.ros.voxel_outputs import KIND, ArrayCloud, array_grid, grid_message
from m2wr_navigation.ros.voxel_viewers import cells_of

STAMP = rospy.Time(5, 6)


def sent(message, kind):
    stream = io.BytesIO()
    message.serialize(stream)
    return kind().deserialize(stream.getvalue())


def test_a_grid_is_read_by_the_standard_class_and_the_viewers():
    made = layer("VoxelLayer", origin_z=0.1, z_resolution=0.25, z_voxels=4, footprint_clearing_enabled=False)
    made.sources["laser"] = laser()
    whole = costmap(made, size=(6.0, 5.0), origin=(0.5, 1.0))
    see(made.sources["laser"], 0.0, [[5.05, 3.05, 0.4]])
    whole.update(MIDDLE, 0.0)
    kind = roslib.message.get_message_class(KIND)
    read = sent(grid_message(array_grid(kind), made, "odom", STAMP), kind)
    assert (read.size_x, read.size_y, read.size_z, len(read.data)) == (60, 50, 4, 3000)
    assert (read.header.frame_id, read.header.stamp) == ("odom", STAMP)
    assert (read.origin.x, read.origin.y, read.origin.z) == pytest.approx((0.5, 1.0, 0.1))
    assert (read.resolutions.x, read.resolutions.y, read.resolutions.z) == (0.1, 0.1, 0.25)
    marked, unknown = cells_of(read)
    assert marked == pytest.approx(np.array([[5.05, 3.05, 0.475]])) and len(unknown) == 4 * 3000 - 1 - 19


def test_ray_ends_are_read_by_the_standard_class():
    points = np.array([[1.0, 2.0, 0.5], [-1.0, 0.25, 3.0]])
    message = ArrayCloud(points=points)
    message.header.frame_id, message.header.stamp = "odom", STAMP
    read = sent(message, PointCloud)
    assert (read.header.frame_id, read.header.stamp, list(read.channels)) == ("odom", STAMP, [])
    assert [(point.x, point.y, point.z) for point in read.points] == [tuple(row) for row in points.tolist()]
    assert sent(ArrayCloud(points=np.zeros((0, 3))), PointCloud).points == []
