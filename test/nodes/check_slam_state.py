#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Saving and loading the state, starting on a saved map, and frames with a prefix, with a running slam_gmapping."""
import os
import signal
import sys
import tempfile
import unittest

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from m2wr_gmapping.srv import StateFile
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetMap
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from mapping_robot import ROOM, Mapping, Robot, transform, walls_apart, xyt  # noqa: E402
from sim_probe import PATIENCE, Recorder, program, run_checks, run_program, wait_until  # noqa: E402

CELL = 0.05
QUICK = ["_xmin:=-1", "_xmax:=1", "_ymin:=-1", "_ymax:=1", "_particles:=15", "_maxUrange:=9.9", "_maxRange:=9.95",
         "_linearUpdate:=0.15", "_angularUpdate:=0.2", "_map_update_interval:=0"]
#: A tour of the room: forward, turn, forward.
TOUR = [(0.05 * k, 0.0, 0.0) for k in range(16)] + [(0.75, 0.0, 0.1 * k) for k in range(1, 12)]
HALF = 14


def state_service(verb, name):
    """Call ~save_state or ~load_state; returns the answer."""
    service = "/slam_gmapping/%s_state" % verb
    rospy.wait_for_service(service, PATIENCE)
    return rospy.ServiceProxy(service, StateFile)(name)


def newest_map():
    """Return the newest map."""
    recorder = Recorder("/map", OccupancyGrid)
    try:
        return recorder.wait(lambda messages: messages[-1], "a map")
    finally:
        recorder.close()


def first_map():
    """Wait for a map, which is made in a thread of its own, and return the service's copy."""
    found = []

    def answered():
        try:
            found.append(rospy.ServiceProxy("/dynamic_map", GetMap)().map)
        except rospy.ServiceException:
            pass                            # there is none yet
        return found
    wait_until(answered, "a map from the service")
    return found[-1]


class SlamState(unittest.TestCase):
    """Every test starts nodes of its own; time continues from one to the next."""

    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()

    def setUp(self):
        self.robot.now += 100.0
        for name in ("/slam_gmapping", "/tf_prefix"):
            if rospy.has_param(name):
                rospy.delete_param(name)
        self.robot.prefix = ""
        self.robot.mount()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.words = QUICK + ["_state_folder:=" + self.folder]

    def path(self, name):
        """Return the path of a file of this test."""
        return os.path.join(self.folder, name)

    def ended_map(self, node, name):
        """End a node that saves its map on exit; returns the picture."""
        code, _ = node.end(signal.SIGINT)
        self.assertEqual(code, 0, node.text)
        with open(self.path(name + ".pgm"), "rb") as stream:
            return stream.read()

    def test_a_resumed_run_gives_the_map_of_an_uninterrupted_run(self):
        def words(name):
            return self.words + ["_save_on_exit:=" + self.path(name)]
        with Mapping(self.robot, words("a")) as node:
            node.drive(TOUR[:HALF])
            answer = state_service("save", self.path("half.state"))
            self.assertTrue(answer.success, answer.message)
            self.assertIn(self.path("half.state"), answer.message)
            whole = xyt(node.drive(TOUR[HALF:]))
            picture = self.ended_map(node, "a")
        # a node that starts with it
        with Mapping(self.robot, words("b") + ["_state_file:=" + self.path("half.state")]) as node:
            grid = newest_map()                             # before there was any scan
            apart = walls_apart(grid, ROOM)
            self.assertGreater(np.mean(apart <= 1.5 * CELL), 0.99)
            np.testing.assert_array_equal(xyt(node.drive(TOUR[HALF:])), whole)
            self.assertEqual(self.ended_map(node, "b"), picture)
        # a node that loads it during the run, and saves and loads again
        with Mapping(self.robot, words("c") + ["_state_file:=" + self.path("none.state")]) as node:
            self.assertIn("there is no state", node.text)
            node.drive(TOUR[3:9])
            self.assertTrue(state_service("load", self.path("half.state")).success)
            node.drive(TOUR[HALF:HALF + 4])
            for verb in ("save", "load"):
                self.assertTrue(state_service(verb, "").success)            # ~state_file
            self.assertTrue(os.path.exists(self.path("none.state")))
            np.testing.assert_array_equal(xyt(node.drive(TOUR[HALF + 4:])), whole)
            path = Recorder("/slam_gmapping/path", Path)
            path.wait(lambda messages: len(messages[-1].poses) > 4, "the path of all of the run")
            path.close()
            self.assertEqual(self.ended_map(node, "c"), picture)

    def test_a_restarted_odometry_continues_from_the_last_pose(self):
        with Mapping(self.robot, self.words) as node:
            node.drive(TOUR[:HALF])
            self.assertTrue(state_service("save", self.path("half.state")).success)
        with Mapping(self.robot, self.words + ["_state_file:=" + self.path("half.state"),
                                               "_odometry_runs_on:=false"]) as node:
            robot, begin = self.robot, np.array(TOUR[HALF - 1])
            for pose in TOUR[HALF - 1:]:
                robot.tell_time(robot.now + 0.1)
                robot.stand(tuple(np.array(pose) - begin))          # the heading is 0 at the break: a plain difference
                answer = node.wait_for_pose(robot.look(pose).header.stamp)
            self.assertLess(np.abs(xyt(answer) - TOUR[-1]).max(), 0.03)
            node.wait_for_text("from that of the state")

    def test_failed_saves_and_loads_are_reported_and_change_nothing(self):
        with open(self.path("text.state"), "w") as stream:
            stream.write("no state")
        with Mapping(self.robot, self.words) as node:
            answer = state_service("save", self.path("a.state"))
            self.assertEqual((answer.success, "no state to save" in answer.message), (False, True))
            node.drive(TOUR[:HALF])
            for verb, name, words in (("save", "", "~state_file"), ("load", "", "~state_file"),
                                      ("save", self.path("nowhere/a.state"), "cannot write"),
                                      ("save", "/tmp/outside.state", "~state_folder"),
                                      ("save", "../outside.state", "~state_folder"),
                                      ("load", "/etc/passwd", "~state_folder"),
                                      ("load", self.path("none.state"), "No such file"),
                                      ("load", self.path("text.state"), "expected a state")):
                answer = state_service(verb, name)
                self.assertEqual((answer.success, words in answer.message), (False, True), answer.message)
            self.assertLess(np.abs(xyt(node.drive(TOUR[HALF:])) - TOUR[-1]).max(), 0.03)
        done = run_program([program("m2wr_gmapping", "slam_gmapping"), "_state_file:=" + self.path("text.state")])
        self.assertEqual(done.returncode, 1)
        self.assertIn("expected a state", done.stdout + done.stderr)

    def test_a_state_of_another_laser_is_refused_with_a_message(self):
        with Mapping(self.robot, self.words) as node:
            node.drive(TOUR[:3])
            self.assertTrue(state_service("save", self.path("a.state")).success)
        with Mapping(self.robot, self.words + ["_state_file:=" + self.path("a.state")]) as node:
            self.robot.tick(TOUR[3], count=91)
            node.wait_for_text("91 beams")
            node.drive(TOUR[3:5])                           # the right laser continues

    def test_start_on_a_saved_map(self):
        with Mapping(self.robot, self.words + ["_save_on_exit:=" + self.path("plan")]) as node:
            node.drive(TOUR)
            self.ended_map(node, "plan")
        with Mapping(self.robot, self.words + ["_map_file:=" + self.path("plan.yaml"), "_initial_pose_x:=0.6",
                                               "_initial_pose_y:=0.4", "_initial_pose_a:=1.3"]) as node:
            answer = None
            for k in range(4):                              # odometry begins at 0 there
                self.robot.tell_time(self.robot.now + 0.1)
                self.robot.stand((0.0, 0.0, 0.1 * k))
                answer = node.wait_for_pose(self.robot.look((0.75, 0.0, 1.1 + 0.1 * k)).header.stamp)
            self.assertLess(np.abs(xyt(answer) - (0.75, 0.0, 1.4)).max(), 0.05)
            node.wait_for_text("starts on the map")
            grid = newest_map()
            apart = walls_apart(grid, ROOM)
            self.assertGreater(len(apart), 200)
            self.assertGreater(np.mean(apart <= 1.5 * CELL), 0.98)
        done = run_program([program("m2wr_gmapping", "slam_gmapping"), "_map_file:=" + self.path("none.yaml")])
        self.assertEqual(done.returncode, 1)
        self.assertIn("none.yaml: No such file", done.stdout + done.stderr)

    def test_a_jump_of_the_pose_leaves_a_map_of_bounded_size(self):
        with Mapping(self.robot, self.words) as node:
            node.drive(TOUR[:3])
            robot = self.robot
            for x in (500.0, 1000.0, 2000.0):
                robot.tell_time(robot.now + 0.1)
                robot.stand((x, x, 0.0))
                node.wait_for_pose(robot.look((0.1, 0.0, 0.0)).header.stamp)
            node.wait_for_text("reached its size limit")
            grid = first_map().info
            self.assertLessEqual(grid.width * grid.height, 100000000)

    def test_frames_have_the_prefix_of_tf(self):
        rospy.set_param("/tf_prefix", "/r1/")
        self.robot.prefix = "r1/"
        self.robot.mount()
        with Mapping(self.robot, self.words) as node:
            transforms = Recorder("/tf", TFMessage)     # not earlier: the robot takes the first subscriber for the node
            answer = node.drive(TOUR[:3])
            self.assertEqual(answer.header.frame_id, "r1/map")
            self.assertEqual(first_map().header.frame_id, "r1/map")

            def sent():
                self.robot.tell_time(self.robot.now + 0.02)     # it is sent as time advances
                return any((entry.header.frame_id, entry.child_frame_id) == ("r1/map", "r1/odom")
                           for message in transforms.messages for entry in message.transforms)
            wait_until(sent, "the transform r1/map -> r1/odom")
            transforms.close()
        # a name that has the prefix already, and one with a slash in front
        with Mapping(self.robot, self.words + ["_odom_frame:=r1/odom", "_map_frame:=/plan"]) as node:
            self.assertEqual(node.drive(TOUR[:3]).header.frame_id, "plan")

    def test_diagnostics_report_the_mapper_and_missing_transforms(self):
        def status(fits, what):
            recorder = Recorder("/diagnostics", DiagnosticArray)
            try:
                return recorder.wait(lambda messages: next((
                    entry for message in messages[::-1] for entry in message.status
                    if entry.name == "slam_gmapping: mapping" and fits(entry)), None), what)
            finally:
                recorder.close()
        with Mapping(self.robot, self.words) as node:
            self.robot.tell_time(self.robot.now + 0.1)
            self.robot.look(TOUR[0])        # before the first transform: a laser may start before the odometry
            node.drive(TOUR)
            found = status(lambda entry: any((value.key, value.value) == ("scans", str(len(TOUR) + 1))
                                             for value in entry.values), "diagnostics after the drive")
            values = {value.key: value.value for value in found.values}
            self.assertEqual((values["dropped"], values["without transform"], values["particles"]), ("0", "0", "15"))
            self.assertEqual(values["before the first transform"], "1")
            self.assertGreater(int(values["processed"]), 5)
            self.assertTrue(1.0 <= float(values["effective particles"]) <= 15.0)
            for name in ("mean time of a scan [ms]", "mean map [ms]", "peak memory [MiB]"):
                self.assertGreater(float(values[name]), 0.0, name)
            self.assertNotIn(", this node publishes ", node.text)
            self.robot.tf.publish(TFMessage([transform("map", "odom", rospy.Time.from_sec(self.robot.now))]))
            node.wait_for_text("publishes map -> odom, this node publishes map -> odom")
        with Mapping(self.robot, self.words + ["_odom_frame:=nowhere"]) as node:
            self.robot.tick((0.0, 0.0, 0.0))
            found = status(lambda entry: "nowhere -> sensor_laser" in entry.message, "the missing transform")
            self.assertEqual(found.level, 1)


if __name__ == "__main__":
    rospy.init_node("check_slam_state", disable_rostime=True)
    run_checks("mapping_state", SlamState)
