#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles added by command and by click are seen by the laser; diagnostics and the doctor report the true state."""
import contextlib
import io
import json
import math
import os
import re
import subprocess
import sys
import unittest

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import LaserScan

from m2wr_sim.errors import SimError
from m2wr_tools.obstacles import commands as obstacle_commands
from m2wr_tools.obstacles.world import World

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, program, run_checks, run_program, wait_until  # noqa: E402

X, Y = 1.0, 2.0         # of the robot, which faces along x
LASER = 0.15            # m from the robot's origin forward
NOISE = 0.06            # m: six standard deviations of the report's laser


class Done:
    """How a command ended: the attributes of a completed process."""

    def __init__(self, returncode, stdout, stderr):
        self.returncode, self.stdout, self.stderr = returncode, stdout, stderr


def process(name, *words):
    """Run a tool of m2wr_sim as a program; returns the completed process."""
    return run_program([program("m2wr_sim", name)] + [str(word) for word in words])


def tool(name, *words):
    """Run a tool in this process, which takes a tenth of the time."""
    out, error, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        given = obstacle_commands.parse(name, [str(word) for word in words])
        try:
            obstacle_commands.COMMANDS[name][2](given, World(given.gazebo_namespace))
        except SimError as fault:
            code = 1
            sys.stderr.write(str(fault))
    return Done(code, out.getvalue(), error.getvalue())


def ahead(message):
    """Return the range straight ahead."""
    return message.ranges[len(message.ranges) // 2]


class Tools(unittest.TestCase):
    """One robot in an empty world."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        cls.scans = Recorder("/m2wr/laser/scan", LaserScan).connected()

    def setUp(self):
        self.assertEqual(tool("delete_obstacle", "--all").returncode, 0)

    def sees(self, distance):
        """Wait until the range ahead is that of an object at a distance from the robot, inf for no object."""
        def fits(messages):
            found = ahead(messages[-1])
            return found == distance if math.isinf(distance) else abs(found - (distance - LASER)) < NOISE
        self.scans.clear()
        self.scans.wait(fits, "a range of %g m ahead" % (distance - LASER))

    def refused(self, done, *words):
        self.assertEqual(done.returncode, 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_what_is_added_moved_and_deleted_is_seen(self):
        self.sees(math.inf)
        done = process("add_obstacle", "box", "--size", 0.4, 2.0, 0.6, "--at", X + 2.2, Y, "--name", "crate")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.sees(2.0)
        done = tool("move_obstacle", "crate", "--at", X + 3.2, Y)
        self.assertIn("crate is at (4.20, 2.00, 0.00)", done.stdout)
        self.sees(3.0)
        self.assertIn("crate: box of 0.4 x 2 x 0.6 m at (4.20, 2.00, 0.00)", tool("list_obstacles").stdout)
        self.refused(process("add_obstacle", "box", "--at", 9, 9, "--name", "crate"), '"crate" is taken', "m2wr")
        self.assertEqual(tool("delete_obstacle", "crate").returncode, 0)
        self.sees(math.inf)
        self.assertEqual(tool("add_obstacle", "wall", "--from", X + 4, Y - 3, "--to", X + 4, Y + 3).returncode, 0)
        self.sees(3.95)

    def test_random_obstacles_repeat_with_the_same_seed(self):
        words = ("random", "--near", "m2wr", "--count", 3, "--seed", 7, "--within", 3)
        first = tool("add_obstacle", *words)
        self.assertEqual(first.returncode, 0, first.stderr)
        places = [tuple(map(float, found)) for found in re.findall(r"at \(([-.\d]+), ([-.\d]+),", first.stdout)]
        self.assertEqual(len(places), 3)
        for x, y in places:
            self.assertTrue(0.4 < math.hypot(x - X, y - Y) <= 3.01, places)
        self.simulation.run_for(0.5)        # nothing moves
        pose = self.simulation.call("get_model_state", "m2wr", "").pose.position
        self.assertLess(math.hypot(pose.x - X, pose.y - Y), 0.01)
        tool("delete_obstacle", "--all")
        self.assertEqual(tool("add_obstacle", *words).stdout, first.stdout)

    def test_impossible_requests_are_refused(self):
        self.refused(tool("add_obstacle", "box", "--size", 1, -1, 1, "--at", 9, 9), "width", "-1")
        self.refused(tool("add_obstacle", "box", "--near", "no_such_robot"), '"no_such_robot"', "m2wr")
        self.refused(tool("delete_obstacle", "m2wr"), "is a robot")
        self.refused(tool("move_obstacle", "nothing", "--at", 1, 1), '"nothing"')
        self.refused(tool("list_obstacles", "--gazebo-namespace", "/elsewhere"), "no simulation answers", "roslaunch")

    def test_an_obstacle_inside_the_robot_gives_a_warning(self):
        done = tool("add_obstacle", "box", "--size", 0.1, 0.1, 0.02, "--at", X, Y)
        self.assertEqual(done.returncode, 0)
        self.assertIn("overlaps the robot m2wr", done.stderr)

    def clicked(self, x, y, frame="odom"):
        message = PointStamped()
        message.header.frame_id, message.point.x, message.point.y, message.point.z = frame, x, y, 0.5
        self.clicks.publish(message)

    def obstacles(self):
        return {name for name in self.simulation.models() if name.startswith("obstacle")}

    def test_clicks_add_and_delete(self):
        self.clicks = rospy.Publisher("/clicked_point", PointStamped, queue_size=10)
        wait_until(lambda: self.clicks.get_num_connections() > 0, "a subscriber to clicks")
        self.clicked(math.nan, 0.0)         # is refused, without further effect
        self.clicked(X + 0.1, Y)            # in the robot: no effect
        self.clicked(X + 2.25, Y)
        wait_until(lambda: self.obstacles() == {"obstacle1"}, "an obstacle at the click, and only there")
        self.sees(2.0)
        self.clicked(X + 2.1, Y + 0.05)     # on the obstacle
        wait_until(lambda: not self.obstacles(), "its deletion")
        self.clicked(3.25, 0.0, "link_chassis")
        wait_until(lambda: self.obstacles() == {"obstacle1"}, "an obstacle at a click in another frame")
        self.sees(3.0)
        self.clicks.unregister()

    def test_diagnostics_report_rates_and_no_faults(self):
        recorder = Recorder("/diagnostics", DiagnosticArray).connected()

        def told(messages):
            found = {status.name: status for message in messages for status in message.status}
            topics = found.get("m2wr_sim: topics")
            values = {pair.key: pair.value for pair in topics.values} if topics else {}
            return found if "Hz, 20 Hz asked" in values.get("/m2wr/laser/scan", "") else None

        found = recorder.wait(told, "the rate of the scans")
        recorder.close()
        values = {pair.key: pair.value for pair in found["m2wr_sim: topics"].values}
        self.assertAlmostEqual(float(values["/m2wr/laser/scan"].split()[0]), 20.0, delta=3.0)
        self.assertEqual(found["m2wr_sim: topics"].level, DiagnosticStatus.OK, found["m2wr_sim: topics"].message)
        simulation = {pair.key: pair.value for pair in found["m2wr_sim: simulation"].values}
        self.assertEqual(simulation["plugins switched off"], "none")
        self.assertGreater(int(simulation["steps"]), 1000)
        self.assertTrue(20 < float(simulation["memory [MB]"]) < 2000, simulation)

    def test_reading_laser_ends_cleanly_when_its_pipe_is_closed(self):
        with subprocess.Popen([sys.executable, program("motion_plan", "reading_laser.py")], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE) as running:
            self.addCleanup(running.kill)
            self.assertRegex(running.stdout.readline(), rb"\]: \[[\d., ]+\]")
            running.stdout.close()
            self.assertEqual((running.wait(30), running.stderr.read()), (0, b""))

    def test_the_doctor_passes_a_healthy_robot_and_finds_a_fault(self):
        done = process("doctor", "--json")
        told = json.loads(done.stdout)
        self.assertEqual(done.returncode, told["exit_code"])
        live = [entry for entry in told["findings"] if entry["area"] in ("master", "topics", "frames")]
        self.assertEqual([entry for entry in live if entry["level"] != "ok"], [])
        said = " ".join(entry["what"] for entry in live)
        for words in ("/m2wr/laser/scan", "sensor_laser: transforms up to odom", "all 4 links",
                      "time: /clock of /gazebo"):
            self.assertIn(words, said)

        scans = rospy.Publisher("/other_scan", LaserScan, queue_size=1)      # advertised, but no messages
        done = process("doctor", "--quiet")
        self.assertEqual(done.returncode, 2, done.stdout)
        self.assertIn("/other_scan is advertised, but no scan is received", done.stdout)
        scans.unregister()


if __name__ == "__main__":
    rospy.init_node("check_tools", disable_rostime=True)
    run_checks("tools", Tools)
