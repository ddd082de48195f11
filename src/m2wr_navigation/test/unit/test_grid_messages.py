# SPDX-License-Identifier: BSD-3-Clause
"""Messages written from arrays are those that the standard classes read."""
import io
import struct

import numpy as np
import rospy
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid

from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.layer import Window
from m2wr_navigation.ros.grid_messages import OCCUPANCY, cloud_message, grid_message, potential_points, update_message

STAMP = rospy.Time(5, 6)


def costmap():
    costs = np.arange(256, dtype=np.uint8).reshape(8, 32)
    return Costmap(costs, 0.5, np.array([1.0, 2.0]), "odom")


def sent(message, kind):
    stream = io.BytesIO()
    message.serialize(stream)
    return kind().deserialize(stream.getvalue())


def test_costs_become_occupancy_by_the_formula_of_costmap_2d():
    assert OCCUPANCY[[0, 1, 2, 252, 253, 254, 255]].tolist() == [0, 1, 1, 98, 99, 100, -1]
    assert all(OCCUPANCY[c] == 1 + (97 * (c - 1)) // 251 for c in range(1, 253))


def test_a_whole_grid_is_read_by_the_standard_class():
    read = sent(grid_message(costmap(), STAMP), OccupancyGrid)
    assert (read.info.width, read.info.height, read.info.resolution) == (32, 8, 0.5)
    assert (read.info.origin.position.x, read.info.origin.position.y, read.header.frame_id) == (1.0, 2.0, "odom")
    assert list(read.data) == OCCUPANCY.tolist()


def test_a_window_is_read_by_the_standard_class():
    read = sent(update_message(costmap(), Window(2, 4, 5, 8), STAMP), OccupancyGridUpdate)
    assert (read.x, read.y, read.width, read.height) == (5, 2, 3, 2)
    assert list(read.data) == [OCCUPANCY[32 * row + column] for row in (2, 3) for column in (5, 6, 7)]


def test_a_cloud_has_its_fields_in_order():
    message = cloud_message([[1, 2, 3, 4]], ["x", "y", "z", "pot"], "map", STAMP)
    assert [(field.name, field.offset) for field in message.fields] == [("x", 0), ("y", 4), ("z", 8), ("pot", 12)]
    assert struct.unpack("<4f", message.data) == (1, 2, 3, 4) and message.width == 1


def test_points_of_a_potential_are_the_centres_of_its_cells():
    potential = np.full((8, 32), np.inf, np.float32)
    potential[2, 3] = 7.0
    assert potential_points(costmap(), potential).tolist() == [[2.75, 3.25, 0.0, 7.0]]
