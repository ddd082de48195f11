#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""slam_gmapping: names, latching, timing, error handling, and its maps compared with the true world."""
import json
import math
import os
import signal
import sys
import tempfile
import time
import unittest

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import MapMetaData, OccupancyGrid, Path
from nav_msgs.srv import GetMap
from std_msgs.msg import Float64
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from mapping_robot import ROOM, Mapping, Robot, about_z, plane_geometry, walls_apart, whole_bag, xyt  # noqa: E402
from sim_probe import PATIENCE, Recorder, Running, data_path, program, run_checks, run_program, wait_until  # noqa: E402

SMALL = ["_xmin:=-1", "_xmax:=1", "_ymin:=-1", "_ymax:=1", "_particles:=15", "_maxUrange:=9.9",
         "_maxRange:=9.95"]
QUICK = SMALL + ["_linearUpdate:=0.15", "_angularUpdate:=0.2", "_map_update_interval:=0"]
CELL = 0.05
#: A tour of the room: forward, turn, forward.
TOUR = [(0.05 * k, 0.0, 0.0) for k in range(16)] + [(0.75, 0.0, 0.1 * k) for k in range(1, 12)]


class SlamGmapping(unittest.TestCase):
    """Every test starts a node of its own; time continues from one to the next."""

    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()
        cls.robot.mount()

    def setUp(self):
        self.robot.now += 100.0             # separates the tests
        if rospy.has_param("/slam_gmapping"):
            rospy.delete_param("/slam_gmapping")
        self.robot.mount()

    def newest_map(self, condition=lambda _: True, what="a map"):
        """Return the newest map that meets a condition."""
        recorder = Recorder("/map", OccupancyGrid)
        try:
            return recorder.wait(lambda messages: messages[-1] if condition(messages[-1]) else None, what)
        finally:
            recorder.close()

    # ---- names, latching, values

    def test_without_scans_the_transform_is_identity_and_no_map(self):
        with Mapping(self.robot, QUICK + ["_transform_publish_period:=0.1", "_tf_delay:=0.3"]):
            transforms = Recorder("/tf", TFMessage)

            def sent(messages):
                self.robot.tell_time(self.robot.now + 0.02)
                entries = [entry for message in messages for entry in message.transforms
                           if entry.header.frame_id == "map"]
                return entries if len(entries) > 5 else None
            wait_until(lambda: sent(transforms.messages), "six transforms map -> odom")
            entries = sent(transforms.messages)
            transforms.close()
            for entry in entries:
                self.assertEqual((entry.child_frame_id, entry.transform.rotation.w), ("odom", 1.0))
            stamps = [entry.header.stamp.to_sec() for entry in entries]
            self.assertLess(stamps[-1] - self.robot.now, 0.3 + 1e-6)
            self.assertGreater(np.diff(stamps).min(), 0.0)
            rospy.wait_for_service("/dynamic_map", PATIENCE)
            with self.assertRaisesRegex(rospy.ServiceException, "no map yet"):
                rospy.ServiceProxy("/dynamic_map", GetMap)()

    def test_a_drive_gives_the_map_of_its_world(self):
        grids, infos = Recorder("/map", OccupancyGrid), Recorder("/map_metadata", MapMetaData)
        with Mapping(self.robot, QUICK + ["scan:=/scan"]) as node:
            answered = node.play("boxes_drive")
            self.assertGreater(len(answered), 95, "scans were lost")
            newest = [None]

            def settled():
                newest[0] = rospy.ServiceProxy("/dynamic_map", GetMap)().map
                return (infos.messages and grids.messages and newest[0].info == infos.messages[-1]
                        and newest[0] == grids.messages[-1])
            wait_until(settled, "the service to answer with the newest map")
            grid = newest[0]
            self.assertEqual(grid.header.frame_id, "map")
            self.assertAlmostEqual(grid.info.resolution, CELL, places=6)
            self.assertEqual(grid.info, infos.messages[-1])
            self.assertEqual((grid.info.width % 32, grid.info.height % 32), (0, 0))
            self.assertLessEqual(set(grid.data), {-1, 0, 100})
            late = Recorder("/map", OccupancyGrid)      # latched: also for a later subscriber
            late.wait(lambda messages: messages[-1] == grid, "the latched map")
            late.close()
            apart = walls_apart(grid, plane_geometry.read_boxes(data_path("boxes.world")))
            self.assertGreater(len(apart), 150)
            self.assertGreater(np.mean(apart <= 1.5 * CELL), 0.99, np.sort(apart)[-10:])
            path = Recorder("/slam_gmapping/path", Path)
            poses = path.wait(lambda messages: messages[-1].poses, "the path")
            path.close()
            self.assertEqual(poses[0].header.frame_id, "map")
            self.assertLess(np.hypot(*xyt(poses[0])[:2]), 0.06)
            for topic, kind in (("particles", PoseArray), ("entropy", Float64)):
                recorder = Recorder("/slam_gmapping/" + topic, kind)
                message = recorder.wait(lambda messages: messages[-1], topic)
                recorder.close()
                if kind is PoseArray:
                    self.assertEqual(len(message.poses), 15)
                else:
                    self.assertTrue(0.0 < message.data <= math.log(15) + 1e-9)
        grids.close()
        infos.close()

    def test_the_estimated_pose_corrects_the_odometry(self):
        with Mapping(self.robot, QUICK) as node:
            robot = self.robot
            answer = None
            for x, y, yaw in TOUR:
                robot.tell_time(robot.now + 0.1)
                robot.stand((1.05 * x, y + 0.03 * x, 0.95 * yaw))       # wheels with wrong parameters
                scan = robot.look((x, y, yaw))
                answer = node.wait_for_pose(scan.header.stamp)
            error = xyt(answer) - TOUR[-1]
            self.assertLess(np.hypot(error[0], error[1]), 0.03)
            self.assertLess(abs(error[2]), 0.02)
            covariance = np.array(answer.pose.covariance).reshape(6, 6)
            self.assertGreater(np.linalg.eigvalsh(covariance[np.ix_([0, 1, 5], [0, 1, 5])]).min(), 0.0)

    # ---- lasers

    def laser_gives_the_room(self, mount=(0.15, 0.0, 0.0), quaternion=None, words=(), **laser):
        self.robot.mount(about_z(mount[2]) if quaternion is None else quaternion, mount[0], mount[1])
        with Mapping(self.robot, QUICK + list(words)) as node:
            answer = node.drive(TOUR, mount=mount, **laser)
            error = xyt(answer) - TOUR[-1]
            self.assertLess(np.hypot(error[0], error[1]), 0.03)
            self.assertLess(abs(error[2]), 0.02)
            grid = self.newest_map(lambda grid: grid.data.count(100) > 150, "a map of the room")
            apart = walls_apart(grid, ROOM)
            self.assertGreater(np.mean(apart <= 1.5 * CELL), 0.99, np.sort(apart)[-10:])

    def test_an_inverted_off_centre_laser_with_an_asymmetric_scan(self):
        # rotated by pi about x: its axes y and z are reversed
        self.laser_gives_the_room(mount=(0.1, 0.2, 0.0), quaternion=(1.0, 0.0, 0.0, 0.0), upside_down=True,
                                  angle_min=-0.6, increment=math.pi / 120, count=200)

    def test_a_laser_that_looks_backwards_and_scans_clockwise(self):
        self.laser_gives_the_room(mount=(-0.2, 0.0, math.pi), angle_min=2.0, increment=-math.pi / 90, count=230)

    def test_a_360_degree_scan_of_4000_beams(self):
        self.laser_gives_the_room(angle_min=-math.pi, increment=2.0 * math.pi / 4000, count=4000)

    # ---- what is missing or wrong

    def test_a_missing_transform_is_named(self):
        with Mapping(self.robot, QUICK + ["_odom_frame:=nowhere"]) as node:
            self.robot.tick((0.0, 0.0, 0.0))
            node.wait_for_text("scans wait for the transform nowhere -> sensor_laser")
            self.assertIn("link_chassis", node.text.split("Frames known")[1])

    def test_a_missing_mount_is_named(self):
        with Mapping(self.robot, QUICK + ["_base_frame:=body"]) as node:
            self.robot.tick((0.0, 0.0, 0.0))
            node.wait_for_text("the transform body -> sensor_laser")

    def test_parameters_of_any_type_work_and_unknown_ones_are_named(self):
        rospy.set_param("/slam_gmapping/speed_of_light", 3)
        rospy.set_param("/slam_gmapping/sigma", "wide")
        with Mapping(self.robot, QUICK + ["_particles:=12.4", "_maxUrange:=6", "_iterations:=5.0"]) as node:
            node.drive(TOUR[:5])
            self.assertEqual(node.text.count("speed_of_light"), 1)
            self.assertIn("sigma: 'wide'", node.text)
            particles = Recorder("/slam_gmapping/particles", PoseArray)
            self.assertEqual(len(particles.wait(lambda messages: messages[-1], "particles").poses), 12)
            particles.close()

    def test_a_value_out_of_range_ends_the_program_with_the_range(self):
        for words in (["_delta:=0"], ["_particles:=0"], ["_xmin:=3", "_xmax:=2"]):
            done = run_program([program("m2wr_gmapping", "slam_gmapping")] + words)
            rospy.delete_param("/slam_gmapping")
            self.assertEqual(done.returncode, 1, words)
            self.assertIn("expected", done.stdout + done.stderr, words)

    def test_invalid_scans_are_refused_and_the_node_continues(self):
        with Mapping(self.robot, QUICK) as node:
            node.drive(TOUR[:8])
            robot, pose = self.robot, TOUR[7]
            for ranges in ([], [1.0] * 7, [math.nan] * 181, [math.inf] * 181, [0.0] * 181, [-1.0] * 181, [1e30] * 181):
                robot.tell_time(robot.now + 0.1)
                robot.stand(pose)
                robot.scan(ranges)
            robot.tell_time(robot.now + 0.1)
            robot.stand(pose)
            robot.scan([2.0] * 181, frame="link_chassis")       # another laser
            robot.stand((math.nan, 0.0, 0.0))
            answer = node.drive(TOUR[7:])
            self.assertLess(np.abs(xyt(answer) - TOUR[-1]).max(), 0.03)
            self.assertIn("0 ranges; expected 181", node.text)
            self.assertIsNone(node.process.poll())
            diagnostics = Recorder("/diagnostics", DiagnosticArray)
            values = diagnostics.wait(lambda messages: [
                {entry.key: entry.value for entry in status.values} for message in messages
                for status in message.status if status.name == "slam_gmapping: mapping"], "diagnostics")[-1]
            diagnostics.close()
            self.assertGreaterEqual(int(values["refused"]), 3)
            self.assertGreater(int(values["processed"]), 5)

    def test_an_unreachable_minimum_score_is_reported_once(self):
        with Mapping(self.robot, QUICK + ["_minimumScore:=200"]) as node:
            node.drive(TOUR[:10])
            self.assertEqual(node.text.count("minimumScore 200 can never be reached"), 1)

    def test_time_that_jumps_back_begins_a_new_map(self):
        with Mapping(self.robot, QUICK) as node:
            robot = self.robot
            node.drive(TOUR)
            self.newest_map(lambda grid: grid.data.count(100) > 150, "a map of the room")
            robot.tell_time(robot.now - 50.0)
            node.wait_for_text("jumped back")
            answer = node.drive(TOUR[:3])
            self.assertLess(np.abs(xyt(answer) - TOUR[2]).max(), 0.03)
            path = Recorder("/slam_gmapping/path", Path)
            path.wait(lambda messages: len(messages[-1].poses) == 1, "a path that starts again")
            path.close()
            self.assertEqual(node.text.count("jumped back"), 1)
            robot.now += 60.0

    def test_scans_are_skipped_while_the_robot_settles(self):
        with Mapping(self.robot, QUICK + ["_settle_time:=0.45"]) as node:
            for _ in range(5):
                self.robot.tick((0.3, 0.0, 0.0))
            stamp = self.robot.tick((0.0, 0.0, 0.0)).header.stamp
            self.assertEqual(node.wait_for_pose(stamp).header.stamp, stamp)
            self.assertEqual({message.header.stamp for message in node.poses.messages}, {stamp})

    def test_one_of_three_scans_is_taken_when_throttled(self):
        with Mapping(self.robot, QUICK + ["_throttle_scans:=3"]) as node:
            robot = self.robot
            for pose in TOUR[:10]:
                stamp = robot.tick(pose).header.stamp
                if pose in TOUR[2:9:3]:
                    node.wait_for_pose(stamp)
            self.assertEqual(len({message.header.stamp for message in node.poses.messages}), 3)

    # ---- changing and saving

    def test_a_parameter_changes_while_it_runs(self):
        with Mapping(self.robot, QUICK + ["_linearUpdate:=100", "_angularUpdate:=100"]) as node:
            node.drive(TOUR[:10])
            rospy.wait_for_service("/slam_gmapping/set_parameters", PATIENCE)
            answer = rospy.ServiceProxy("/slam_gmapping/set_parameters", Reconfigure)(
                Config(doubles=[DoubleParameter("linearUpdate", 0.1)]))
            self.assertAlmostEqual({entry.name: entry.value for entry in answer.config.doubles}["linearUpdate"], 0.1)
            node.drive(TOUR[10:16])
            path = Recorder("/slam_gmapping/path", Path)
            path.wait(lambda messages: len(messages[-1].poses) >= 2, "a path of more than the first scan")
            path.close()

    def test_the_map_is_saved_by_map_saver_and_at_the_end(self):
        with tempfile.TemporaryDirectory() as folder:
            with Mapping(self.robot, QUICK + ["_save_on_exit:=" + os.path.join(folder, "last")], "gmapping") as node:
                node.drive(TOUR)
                self.newest_map(lambda grid: grid.data.count(100) > 150, "a map of the room")
                for package in ("m2wr_gmapping", "map_server"):
                    done = run_program([program(package, "map_saver"), "-f", os.path.join(folder, package)])
                    self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                code, _ = node.end(signal.SIGINT)
                self.assertEqual(code, 0, node.text)
            self.assertEqual(sorted(os.listdir(folder)), sorted(
                name + ending for name in ("last", "m2wr_gmapping", "map_server") for ending in (".pgm", ".yaml")))
            pictures = []
            for name in ("last", "m2wr_gmapping", "map_server"):
                with open(os.path.join(folder, name + ".pgm"), "rb") as stream:
                    pictures.append(stream.read())
            self.assertEqual(pictures[1], pictures[2])
            self.assertGreater(pictures[0].count(b"\0"), 150)
            self.read_back(os.path.join(folder, "last"), pictures[0])

    def read_back(self, name, picture):
        """Publish a saved map with map_server; it must be what was saved."""
        grid = Recorder("/read/map", OccupancyGrid)
        with Running([program("map_server", "map_server"), name + ".yaml", "__ns:=/read"]):
            clock = time.monotonic()

            def came():
                self.robot.tell_time(self.robot.now + 0.001)
                return grid.messages or time.monotonic() - clock > PATIENCE
            wait_until(came, "the map that map_server publishes")
            message = grid.messages[-1]
            again = rospy.ServiceProxy("/read/static_map", GetMap)().map
        grid.close()
        self.assertEqual(again, message)
        cells = np.array(message.data, np.int8).reshape(message.info.height, message.info.width)[::-1]
        shown = np.frombuffer(picture[-cells.size:], np.uint8).reshape(cells.shape)
        np.testing.assert_array_equal(cells, np.select([shown == 254, shown == 0], [0, 100], -1))

    def test_the_replay_publishes_its_map_as_a_node(self):
        rospy.set_param("/slam_gmapping/particles", 12)         # as a launch file sets it
        with tempfile.TemporaryDirectory() as folder:
            bag, saved, asked = (os.path.join(folder, name) for name in ("drive.bag", "saved", "asked"))
            whole_bag("boxes_drive", bag)
            replay = [program("gmapping", "slam_gmapping_replay"), "--bag_filename", bag, "--scan_topic",
                      "/m2wr/laser/scan", "_base_frame:=link_chassis"] + SMALL[:4]
            with Running(replay + ["__name:=slam_gmapping"]) as node:
                node.wait_for_text("the map stays on /map")
                grid = self.newest_map()
                self.assertEqual(rospy.ServiceProxy("/dynamic_map", GetMap)().map, grid)
                self.assertGreater(grid.data.count(100), 150)
                self.assertEqual(node.end(signal.SIGINT)[0], 0, node.text)
            saver = "{} -f {}; exit 3".format(program("map_server", "map_saver"), asked)
            done = run_program(replay + ["--quiet", "--map", saved, "--stats", saved + ".json", "--on_done", saver])
            self.assertEqual(done.returncode, 3, done.stdout + done.stderr)
            pictures = []
            for name in (saved, asked):
                with open(name + ".pgm", "rb") as stream:
                    pictures.append(stream.read())
            with open(saved + ".json", encoding="utf-8") as stream:
                self.assertEqual(json.load(stream)["particles"], 12)
        self.assertEqual(*pictures)

    def test_map_saver_refuses_thresholds_that_do_not_fit(self):
        done = run_program([program("m2wr_gmapping", "map_saver"), "--occ", "20", "--free", "30"])
        self.assertEqual(done.returncode, 2)
        self.assertIn("expected 0 <= free < occ <= 100", done.stderr)


if __name__ == "__main__":
    rospy.init_node("check_slam_gmapping", disable_rostime=True)
    run_checks("mapping_node", SlamGmapping)
