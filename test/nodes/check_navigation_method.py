#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A method without a map drives the robot to a goal, refuses bad goals, and stops without a laser."""
import os
import sys
import unittest

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from navigation_case import pose  # noqa: E402
from sim_probe import Recorder, run_checks, wait_until  # noqa: E402

GOAL = (-2.0, 5.0)
WAIT = 120.0                        # s of wall time for a drive of some 8 s


class NavigationMethod(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.odometry = Recorder("odom", Odometry)
        cls.log = Recorder("/rosout", Log).connected()
        cls.goals = rospy.Publisher("move_base_simple/goal", PoseStamped, queue_size=1)
        wait_until(lambda: cls.goals.get_num_connections() >= 2, "both nodes listen to goals")

    def told(self, text):
        return any(text in message.msg for message in self.log.messages)

    def place(self):
        position = self.odometry.next()[-1].pose.pose.position
        return np.array([position.x, position.y])

    def test_1_goals_that_cannot_be_used_are_refused(self):
        before = self.place()
        self.goals.publish(pose(float("nan"), 0.0, 0.0))
        wait_until(lambda: self.told("its position is (nan, 0.0); expected finite numbers"), "the goal is refused")
        elsewhere = pose(1.0, 0.0, 0.0)
        elsewhere.header.frame_id = "moon"
        self.goals.publish(elsewhere)
        wait_until(lambda: self.told("there is no transform from moon to odom"), "the frame is refused")
        self.assertLess(np.hypot(*(self.place() - before)), 0.05)

    def test_2_without_a_laser_the_robot_is_stopped(self):
        commands = Recorder("blind_cmd_vel", Twist)
        commands.wait(lambda messages: messages, "a command")
        self.assertEqual((commands.messages[-1].linear.x, commands.messages[-1].angular.z), (0.0, 0.0))
        wait_until(lambda: self.told("the robot stops: nothing on /blind_scan for 0.4 s"), "the reason")
        scan = LaserScan(angle_min=-1.0, angle_increment=1e30, ranges=[1.0] * 50, range_max=10.0)
        scans = rospy.Publisher("blind_scan", LaserScan, queue_size=1, latch=True)
        scans.publish(scan)
        wait_until(lambda: self.told("expected angles of at most two turns"), "the scan is refused")

    def test_3_a_goal_is_reached(self):
        goal = pose(GOAL[0], GOAL[1], 0.0)
        goal.header.frame_id = "odom"
        self.goals.publish(goal)
        wait_until(lambda: self.told("reached: "), "the goal is reached", WAIT)
        self.assertLess(np.hypot(*(self.place() - GOAL)), 0.3)


if __name__ == "__main__":
    rospy.init_node("navigation_method")
    run_checks("navigation_method", NavigationMethod)
