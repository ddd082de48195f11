# SPDX-License-Identifier: BSD-3-Clause
"""What the checks of move_base share: a map of the world with its server, the action client, poses."""
import math
import os
import shutil
import tempfile
import unittest

import actionlib
import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal

from m2wr_maps import map_file
from m2wr_tools.map_comparison.agreement import OUTSIDE
from m2wr_tools.map_comparison.command import read_truth
from sim_probe import Running, program, wait_until

RESOLUTION, HALF = 0.05, 10.5       # m
LASER = 0.15                        # m: height of the laser above the floor
START = 120.0                       # s of wall time in which all nodes start, also on a busy machine


def save_map(folder):
    """Write the true map of the world; return the YAML file."""
    size = int(2 * HALF / RESOLUTION)
    drawn = read_truth("world02.world", LASER).drawn((size, size), RESOLUTION, np.full(2, -HALF + 0.5 * RESOLUTION))
    map_file.save(os.path.join(folder, "plan"), np.where(drawn == OUTSIDE, 0, 100).astype(np.int8), RESOLUTION,
                  (-HALF, -HALF, 0.0))
    return os.path.join(folder, "plan.yaml")


def pose(x, y, yaw=0.0, frame="map"):
    message = PoseStamped()
    message.header.frame_id, message.header.stamp = frame, rospy.Time.now()
    message.pose.position.x, message.pose.position.y = x, y
    message.pose.orientation.z, message.pose.orientation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return message


class NavigationCase(unittest.TestCase):
    """Checks share one run of the nodes; each begins where the one before has ended."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.map_server = Running([program("map_server", "map_server"), save_map(cls.folder)])
        cls.map_server.__enter__()
        cls.client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        # in wall time: with simulated time, a busy machine would have less of it
        wait_until(lambda: cls.client.wait_for_server(rospy.Duration(1.0)), "the action server", START)

    @classmethod
    def tearDownClass(cls):
        cls.map_server.__exit__()
        shutil.rmtree(cls.folder)

    def drive(self, target, seconds):
        """Send a goal and wait for its end; return its status and text."""
        self.client.send_goal(MoveBaseGoal(target_pose=target))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(seconds)), "the goal is still active")
        return self.client.get_state(), self.client.get_goal_status_text()
