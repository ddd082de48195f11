#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""An arbitrary robot: it stays where it was placed, drives forward, turns left, and scans."""
import math
import os
import sys
import unittest

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, run_checks, wait_until, yaw_of  # noqa: E402

START = (1.0, 2.0, 0.5)


class AnyRobot(unittest.TestCase):
    """One robot called ``robot``, its topics in the root namespace unless its description sets a namespace."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("robot")
        cls.odometry, cls.scans = Recorder("/odom", Odometry).connected(), Recorder("/scan", LaserScan).connected()
        cls.topic = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
        wait_until(lambda: cls.topic.get_num_connections() > 0, "the robot on /cmd_vel")

    def place(self):
        pose = self.simulation.call("get_model_state", "robot", "").pose
        return pose.position.x, pose.position.y, yaw_of(pose.orientation)

    def test_it_drives_turns_and_scans(self):
        x, y, yaw = self.place()
        for have, want in zip((x, y, yaw), START):
            self.assertAlmostEqual(have, want, delta=0.02)
        self.topic.publish(Twist(Vector3(0.4, 0.0, 0.0), Vector3()))

        def ahead(message):
            at = message.pose.pose.position
            return (at.x - x) * math.cos(yaw) + (at.y - y) * math.sin(yaw)

        last = self.odometry.wait(lambda messages: ahead(messages[-1]) > 1.0 and messages[-1], "a metre ahead")
        aside = (last.pose.pose.position.y - y) * math.cos(yaw) - (last.pose.pose.position.x - x) * math.sin(yaw)
        self.assertAlmostEqual(aside, 0.0, delta=0.05)
        self.assertAlmostEqual(last.twist.twist.linear.x, 0.4, delta=0.01)
        self.topic.publish(Twist(Vector3(), Vector3(0.0, 0.0, 0.5)))
        self.odometry.wait(lambda messages: yaw_of(messages[-1].pose.pose.orientation) > START[2] + 1.0,
                           "a left turn by one radian")
        scan = self.scans.next()[-1]
        self.assertGreater(len(scan.ranges), 50)
        self.assertTrue(all(math.isinf(value) for value in scan.ranges), "an empty world has nothing to hit")


if __name__ == "__main__":
    rospy.init_node("check_any_robot")
    run_checks("any_robot", AnyRobot)
