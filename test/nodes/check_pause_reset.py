#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pause, unpause, reset_world and reset_simulation, seen from topics and from nodes that continue to work."""
import os
import subprocess
import sys
import time
import unittest

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, run_checks, xyz, yaw_of  # noqa: E402

SILENCE = 0.5       # s of wall time without a message; unpaused there would be ten scans and odometry messages
FIRST_STAMPS = (    # topic, child frame, latest first stamp [s] after the reset: one or two periods
    ("/clock", None, 0.011), ("/odom", None, 0.101), ("/m2wr/laser/scan", None, 0.051), ("/joint_states", None, 0.041),
    ("/tf", "link_chassis", 0.101), ("/tf", "link_left_wheel", 0.5))


class PauseReset(unittest.TestCase):
    """Cases run in alphabetical order but do not depend on it; each ends with the simulation running."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        kinds = (("/odom", Odometry), ("/m2wr/laser/scan", LaserScan), ("/joint_states", JointState), ("/clock", Clock),
                 ("/tf", TFMessage), ("/cmd_vel", Twist))
        cls.topics = {name: Recorder(name, kind).connected() for name, kind in kinds}

    def setUp(self):
        self.simulation.call("unpause_physics")
        self.wait_for_driving()

    def wait_for_driving(self):
        """Wait until the robot drives and everything publishes."""
        self.topics["/odom"].wait(lambda messages: messages[-1].twist.twist.linear.x > 0.2, "a robot that drives")
        for recorder in self.topics.values():
            recorder.next()

    @staticmethod
    def stamps(messages, child=None):
        """Stamps [s] of messages of any of the topics; of one child frame's transforms for /tf."""
        if child is not None:
            return [t.header.stamp.to_sec() for m in messages for t in m.transforms if t.child_frame_id == child]
        return [(m.clock if isinstance(m, Clock) else m.header.stamp).to_sec() for m in messages]

    def pose(self):
        answer = self.simulation.call("get_model_state", "m2wr", "")
        return xyz(answer.pose.position) + (yaw_of(answer.pose.orientation),), xyz(answer.twist.linear)

    def test_a_paused_simulation_advances_step_by_step_by_command(self):
        def command(*words):
            return subprocess.run(["rosrun", "m2wr_sim"] + list(words), text=True, capture_output=True, timeout=120)
        refused = command("step")
        self.assertEqual((refused.returncode, "the simulation runs" in refused.stderr), (1, True), refused.stderr)
        self.assertEqual(command("pause").returncode, 0)
        paused_at = self.simulation.call("get_world_properties").sim_time
        done = command("step", "25")
        self.assertEqual(done.returncode, 0, done.stderr)
        now = self.simulation.call("get_world_properties").sim_time
        self.assertAlmostEqual(now - paused_at, 0.025, 9)
        done = command("speed", "3")
        self.assertEqual((done.returncode, done.stdout.split(" times")[0]), (0, "3"), done.stderr)
        self.assertEqual(command("speed", "1").returncode, 0)
        self.assertEqual(command("unpause").returncode, 0)
        self.wait_for_driving()

    def test_pause_stops_time_and_topics_but_not_the_services(self):
        self.simulation.call("pause_physics")
        self.simulation.call("pause_physics")       # a second call changes nothing
        paused_at = self.simulation.time()
        for recorder in self.topics.values():
            recorder.clear()
        end = time.monotonic() + SILENCE            # the absence of messages can only be observed for a limited time
        while time.monotonic() < end:
            self.assertEqual(self.simulation.time(), paused_at)
        for name in ("/odom", "/m2wr/laser/scan", "/joint_states", "/clock"):
            late = [stamp for stamp in self.stamps(self.topics[name].messages) if stamp > paused_at + 1e-9]
            self.assertEqual(late, [], name)
            # at most a few messages were in transit when the pause began
            self.assertLess(len(self.topics[name].messages), 5, name)
        self.assertTrue(self.simulation.call("get_model_state", "m2wr", "").success)
        self.assertTrue(self.simulation.spawn("ghost", rospy.get_param("/robot_description"), (0.0, 30.0, 0.1, 0.0),
                                              "ghost").success)
        self.assertTrue(self.simulation.call("delete_model", "ghost").success)
        self.simulation.call("unpause_physics")
        for name in ("/odom", "/m2wr/laser/scan", "/joint_states", "/clock"):
            self.topics[name].wait(lambda messages: any(stamp > paused_at for stamp in self.stamps(messages)),
                                   "messages after the pause")
            first = min(stamp for stamp in self.stamps(self.topics[name].messages) if stamp > paused_at)
            self.assertLess(first - paused_at, 0.15, "%s did not continue where it stopped" % name)

    def test_reset_world_keeps_time_and_puts_the_robot_back(self):
        self.topics["/odom"].wait(lambda messages: messages[-1].pose.pose.position.x > 0.5, "the robot beyond x = 0.5")
        self.simulation.call("pause_physics")
        before = self.simulation.time()
        self.simulation.call("reset_world")
        self.assertEqual(self.simulation.time(), before)
        pose, velocity = self.pose()
        for found, wanted in zip(pose, (0.0, 0.0, 0.1, 0.0)):
            self.assertAlmostEqual(found, wanted, delta=1e-6)
        self.assertEqual(velocity, (0.0, 0.0, 0.0))
        self.topics["/odom"].clear()
        self.simulation.call("unpause_physics")
        # messages from before the pause may still be in transit
        first = self.topics["/odom"].wait(lambda messages: [m for m in messages if m.header.stamp.to_sec() > before],
                                          "odometry after the reset")[0]
        self.assertLess(abs(first.pose.pose.position.x), 0.1)
        self.wait_for_driving()

    def test_reset_simulation_restarts_all_topics_at_time_zero(self):
        self.topics["/odom"].wait(lambda messages: messages[-1].pose.pose.position.x > 0.5, "the robot beyond x = 0.5")
        before = self.simulation.time()
        self.assertGreater(before, 1.0)
        for recorder in self.topics.values():
            recorder.clear()
        self.simulation.call("reset_simulation")
        self.assertLess(self.simulation.time(), before)
        for name, child, first_at_most in FIRST_STAMPS:
            stamps = self.topics[name].wait(lambda messages: self.after_the_jump(messages, child, 20),
                                            "twenty stamps from zero on")
            self.assertLessEqual(stamps[0], first_at_most + 1e-9, "%s %s" % (name, child))
            self.assertEqual(stamps, sorted(stamps), "%s %s" % (name, child))
            self.assertLess(stamps[19] - stamps[0], 3.0, "%s %s" % (name, child))
        self.assertLess(abs(self.topics["/odom"].messages[-1].pose.pose.position.y), 0.5)
        self.wait_for_driving()

    def after_the_jump(self, messages, child, count):
        """Stamps that came after time went back, once there are ``count`` of them."""
        stamps = self.stamps(messages, child)
        jumps = [index for index in range(1, len(stamps)) if stamps[index] < stamps[index - 1] - 0.5]
        if not jumps and stamps and stamps[0] < 0.5:
            jumps = [0]
        after = stamps[jumps[-1]:] if jumps else []
        return after if len(after) >= count else None

    def test_reset_while_paused_stays_paused(self):
        self.simulation.call("pause_physics")
        self.simulation.call("reset_simulation")
        self.assertEqual(self.simulation.time(), 0.0)
        pose, _ = self.pose()
        for found, wanted in zip(pose, (0.0, 0.0, 0.1, 0.0)):
            self.assertAlmostEqual(found, wanted, delta=1e-6)
        self.assertEqual(self.simulation.time(), 0.0)
        self.simulation.call("unpause_physics")
        self.simulation.wait_for_time(0.2)


if __name__ == "__main__":
    rospy.init_node("check_pause_reset", disable_rostime=True)
    run_checks("pause_reset", PauseReset)
