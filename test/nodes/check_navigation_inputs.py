#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A laser, odometry and a map that fail while the robot drives: it stops, says so, and continues when they are back."""
import math
import os
import sys
import threading
import time
import unittest

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, run_checks, wait_until  # noqa: E402

START = 120.0               # s of wall time in which the node starts, also on a busy machine
RATE = 20.0                 # Hz of scans and odometry
STOP = 0.5                  # s without scans after which the robot has to stop
BUSY = 1.0                  # s that messages may take on a busy machine
BEAMS = 90


def corridor(closed):
    """A corridor of 40 x 4 m, free or with a wall across at x = 39 m."""
    cells = np.zeros((80, 800), np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 100, 100, 100, 100
    if closed:
        cells[:, 778:782] = 100
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.resolution, message.info.width, message.info.height = 0.05, 800, 80
    message.info.origin.orientation.w = 1.0
    message.data = cells.ravel().tolist()
    return message


class Robot:
    """Drives as it is told; its sensors can be switched off."""

    def __init__(self):
        self.place, self.command = np.array([2.0, 2.0, 0.0]), np.zeros(2)
        self.has_odometry, self.has_laser, self.has_twist = True, False, True
        self.last_scan, self.ended, self.laser_frame = 0.0, False, "base_link"
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._odom = rospy.Publisher("odom", Odometry, queue_size=10)
        self._scan = rospy.Publisher("scan", LaserScan, queue_size=10)
        rospy.Subscriber("cmd_vel", Twist, self._on_command, tcp_nodelay=True)
        threading.Thread(target=self._run, daemon=True).start()

    def _on_command(self, message):
        self.command = np.array([message.linear.x, message.angular.z])

    def _run(self):
        before = time.monotonic()
        while not self.ended:
            now = time.monotonic()
            forward, turn = self.command
            self.place += (now - before) * np.array([forward * math.cos(self.place[2]),
                                                     forward * math.sin(self.place[2]), turn])
            before, stamp = now, rospy.Time.now()
            if self.has_odometry:
                self._send_odometry(stamp, forward, turn)
            if self.has_laser:
                self._scan.publish(LaserScan(
                    header=rospy.Header(stamp=stamp, frame_id=self.laser_frame), angle_min=-1.5, angle_max=1.5,
                    angle_increment=3.0 / (BEAMS - 1), range_min=0.1, range_max=10.0, ranges=[math.inf] * BEAMS))
                self.last_scan = now
            time.sleep(1.0 / RATE)

    def _send_odometry(self, stamp, forward, turn):
        frames = []
        for parent, child, place in (("map", "odom", np.zeros(3)), ("odom", "base_link", self.place)):
            frame = TransformStamped(child_frame_id=child)
            frame.header.stamp, frame.header.frame_id = stamp, parent
            frame.transform.translation.x, frame.transform.translation.y = place[:2]
            frame.transform.rotation.z, frame.transform.rotation.w = math.sin(0.5 * place[2]), math.cos(0.5 * place[2])
            frames.append(frame)
        self._tf.publish(TFMessage(frames))
        if not self.has_twist:
            return
        message = Odometry(child_frame_id="base_link")
        message.header.stamp, message.header.frame_id = stamp, "odom"
        message.twist.twist.linear.x, message.twist.twist.angular.z = forward, turn
        self._odom.publish(message)


class NavigationInputs(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.log = Recorder("/rosout", Log)
        cls.map = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        cls.map.publish(corridor(False))
        cls.robot = Robot()
        cls.client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        wait_until(lambda: cls.client.wait_for_server(rospy.Duration(1.0)), "the action server", START)
        cls.client.send_goal(cls.goal())                    # the laser has not sent anything yet
        cls.log.wait(lambda messages: any("topic scan of source scan has sent nothing yet" in message.msg
                                          for message in messages), "a message about the laser", 60.0)
        cls.place_without_laser = cls.robot.place.copy()
        cls.client.cancel_goal()
        cls.robot.has_laser = True

    @classmethod
    def tearDownClass(cls):
        cls.robot.ended = True

    def setUp(self):
        self.robot.place = np.array([2.0, 2.0, 0.0])
        self.client.send_goal(self.goal())
        self.wait_for_motion()

    @staticmethod
    def goal():
        target = PoseStamped()
        target.header.frame_id = "map"
        target.pose.position.x, target.pose.position.y, target.pose.orientation.w = 39.5, 2.0, 1.0
        return MoveBaseGoal(target_pose=target)

    def tearDown(self):
        self.client.cancel_goal()
        self.map.publish(corridor(False))
        self.robot.has_laser = self.robot.has_odometry = self.robot.has_twist = True
        self.robot.laser_frame = "base_link"
        self.wait_for_stop()                                # or a command to this goal counts as motion to the next

    def wait_for_motion(self):
        wait_until(lambda: self.robot.command[0] > 0.05, "the robot to drive", 30.0)

    def wait_for_stop(self):
        wait_until(lambda: not self.robot.command.any(), "the robot to stop", 10.0)

    def told(self, *words):
        self.log.wait(lambda messages: any(all(word in message.msg for word in words) and message.name == "/move_base"
                                           for message in messages), "a message with %s" % ", ".join(words), 20.0)

    def test_a_laser_that_never_sent(self):
        self.told("stopped", "topic scan of source scan has sent nothing yet")
        np.testing.assert_array_equal(self.place_without_laser, [2.0, 2.0, 0.0])

    def test_velocity_by_tf_where_odom_is_silent(self):
        self.robot.has_twist = False
        self.told("odom is silent", "taken from the transforms from base_link to odom")
        before = self.robot.place[0]
        wait_until(lambda: self.robot.place[0] > before + 1.0, "the robot to drive on", 60.0)

    def test_a_laser_that_stops(self):
        wait_until(lambda: self.robot.place[0] > 2.6, "enough scans to know their rate", 60.0)
        self.robot.has_laser = False
        self.wait_for_stop()
        self.assertLess(time.monotonic() - self.robot.last_scan, STOP + BUSY)
        self.told("stopped", "topic scan")
        self.assertEqual(self.client.get_state(), GoalStatus.ACTIVE)
        self.robot.has_laser = True
        self.wait_for_motion()

    def test_a_laser_without_a_transform(self):
        self.robot.laser_frame = "nowhere"
        self.wait_for_stop()
        self.told("stopped", "no message on topic scan", "nowhere")
        self.robot.laser_frame = "base_link"
        self.wait_for_motion()

    def test_odometry_that_stops(self):
        self.robot.has_odometry = False
        self.wait_for_stop()
        self.told("stopped", "base_link")
        self.robot.has_odometry = True
        self.wait_for_motion()

    def test_a_map_that_changes(self):
        self.map.publish(corridor(True))
        self.told("no new plan", "no way through")          # the old one stays, as long as it is free
        self.client.cancel_goal()
        self.client.send_goal(self.goal())
        self.assertTrue(self.client.wait_for_result(rospy.Duration(30.0)), "the goal is still active")
        self.assertEqual(self.client.get_state(), GoalStatus.ABORTED)
        self.told("Failed to find a valid plan", "no way through")
        self.map.publish(corridor(False))
        self.client.send_goal(self.goal())
        self.wait_for_motion()

    def test_scans_that_cannot_be_used(self):
        scans = rospy.Publisher("scan", LaserScan, queue_size=10)
        wait_until(lambda: scans.get_num_connections() >= 1, "the node to hear the scans")
        for ranges, increment in (([], 0.0), ([1.0] * 10, math.nan), ([math.nan] * 10, 0.1), ([1.0] * 300000, 1e-5)):
            scans.publish(LaserScan(header=rospy.Header(stamp=rospy.Time.now(), frame_id="base_link"), angle_min=-1.5,
                                    angle_increment=increment, range_min=0.1, range_max=10.0, ranges=ranges))
        self.told("scan", "nan")
        self.robot.command[:] = 0.0
        self.wait_for_motion()


if __name__ == "__main__":
    rospy.init_node("navigation_inputs")
    run_checks("navigation_inputs", NavigationInputs)
