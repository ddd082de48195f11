#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Two runs of bug2.launch with one seed record the same bytes, however fast they go; another seed does not."""
import os
import shutil
import sys
import tempfile
import unittest
from concurrent.futures import ThreadPoolExecutor

import rospy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from bag_bytes import first_difference, messages_of, read_order  # noqa: E402
from check_launch_errors import free_port  # noqa: E402
from sim_probe import program, run_checks, run_program  # noqa: E402

#: Least number of messages: from 2 m before the second wall of world02 to the goal behind it.
EXPECTED = {"/clock": 1000, "/odom": 200, "/m2wr/laser/scan": 200, "/cmd_vel": 200, "/tf": 700, "/tf_static": 1,
            "/joint_states": 500, "/bug2/state": 3, "/bug2/status": 20, "/bug2/hit_point": 1, "/bug2/leave_point": 1,
            "/bug2/m_line": 1, "/bug2/markers": 1, "/gazebo/world_markers": 1, "/gazebo/robot_states": 200,
            "/robot_description": 1}
SEVERAL_PUBLISHERS = {"/cmd_vel": {"/go_to_point", "/wall_follower"}, "/tf": {"/gazebo", "/robot_state_publisher"}}
#: Topics stamped with wall time.
WALL_TIME = {"/diagnostics", "/rosout"}
LIMIT = 200.0       # s of wall time for a run; it takes ten


class Repeat(unittest.TestCase):
    """Three runs: at full speed, paced, with another seed; the first two at the same time, to disturb each other."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp()
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.shown = {}              # as rosbag's reader gives the messages, by run
        with ThreadPoolExecutor(2) as pool:
            runs = [pool.submit(cls.record, *arguments) for arguments in (
                ("fast", "real_time_factor:=0", "seed:=3"),
                ("paced", "real_time_factor:=6", "lockstep:=true", "seed:=3"),
                ("other", "real_time_factor:=0", "seed:=4"))]
            cls.fast, cls.paced, cls.other = (run.result() for run in runs)

    @classmethod
    def record(cls, name, *arguments):
        """Run from just before the second wall to the goal behind it; returns the messages of the bag."""
        bag, port = os.path.join(cls.folder, name + ".bag"), free_port()
        done = run_program(
            [program("m2wr_sim", "experiment"), "--port", str(port), "m2wr_sim", "bug2.launch", "gui:=false",
             "initial_x:=0", "initial_y:=1.5", "initial_yaw:=-1.5", "des_pos_y:=-2.5", "exit_on_goal:=true",
             "record:=" + bag] + list(arguments), environment={"ROS_MASTER_URI": "http://127.0.0.1:%d" % port},
            patience=LIMIT)
        if done.returncode != 0:
            raise AssertionError("run %s ended with %d\n%s\n%s" % (name, done.returncode, done.stdout, done.stderr))
        cls.shown[name] = read_order(bag)
        return messages_of(bag)

    def test_the_runs_are_whole(self):
        for run in (self.fast, self.paced, self.other):
            self.assertEqual(set(run) - WALL_TIME, set(EXPECTED))
            for topic, least in EXPECTED.items():
                self.assertGreaterEqual(len(run[topic]), least, topic)
            for topic, publishers in SEVERAL_PUBLISHERS.items():
                self.assertEqual({sender for sender, _ in run[topic]}, publishers)

    def test_the_same_seed_gives_the_same_bytes_at_any_speed(self):
        for topic in EXPECTED:
            with self.subTest(topic):
                self.assertIsNone(first_difference(self.fast[topic], self.paced[topic]))

    def test_readers_show_the_same_order(self):
        for topic in EXPECTED:
            with self.subTest(topic):
                self.assertIsNone(first_difference(self.shown["fast"][topic], self.shown["paced"][topic]))

    def test_another_seed_gives_other_scans(self):
        self.assertIsNotNone(first_difference(self.fast["/m2wr/laser/scan"], self.other["/m2wr/laser/scan"]))


if __name__ == "__main__":
    rospy.init_node("check_lockstep_repeat", disable_rostime=True)
    run_checks("lockstep_repeat", Repeat)
