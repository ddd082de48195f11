#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bad worlds, parameters and launch files: one clear message, no traceback, and the right exit code."""
import os
import random
import re
import signal
import socket
import sys
import time
import unittest
from concurrent.futures import ThreadPoolExecutor
from xmlrpc.client import ServerProxy

import rosgraph
import rospy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Running, data_path, program, run_checks, run_program, wait_until  # noqa: E402

SIDE_BY_SIDE = 2
PROMPT = 20.0       # s from a node's death to the end of the run, on a slow machine
NODE = (            # parameters of the simulation, words of its one message
    (["_world:=/no/such/place.world"], ["/no/such/place.world", "cannot be read"]),
    (["_world:=no_such_name"], ["no_such_name", "cannot be read", "m2wr_sim/worlds"]),
    (["_world:=" + data_path("bad")], [data_path("bad")]),
    (["_world:=" + data_path("bad", "malformed.world")], ["malformed.world:5", "include"]),
    (["_world:=" + data_path("bad", "broken.urdf")], ["broken.urdf"]),
    (["_real_time_factor:=-1"], ["~real_time_factor", "-1", "expected", "at least 0"]),
    (["_wheel_convention:=melodic"], ["~wheel_convention", "melodic", "noetic, kinetic, rep103"]),
)
BEHAVIOURS = ("bug2.py", "go_to_point.py")
RUNS = (            # arguments of experiment, words of its message
    (["m2wr_sim", "sim.launch", "world:=/no/such/place.world"], ["/no/such/place.world", "node gazebo"]),
    (["m2wr_sim", "no_such.launch"], ["no_such.launch", "m2wr_sim"]),
    (["no_such_package", "sim.launch"], ["no_such_package"]),
    (["m2wr_sim", "sim.launch", "seed:=many"], ["seed", "many"]),
    (["m2wr_test", "data/bad/unparsable_xacro.xml"], ["unparsable.xacro", "length"]),
)
LINE = re.compile(r"^(?:\x1b\[\d+m)?\[(?:ERROR|FATAL)\].*$", re.MULTILINE)


def free_port():
    """A port of the loopback interface that is not in use.

    It is below the ephemeral ports, so that no node of a concurrent test gets it meanwhile.
    """
    for port in random.sample(range(20000, 32000), 100):
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:     # in use
                continue
            return port
    raise AssertionError("none of 100 ports between 20000 and 32000 is free")


class LaunchErrors(unittest.TestCase):
    """Only the master runs, and what a case starts."""

    def assert_said(self, done, words, case):
        said = done.stdout + done.stderr
        self.assertNotEqual(done.returncode, 0, "%s: %s" % (case, said))
        self.assertGreater(done.returncode, 0, "%s was ended by a signal: %s" % (case, said))
        self.assertNotIn("Traceback", said, case)
        for word in words:
            self.assertIn(word, said, "%s: %s" % (case, said))

    def test_simulation_names_the_unusable_input_and_exits_with_1(self):
        command = program("m2wr_sim", "m2wr_sim_node")
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            results = pool.map(lambda entry: run_program([command, "__name:=bad_%d" % entry[0]] + entry[1][0]),
                               enumerate(NODE))
            for (arguments, words), done in zip(NODE, results):
                self.assert_said(done, words, arguments)
                self.assertEqual(done.returncode, 1, arguments)
                lines = LINE.findall(done.stdout + done.stderr)
                self.assertEqual(len(lines), 1, "%s: one message, not %s" % (arguments, lines))
                for word in words:
                    self.assertIn(word, lines[0], arguments)

    def test_unknown_parameter_is_named(self):
        done = run_program([program("m2wr_sim", "m2wr_sim_node"), "__name:=bad_unknown", "_wrld:=x",
                            "_world:=/no/such/place.world"])
        self.assert_said(done, ["~wrld", "no effect"], "unknown parameter")

    def test_behaviours_without_a_goal_name_the_parameter(self):
        rospy.set_param("/initial_x", 0.0)
        rospy.set_param("/initial_y", 0.0)
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            results = pool.map(lambda name: run_program([program("motion_plan", name)]), BEHAVIOURS)
            for name, done in zip(BEHAVIOURS, results):
                self.assert_said(done, ["des_pos_x"], name)
                self.assertEqual(len(LINE.findall(done.stdout + done.stderr)), 1, done.stdout + done.stderr)

    def test_experiment_names_what_it_cannot_run(self):
        command = program("m2wr_sim", "experiment")
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            results = pool.map(lambda case: run_program([command, "--port", str(free_port())] + case[0]), RUNS)
            for (arguments, words), done in zip(RUNS, results):
                self.assert_said(done, words, arguments)

    def test_experiment_ends_soon_after_a_required_node_dies(self):
        port = free_port()
        master = rosgraph.Master(rospy.get_name(), master_uri="http://127.0.0.1:%d" % port)
        command = [program("m2wr_sim", "experiment"), "--port", str(port), "m2wr_sim", "bug2.launch", "gui:=false"]
        with Running(command) as run:
            run.wait_for_text("state changed: Go to point")
            pid = wait_until(lambda: node_pid(master, "/wall_follower"), "the node /wall_follower")
            os.kill(pid, signal.SIGKILL)
            died = time.monotonic()
            code = run.wait()
            self.assertGreater(code, 0, run.text)
            self.assertLess(time.monotonic() - died, PROMPT)
            self.assertIn("wall_follower", run.text[run.text.rfind("experiment: node"):])
            self.assertNotIn("Traceback", run.text)


def node_pid(master, name):
    """Process of a node; None while it is not there."""
    try:
        uri = master.lookupNode(name)
    except (rosgraph.MasterException, OSError):
        return None
    return ServerProxy(uri).getPid("/check")[2]


if __name__ == "__main__":
    rospy.init_node("check_launch_errors", disable_rostime=True)
    run_checks("launch_errors", LaunchErrors)
