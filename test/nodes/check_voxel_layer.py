#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A VoxelLayer in costmap_2d_node: its topics, its parameters, and what messages that are not numbers do."""
import math
import os
import sys
import unittest

import numpy as np
import rospy
from costmap_2d.msg import VoxelGrid
from dynamic_reconfigure.client import Client
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan, PointCloud, PointCloud2, PointField

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, run_checks, wait_until, xyz  # noqa: E402

PATIENCE = 120.0            # s of wall time in which the node starts, also on a busy machine
LAYER = "/costmap_node/costmap/voxels"
ROBOT = 1.05, 0.55          # m: in the middle of a cell
TABLE = (1.0, 0.0, 0.7)     # of the camera's cloud, in front of the robot [m]
WALL = 2.0                  # m in front of the laser


def cloud(points):
    """A cloud of points in front of the robot, as a camera 2.5 m above the floor sees it."""
    rows = (np.array(points, np.float32).reshape(-1, 3) - np.array([0.0, 0.0, 2.5], np.float32)).astype(np.float32)
    message = PointCloud2(height=1, width=len(rows), point_step=12, row_step=12 * len(rows), data=rows.tobytes())
    message.fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate("xyz")]
    message.header.frame_id = "camera"
    return message


def scan(ranges):
    """A scan of three beams to the front."""
    message = LaserScan(angle_min=-0.01, angle_max=0.01, angle_increment=0.01, range_min=0.1, range_max=10.0,
                        ranges=ranges)
    message.header.frame_id = "laser"
    return message


class VoxelLayer(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.scans = rospy.Publisher("scan", LaserScan, queue_size=1)
        cls.clouds = rospy.Publisher("cloud", PointCloud2, queue_size=1)
        cls.grids = Recorder(LAYER + "/voxel_grid", VoxelGrid)
        cls.ends = Recorder(LAYER + "/clearing_endpoints", PointCloud)
        cls.costs = Recorder("/costmap_node/costmap/costmap", OccupancyGrid)
        wait_until(lambda: cls.scans.get_num_connections() and cls.clouds.get_num_connections(), "the layer", PATIENCE)
        for each in (cls.grids, cls.ends, cls.costs):
            each.connected()

    def send(self, points, ranges):
        self.clouds.publish(cloud(points))
        self.scans.publish(scan(ranges))

    def column(self, message, x, y):
        """Marked and not known to be free voxels of a column at a place in front of the robot, as bits."""
        column = int((x + ROBOT[0] - message.origin.x) / message.resolutions.x)
        row = int((y + ROBOT[1] - message.origin.y) / message.resolutions.y)
        bits = message.data[row * message.size_x + column]
        return bits >> 16, bits & (1 << message.size_z) - 1

    def cost(self, message, x, y):
        info = message.info
        column, row = (int((place - corner) / info.resolution) for place, corner in (
            (x + ROBOT[0], info.origin.position.x), (y + ROBOT[1], info.origin.position.y)))
        return message.data[row * info.width + column]

    def wait_for_cost(self, expected):
        self.costs.clear()
        self.costs.wait(lambda messages: self.cost(messages[-1], *TABLE[:2]) == expected,
                        "cost %d at the table" % expected)

    def test_1_values_that_make_no_grid_are_replaced(self):
        self.assertEqual((rospy.get_param(LAYER + "/z_voxels"), rospy.get_param(LAYER + "/z_resolution")), (16, 0.2))

    def test_2_a_table_stays_above_the_rays_of_a_laser(self):
        self.send([TABLE], [WALL] * 3)
        grid = self.grids.wait(lambda messages: next((each for each in messages if self.column(each, *TABLE[:2])
                                                      == (1 << 3, 0xFFFF & ~(1 << 1))), None), "the column")
        self.assertEqual((grid.header.frame_id, grid.size_x, grid.size_y, grid.size_z), ("odom", 60, 60, 16))
        for found, expected in zip((*xyz(grid.origin), *xyz(grid.resolutions)), (-2.0, -2.5, 0.0, 0.1, 0.1, 0.2)):
            self.assertAlmostEqual(found, expected, 5)
        self.wait_for_cost(100)

    def test_3_rays_end_two_cells_before_the_wall(self):
        self.ends.clear()
        self.send([TABLE], [WALL, math.nan, WALL])
        cloud_of_ends = self.ends.wait(
            lambda messages: next((each for each in messages if len(each.points) == 2), None), "the ends of two rays")
        self.assertEqual(cloud_of_ends.header.frame_id, "odom")
        for place in cloud_of_ends.points:
            self.assertAlmostEqual(math.hypot(place.x - ROBOT[0], place.y - ROBOT[1]), WALL - 0.2, 4)
            self.assertAlmostEqual(place.z, 0.3, 4)

    def test_4_points_that_are_not_numbers_change_nothing(self):
        bad = [[math.nan, 0.0, 0.7], [1.0, math.inf, 0.7], [0.5, 0.05, math.nan]]
        self.send([*bad, TABLE, (1.0, 0.5, 0.7)], [WALL, math.inf, -math.inf])
        grid = self.grids.wait(
            lambda messages: next((each for each in messages if self.column(each, 1.0, 0.5)[0]), None),
            "the mark of the last point")
        self.assertEqual(self.column(grid, *TABLE[:2])[0], 1 << 3)
        marked = np.array(grid.data, np.uint32) >> 16
        self.assertLessEqual((marked > 0).sum(), 2 + 3)         # two points, and the wall where beams meet it

    def test_5_other_parameters_hold_at_once(self):
        client = Client(LAYER, timeout=PATIENCE)
        self.send([TABLE], [WALL] * 3)
        for threshold, expected in ((2, 0), (0, 100)):
            client.update_configuration({"mark_threshold": threshold})
            self.wait_for_cost(expected)
        client.update_configuration({"z_voxels": 3})            # up to 0.6 m: the table is above
        self.wait_for_cost(0)
        self.grids.wait(lambda messages: messages[-1].size_z == 3, "a grid of three voxels")
        client.update_configuration({"z_voxels": 16})
        self.wait_for_cost(100)


if __name__ == "__main__":
    rospy.init_node("voxel_layer")
    run_checks("voxel_layer", VoxelLayer)
