#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A costmap, and planners with costmaps of their own, started by the names of costmap_2d, navfn, global_planner."""
import math
import os
import sys
import unittest

import numpy as np
import rospy
from costmap_2d.msg import VoxelGrid
from geometry_msgs.msg import PoseStamped, Vector3
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetPlan
from navfn.srv import MakeNavPlan
from sensor_msgs.msg import PointCloud
from visualization_msgs.msg import Marker

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, run_checks, wait_until  # noqa: E402

PATIENCE = 120.0            # s of wall time in which all nodes start, also on a busy machine
#: Sums of the definitions that clients and bags carry.
SUMS = {VoxelGrid: "48a040827e1322073d78ece5a497029c", MakeNavPlan: "8ffef29bc8b086289124c16a8daa989d"}


def wall():
    """A room of 8 x 6 m with a wall from below; a closed chamber at the top right."""
    cells = np.zeros((120, 160), np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 100, 100, 100, 100
    cells[:80, 78:82] = 100
    cells[80:, 118:122], cells[78:82, 118:] = 100, 100
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.resolution, message.info.width, message.info.height = 0.05, 160, 120
    message.info.origin.orientation.w = 1.0
    message.data = cells.ravel().tolist()
    return message


def at(x, y, frame="map"):
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y, message.pose.orientation.w = x, y, 1.0
    return message


class NavigationNodes(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.map = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        cls.map.publish(wall())

    def ask(self, node):
        rospy.wait_for_service("/%s/make_plan" % node, PATIENCE)
        return rospy.ServiceProxy("/%s/make_plan" % node, MakeNavPlan, persistent=True)

    def test_1_a_costmap_is_published(self):
        grids = Recorder("/costmap_node/costmap/costmap", OccupancyGrid)
        grids.wait(lambda messages: messages and 100 in messages[-1].data, "a costmap with the map", PATIENCE)
        info, cells = grids.messages[-1].info, np.array(grids.messages[-1].data).reshape(120, 160)
        self.assertEqual((info.width, info.height, info.resolution), (160, 120, np.float32(0.05)))
        self.assertEqual((cells[40, 80], cells[40, 40]), (100, 0))
        self.assertTrue(0 < cells[40, 88] <= 99, cells[40, 88])       # 0.3 m from the wall

    def test_2_both_planners_find_the_way_round_the_wall(self):
        for node in ("navfn_node", "planner"):
            answer = self.ask(node)(at(1.0, 1.0), at(7.0, 1.0, ""))
            self.assertEqual((answer.plan_found, answer.error_message), (1, ""))
            places = np.array([(each.pose.position.x, each.pose.position.y) for each in answer.path])
            self.assertEqual((tuple(places[0]), tuple(places[-1])), ((1.0, 1.0), (7.0, 1.0)))
            length = np.hypot(*np.diff(places, axis=0).T).sum()
            self.assertTrue(2.0 * math.hypot(3.0, 3.2) < length < 12.0, length)

    def test_3_a_plan_that_fails_says_why(self):
        for node in ("navfn_node", "planner"):
            for goal, words in ((at(7.0, 5.0), "no way through"), (at(4.0, 1.0), "is in an obstacle"),
                                (at(99.0, 0.0), "outside of the map"), (at(math.nan, 0.0), "expected finite numbers"),
                                (at(1.0, 2.0, "nowhere"), "nowhere")):
                answer = self.ask(node)(at(1.0, 1.0), goal)
                self.assertEqual((answer.plan_found, answer.path), (0, []))
                self.assertIn(words, answer.error_message)

    def test_4_a_goal_on_the_topic_gives_a_plan_from_the_robot(self):
        for node, place in (("navfn_node", "navfn_planner"), ("planner", "planner")):
            goals = rospy.Publisher("/%s/goal" % node, PoseStamped, queue_size=1)
            plans = Recorder("/%s/%s/plan" % (node, place), Path)
            wait_until(lambda: goals.get_num_connections() and plans.connected(), "connections", PATIENCE)
            goals.publish(at(7.0, 1.0))
            plans.wait(lambda messages: messages and messages[-1].poses, "a plan")
            first = plans.messages[-1].poses[0].pose.position
            self.assertEqual((first.x, first.y), (1.0, 1.0))
            ask = rospy.ServiceProxy("/%s/%s/make_plan" % (node, place), GetPlan)
            self.assertGreater(len(ask(PoseStamped(), at(7.0, 1.0), 0.0).plan.poses), 50)

    def test_5_the_cells_of_a_voxel_grid_are_shown(self):
        shown = [Recorder("/visualization_marker", Marker), Recorder("/voxel_marked_cloud", PointCloud),
                 Recorder("/voxel_unknown_cloud", PointCloud)]
        grid = VoxelGrid(size_x=2, size_y=1, size_z=4, data=[1 << 1, (1 << 3) | (1 << 19)])
        grid.header.frame_id, grid.resolutions = "map", Vector3(0.1, 0.1, 0.2)
        publisher = rospy.Publisher("voxel_grid", VoxelGrid, queue_size=1, latch=True)
        publisher.publish(VoxelGrid(size_x=3, size_y=1, size_z=4, data=[0]))        # is refused
        wait_until(lambda: publisher.get_num_connections() == 2, "both viewers", PATIENCE)
        publisher.publish(grid)
        for recorder in shown:
            recorder.wait(lambda messages: messages, "the cells", PATIENCE)
        marker, marked, unknown = (recorder.messages[-1] for recorder in shown)
        self.assertEqual((marker.type, marker.header.frame_id), (Marker.CUBE_LIST, "map"))
        for place, expected in ((marker.points[0], (0.15, 0.05, 0.7)), (marked.points[0], (0.15, 0.05, 0.7)),
                                (unknown.points[0], (0.05, 0.05, 0.3))):
            for value, wanted in zip((place.x, place.y, place.z), expected):
                self.assertAlmostEqual(value, wanted, 5)

    def test_6_definitions_are_those_that_clients_expect(self):
        for kind, wanted in SUMS.items():
            self.assertEqual(kind._md5sum, wanted)


if __name__ == "__main__":
    rospy.init_node("navigation_nodes")
    run_checks("navigation_nodes", NavigationNodes)
