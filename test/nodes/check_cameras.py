#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A depth camera over ROS: lockstep repeats its pictures to the byte, and a laser scan is made of its depths."""
import math
import os
import signal
import sys
import unittest

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Image, LaserScan

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Running, Simulation, data_text, program, run_checks  # noqa: E402

FRAMES = 6
WALL = 3.0              # m from the camera to the face of the wall
COLOUR, DEPTH = "/eye/rgb/image_raw", "/eye/depth/image_raw"
BOX = """<sdf version="1.6"><model name="wall"><static>true</static><link name="link"><visual name="v"><geometry><box>
<size>0.1 8 2</size></box></geometry></visual></link></model></sdf>"""


class Cameras(unittest.TestCase):

    def start(self, *parameters):
        """Start a simulation with the camera; returns the running node."""
        if rospy.has_param("/gazebo"):
            rospy.delete_param("/gazebo")           # of the previous case
        node = Running([program("m2wr_sim", "m2wr_sim_node"), "_world:=empty", "_seed:=3"] + list(parameters))
        self.addCleanup(node.__exit__)
        node.wait_for_text("is ready")
        self.simulation = Simulation()
        for name, text, x, z in (("wall", BOX, WALL + 0.05, 1.0), ("eye", data_text("eye.sdf"), 0.0, 0.5)):
            self.assertTrue(self.simulation.spawn(name, text, (x, 0.0, z, 0.0), kind="sdf").success)
        return node

    def end(self, node):
        code, _ = node.end(signal.SIGINT)
        self.assertEqual(code, 0, node.text)
        self.assertNotIn("Traceback", node.text)

    def film(self):
        """Return stamp and bytes of the first pictures of a run in lockstep; each colour picture is answered."""
        own = rospy.get_name()
        node = self.start("_lockstep:=true", "_real_time_factor:=0", "_lockstep_tick:=odometry",
                          "_lockstep_replies:=['%s -> /cmd_vel by %s']" % (COLOUR, own),
                          "_lockstep_listeners:=['%s: %s']" % (own, DEPTH))
        commands = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
        depths, colours = Recorder(DEPTH, Image), []

        def answer(message):
            colours.append(message)
            turn = Twist()
            turn.angular.z = 0.5 + 0.01 * (sum(bytes(message.data)) % 100)      # no other picture gives the same
            commands.publish(turn)

        subscriber = rospy.Subscriber(COLOUR, Image, answer)
        try:
            depths.wait(lambda messages: min(len(messages), len(colours)) >= FRAMES, "%d pictures" % FRAMES)
        except AssertionError as error:
            self.fail("%s; the simulator's output:\n%s" % (error, node.text))
        films = [[(message.header.stamp.to_nsec(), bytes(message.data)) for message in messages[:FRAMES]]
                 for messages in (colours, depths.messages)]
        self.end(node)
        for port in (subscriber, commands):
            port.unregister()
        depths.close()
        return films

    def test_two_runs_in_lockstep_take_the_same_pictures(self):
        first, second = self.film(), self.film()
        for one, two in zip(first, second):
            self.assertEqual([stamp for stamp, _ in one], [stamp for stamp, _ in two])
            self.assertTrue(one == two, "the pictures of two runs differ")
            self.assertEqual(len({data for _, data in one}), FRAMES)     # the camera turns

    def test_a_scan_is_made_of_the_depths(self):
        node = self.start()
        converter = Running([program("depthimage_to_laserscan", "depthimage_to_laserscan"), "image:=" + DEPTH,
                             "scan:=/eye/scan", "_scan_height:=5", "_output_frame_id:=eye_frame"])
        self.addCleanup(converter.__exit__)
        recorder = Recorder("/eye/scan", LaserScan).connected()
        scan = recorder.next()[0]
        recorder.close()
        self.assertEqual((scan.header.frame_id, len(scan.ranges)), ("eye_frame", 160))
        self.assertAlmostEqual(scan.angle_max, 0.6, delta=0.01)
        errors = [abs(distance * math.cos(scan.angle_min + place * scan.angle_increment) - WALL)
                  for place, distance in enumerate(scan.ranges) if math.isfinite(distance)]
        self.assertGreater(len(errors), 120)
        self.assertLess(max(errors), 0.05)
        code, _ = converter.end(signal.SIGINT)
        self.assertEqual(code, 0, converter.text)
        self.end(node)


if __name__ == "__main__":
    rospy.init_node("check_cameras")
    run_checks("cameras", Cameras)
