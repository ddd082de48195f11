#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""fake_localization: pose, particle and transform from true poses, and bad input."""
import math
import os
import sys
import unittest

import numpy as np
import rospy
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from mapping_robot import Robot, about_z, xyt  # noqa: E402
from sim_probe import Recorder, Running, program, run_checks, wait_until  # noqa: E402


class CheckFakeLocalization(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()
        cls.truth = rospy.Publisher("/base_pose_ground_truth", Odometry, queue_size=10)

    def setUp(self):
        self.robot.now += 100.0
        if rospy.has_param("/fake_localization"):
            rospy.delete_param("/fake_localization")
        self.poses = Recorder("/amcl_pose", PoseWithCovarianceStamped)
        self.transforms = Recorder("/tf", TFMessage)
        self.addCleanup(self.poses.close)
        self.addCleanup(self.transforms.close)

    def started(self, *words):
        """A node that is connected to all of this test's publishers."""
        node = Running([program("fake_localization", "fake_localization"), "_base_frame_id:=link_chassis"]
                       + list(words))
        node.__enter__()
        self.addCleanup(node.__exit__, None, None, None)
        for publisher, count in ((self.truth, 1), (self.robot.tf, 2), (self.robot.clock, 1)):
            wait_until(lambda publisher=publisher, count=count: publisher.get_num_connections() >= count,
                       "%d subscribers to %s" % (count, publisher.resolved_name))
        self.poses.connected()
        self.transforms.connected(2)        # the robot's, and this node's
        return node

    def tell(self, true, odometry, moment=0.1):
        """Publish odometry and the true pose; returns the stamp."""
        robot = self.robot
        robot.tell_time(robot.now + moment)
        message = Odometry()
        message.header.frame_id, message.header.stamp = "world", rospy.Time.from_sec(robot.now)
        message.pose.pose.position.x, message.pose.pose.position.y = true[:2]
        turn = message.pose.pose.orientation
        turn.x, turn.y, turn.z, turn.w = about_z(true[2])
        self.truth.publish(message)             # first: the node has to wait for the transform
        robot.stand(odometry)
        return message.header.stamp

    def pose_at(self, stamp):
        return xyt(self.poses.wait(lambda messages: next((message for message in messages
                                                          if message.header.stamp == stamp), None), "the pose"))

    def correction_at(self, stamp, tolerance):
        def found(messages):
            return next((entry for message in messages for entry in message.transforms
                         if entry.header.frame_id == "map" and entry.child_frame_id == "odom"
                         and abs((entry.header.stamp - stamp).to_sec() - tolerance) < 1e-6), None)
        entry = self.transforms.wait(found, "map -> odom")
        move, turn = entry.transform.translation, entry.transform.rotation
        return np.array([move.x, move.y, 2.0 * math.atan2(turn.z, turn.w)])

    def test_the_transform_takes_odometry_to_the_true_pose(self):
        self.started("_transform_tolerance:=0.25")
        stamp = self.tell((3.0, 2.0, math.pi / 2), (1.0, 0.5, 0.0))
        np.testing.assert_allclose(self.pose_at(stamp), (3.0, 2.0, math.pi / 2), atol=1e-9)
        # (1, 0.5) turned by 90 degrees is (-0.5, 1); the rest is the shift
        np.testing.assert_allclose(self.correction_at(stamp, 0.25), (3.5, 1.0, math.pi / 2), atol=1e-9)
        cloud = Recorder("/particlecloud", PoseArray)
        self.assertEqual(len(cloud.wait(lambda messages: messages[-1], "the latched particle").poses), 1)
        cloud.close()

    def test_delta_is_the_origin_of_the_map_in_the_world(self):
        self.started("_delta_x:=1.0", "_delta_y:=2.0", "_delta_yaw:=%f" % (math.pi / 2))
        stamp = self.tell((1.0, 5.0, math.pi / 2), (0.0, 0.0, 0.0))
        np.testing.assert_allclose(self.pose_at(stamp), (3.0, 0.0, 0.0), atol=1e-6)

    def test_an_initial_pose_moves_the_map_under_the_robot(self):
        node = self.started()
        sender = rospy.Publisher("/initialpose", PoseWithCovarianceStamped, queue_size=1)
        wait_until(lambda: sender.get_num_connections() > 0, "a subscriber to initialpose")
        self.pose_at(self.tell((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.pose.pose.position.x, message.pose.pose.orientation.w = 7.0, 1.0
        sender.publish(message)
        node.wait_for_text("the robot is taken to be at (7.000, 0.000)")
        moved = self.pose_at(self.tell((1.5, 0.0, 0.0), (0.5, 0.0, 0.0)))
        np.testing.assert_allclose(moved, (7.5, 0.0, 0.0), atol=1e-9)
        message.header.frame_id = "odom"
        sender.publish(message)
        node.wait_for_text("its frame is 'odom'; expected 'map'")

    def test_an_infinite_true_pose_is_refused_and_the_next_used(self):
        node = self.started()
        self.tell((math.inf, 0.0, 0.0), (0.0, 0.0, 0.0))
        node.wait_for_text("its position is (inf, 0.0)")
        found = self.pose_at(self.tell((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        np.testing.assert_allclose(found, (1.0, 0.0, 0.0), atol=1e-9)


if __name__ == "__main__":
    rospy.init_node("check_fake_localization")
    run_checks("check_fake_localization", CheckFakeLocalization)
