#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The report's robot behind gazebo_ros: it settles upright, scans, turns left, follows the keyboard."""
import math
import os
import pty
import signal
import subprocess
import sys
import termios
import time
import unittest

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import (  # noqa: E402
    PATIENCE,
    Recorder,
    Simulation,
    end_marked,
    marked_environment,
    program,
    run_checks,
    run_program,
    wait_until,
    yaw_of,
)

TURN = 0.5      # rad/s
KEYBOARD = ("teleop_twist_keyboard", "teleop_twist_keyboard.py")


class Teleop:
    """teleop_twist_keyboard.py in a terminal of its own."""

    def __init__(self, *arguments):
        self.typing, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        environment, self._mark = marked_environment()
        self.process = subprocess.Popen([program(*KEYBOARD)] + list(arguments), stdin=self.terminal,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment,
                                        universal_newlines=True, start_new_session=True)

    def wait_for_text(self, words):
        """Read its output up to a line with these words."""
        for line in self.process.stdout:
            if words in line:
                return
        raise AssertionError('the keyboard node ended without the output "%s"' % words)

    def press(self, key):
        os.write(self.typing, key.encode())

    def press_until_heard(self, commands):
        """Press the key for stopping until a command comes: a new subscriber may be connected on one side only."""
        commands.connected()

        def heard():
            if not commands.messages:
                self.press("k")
                time.sleep(0.1)     # not a key in each iteration
            return commands.messages
        wait_until(heard, "a command from the keyboard")

    def end(self, number):
        """Send a signal; returns the exit code."""
        self.process.send_signal(number)
        return self.process.wait(PATIENCE)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        end_marked(self._mark)
        self.process.wait()
        self.process.stdout.close()
        for descriptor in (self.typing, self.terminal):
            os.close(descriptor)


class ReportLaunch(unittest.TestCase):
    """One world, started by the .test file's launch lines."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        cls.odometry = Recorder("/odom", Odometry).connected()

    def test_it_settles_upright_where_it_was_put(self):
        self.simulation.run_for(2.0)
        pose = self.simulation.call("get_model_state", "m2wr", "").pose
        self.assertAlmostEqual(pose.position.x, 0.0, delta=0.05)
        self.assertAlmostEqual(pose.position.y, 8.0, delta=0.05)
        self.assertAlmostEqual(pose.position.z, 0.1, delta=0.005)
        self.assertLess(math.hypot(pose.orientation.x, pose.orientation.y), 0.01)

    def test_the_scan_is_the_reports(self):
        scan = Recorder("/m2wr/laser/scan", LaserScan).connected()
        message = scan.next()[0]
        scan.close()
        self.assertEqual((len(message.ranges), message.header.frame_id), (720, "sensor_laser"))
        self.assertAlmostEqual(message.angle_min, -1.570796, delta=1e-6)

    def test_positive_turning_is_to_the_left(self):
        command = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
        wait_until(lambda: command.get_num_connections() > 0, "the robot on /cmd_vel")
        twist = Twist()
        twist.angular.z = TURN
        command.publish(twist)
        self.odometry.wait(lambda messages: messages[-1].twist.twist.angular.z > 0.9 * TURN, "a left turn")
        before = yaw_of(self.odometry.messages[-1].pose.pose.orientation)
        self.odometry.wait(lambda messages: math.remainder(
            yaw_of(messages[-1].pose.pose.orientation) - before, 2.0 * math.pi) > 0.2, "a growing heading")
        command.publish(Twist())
        self.wait_for_rest()
        command.unregister()

    def wait_for_rest(self):
        self.odometry.wait(lambda messages: abs(messages[-1].twist.twist.angular.z) < 0.01
                           and abs(messages[-1].twist.twist.linear.x) < 0.01, "a robot at rest")

    def keyboard_drives_and_stops(self, end):
        """Drive by keys until ``end(teleop)`` ends the program; the robot must stop, the terminal be restored."""
        commands = Recorder("/cmd_vel", Twist)
        with Teleop("_speed:=0.3", "_turn:=0.4", "_key_timeout:=0", "_repeat_rate:=0") as teleop:  # all: they persist
            teleop.wait_for_text("currently")
            teleop.press_until_heard(commands)
            teleop.press("u")
            commands.wait(lambda messages: (messages[-1].linear.x, messages[-1].angular.z) == (0.3, 0.4), "key u")
            self.odometry.wait(lambda messages: messages[-1].twist.twist.linear.x > 0.2, "a driving robot")
            teleop.press("q")
            commands.wait(lambda messages: abs(messages[-1].linear.x - 0.33) < 1e-9, "key q")
            self.assertEqual(end(teleop), 0)
            commands.wait(lambda messages: messages[-1] == Twist(), "a last command of zeros")
            self.assertEqual(termios.tcgetattr(teleop.terminal), teleop.before)
        commands.close()
        self.wait_for_rest()

    def test_keyboard_ended_by_ctrl_c(self):
        self.keyboard_drives_and_stops(lambda teleop: teleop.end(signal.SIGINT))

    def test_keyboard_ended_by_rosnode_kill(self):
        def kill(teleop):
            self.assertEqual(run_program(["rosnode", "kill", "/teleop_twist_keyboard"]).returncode, 0)
            return teleop.process.wait(PATIENCE)
        self.keyboard_drives_and_stops(kill)

    def test_keyboard_stops_the_robot_when_no_key_comes(self):
        commands = Recorder("/cmd_vel", Twist)
        with Teleop("_speed:=0.5", "_key_timeout:=0.3", "_repeat_rate:=20") as teleop:
            teleop.wait_for_text("currently")
            teleop.press_until_heard(commands)
            teleop.press("i")
            commands.wait(lambda messages: any(message.linear.x == 0.5 for message in messages), "key i")
            commands.wait(lambda messages: len(messages) > 3 and messages[-1] == Twist(), "a stop without a key")
            moving = [message for message in commands.messages if message.linear.x]
            self.assertGreater(len(moving), 2, "the command was not repeated")
            teleop.end(signal.SIGTERM)
            self.assertEqual(termios.tcgetattr(teleop.terminal), teleop.before)
        commands.close()
        self.wait_for_rest()

    def test_keyboard_without_a_terminal_says_so(self):
        done = run_program([program(*KEYBOARD)])        # its standard input is /dev/null
        self.assertEqual(done.returncode, 1)
        self.assertIn("neither a terminal nor a pipe", done.stderr)


if __name__ == "__main__":
    rospy.init_node("check_report_launch", disable_rostime=True)
    run_checks("report_launch", ReportLaunch)
