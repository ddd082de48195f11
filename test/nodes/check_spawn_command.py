#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The spawn_model command: sources, options and exit codes."""
import math
import os
import signal
import sys
import tempfile
import unittest
from concurrent.futures import ThreadPoolExecutor

import rospy
from sensor_msgs.msg import JointState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import (  # noqa: E402
    Recorder,
    Running,
    Simulation,
    data_path,
    data_text,
    program,
    run_checks,
    run_program,
    wait_until,
    xyz,
)

SIDE_BY_SIDE = 2
ROBOT = ["-urdf", "-param", "robot_description", "-model"]
MISUSE = (
    [], ["-urdf", "-param", "p"], ["-model", "m"], ["-urdf", "-model", "m"], ["-param", "p", "-model", "m"],
    ["-urdf", "-sdf", "-param", "p", "-model", "m"], ["-urdf", "-param", "p", "-file", "f", "-model", "m"],
    ["-urdf", "-stdin", "-file", "f", "-model", "m"], ROBOT + ["m", "-x", "left"],
    ROBOT + ["m", "-J", "joint_left_wheel"], ROBOT + ["m", "-J", "joint_left_wheel", "far"],
    ROBOT + ["m", "-no_such_option"],
    ["-urdf", "-database", "can", "-model", "m"],
)
UNUSABLE = (        # arguments, standard input, words of the message
    (["-urdf", "-file", "/no/such/robot.urdf", "-model", "bad"], None, ["/no/such/robot.urdf"]),
    (["-urdf", "-file", data_path("bad", "empty.urdf"), "-model", "bad"], None, ["empty.urdf", "is empty"]),
    (["-urdf", "-param", "no_such_parameter", "-model", "bad"], None, ["no_such_parameter", "not set"]),
    (["-urdf", "-param", "empty_description", "-model", "bad"], None, ["empty_description", "is empty"]),
    (["-urdf", "-stdin", "-model", "bad"], "", ["standard input"]),
    (["-urdf", "-file", data_path("bad", "broken.urdf"), "-model", "bad"], None, ["Invalid XML", "broken.urdf"]),
    (["-urdf", "-file", data_path("bad", "entities.urdf"), "-model", "bad"], None, ["Invalid XML", "entities.urdf"]),
    (["-urdf", "-file", data_path("bad", "no_links.urdf"), "-model", "bad"], None, ["no link", "expected"]),
    (["-urdf", "-file", data_path("bad", "limit_without_effort.urdf"), "-model", "bad"], None, ["shoulder", "effort"]),
    (["-urdf", "-file", data_path("bad", "negative_mass.urdf"), "-model", "bad"], None, ["base", "positive mass"]),
    (["-urdf", "-file", data_path("bad", "unknown_package.urdf"), "-model", "bad"], None,
     ["Service call failed", "no_such_package"]),
    (["-urdf", "-file", data_path("crate.sdf"), "-model", "bad"], None,
     ["Service call failed", "entity format is invalid"]),
    (["-sdf", "-database", "no_such_model", "-model", "bad"], None, ["no_such_model"]),
    (ROBOT + ["bad", "-reference_frame", "nowhere"], None, ["reference_frame not found"]),
    (ROBOT + ["ground_plane"], None, ["SpawnModel: Failure - entity already exists."]),
)


def turned(axis, angle):
    """Return the quaternion (x, y, z, w) of a rotation about x, y or z."""
    parts = [0.0, 0.0, 0.0, math.cos(0.5 * angle)]
    parts["xyz".index(axis)] = math.sin(0.5 * angle)
    return parts


def product(a, b):
    """Return the Hamilton product of two quaternions (x, y, z, w)."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return [aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz]


class SpawnCommand(unittest.TestCase):
    """Every case begins with an empty, unpaused world."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.command = [program("m2wr_sim", "spawn_model")]
        cls.simulation.models()

    def setUp(self):
        self.simulation.call("unpause_physics")
        self.simulation.delete_all()

    def run_command(self, arguments, text=None, environment=None):
        return run_program(self.command + arguments, text, environment)

    def assert_success(self, done):
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def pose_of(self, name):
        answer = self.simulation.call("get_model_state", name, "")
        self.assertTrue(answer.success, answer.status_message)
        return answer.pose

    # ---- exit codes --------------------------------------------------------------------------------------------

    def test_wrong_usage_exits_with_2_without_ros(self):
        nowhere = {"ROS_MASTER_URI": "http://127.0.0.1:1"}
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            results = pool.map(lambda words: self.run_command(words, environment=nowhere), MISUSE)
            for arguments, done in zip(MISUSE, results):
                self.assertEqual(done.returncode, 2, "%s: %s" % (arguments, done.stderr))
                self.assertIn("usage: spawn_model", done.stderr)
                self.assertNotIn("Traceback", done.stderr)

    def test_unusable_models_exit_with_1(self):
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            results = pool.map(lambda case: self.run_command(case[0], case[1]), UNUSABLE)
            for (arguments, _, words), done in zip(UNUSABLE, results):
                said = done.stdout + done.stderr
                self.assertEqual(done.returncode, 1, "%s: %s" % (arguments, said))
                for word in words:
                    self.assertIn(word, said, arguments)
                self.assertIn("Spawn service failed. Exiting.", done.stderr.strip().splitlines()[-1], arguments)
                self.assertNotIn("Traceback", said)
        self.assertEqual(self.simulation.models(), ["ground_plane"])

    # ---- sources -----------------------------------------------------------------------------------------------

    def test_parameter_with_pose_logs_its_steps_in_order(self):
        self.simulation.call("pause_physics")
        done = self.run_command(ROBOT + ["m2wr"] + "-x 1 -y -2 -z 3 -R 0.1 -P -0.2 -Y 0.7".split())
        self.assert_success(done)
        lines = ("Loading model XML from ros parameter robot_description",
                 "Waiting for service /gazebo/spawn_urdf_model", "Calling service /gazebo/spawn_urdf_model",
                 "Spawn status: SpawnModel: Successfully spawned entity")
        places = [done.stdout.find(line) for line in lines]
        self.assertEqual(places, sorted(places), done.stdout)
        self.assertNotIn(-1, places, done.stdout)
        pose = self.pose_of("m2wr")
        for found, wanted in zip(xyz(pose.position), (1.0, -2.0, 3.0)):
            self.assertAlmostEqual(found, wanted, delta=1e-5)
        # fixed axes: roll acts first
        wanted = product(product(turned("z", 0.7), turned("y", -0.2)), turned("x", 0.1))
        found = xyz(pose.orientation) + (pose.orientation.w,)
        self.assertAlmostEqual(abs(sum(a * b for a, b in zip(found, wanted))), 1.0, delta=1e-9)

    def test_file_standard_input_and_database(self):
        crate = data_text("crate.sdf")
        with tempfile.NamedTemporaryFile("w", suffix=".urdf", encoding="utf-8") as urdf:
            urdf.write(rospy.get_param("/robot_description"))
            urdf.flush()
            cases = ((["-urdf", "-file", urdf.name, "-model", "a"], None),
                     (["-urdf", "-stdin", "-model", "b", "-x", "1"], rospy.get_param("/robot_description")),
                     (["-sdf", "-file", data_path("crate.sdf"), "-model", "c", "-x", "2"], None),
                     (["-sdf", "-stdin", "-model", "d", "-x", "3"], crate),
                     (["-sdf", "-database", "construction_barrel", "-model", "e", "-x", "5"], None),
                     (["-sdf", "-database", "jersey_barrier", "-model", "f", "-y", "5"], None),
                     (["-sdf", "-database", "can", "-model", "g", "-y", "-5"], None))
            with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
                for done in pool.map(lambda case: self.run_command(*case), cases):
                    self.assert_success(done)
        self.assertEqual(sorted(self.simulation.models()), ["a", "b", "c", "d", "e", "f", "g", "ground_plane"])
        self.assertAlmostEqual(self.pose_of("c").position.x, 2.5, delta=1e-5)
        self.assertAlmostEqual(self.pose_of("e").position.x, 5.0, delta=1e-5)
        self.assertTrue(self.simulation.call("get_model_properties", "f").is_static)
        for name in "eg":           # as in Gazebo's database
            self.assertFalse(self.simulation.call("get_model_properties", name).is_static)

    def test_packages_of_meshes_become_models(self):
        arguments = ["-urdf", "-file", data_path("bad", "unknown_package.urdf"), "-model", "m", "-package_to_model"]
        self.assert_success(self.run_command(arguments))
        self.assertIn("m", self.simulation.models())

    # ---- options -----------------------------------------------------------------------------------------------

    def test_namespace_of_the_caller_and_of_the_option(self):
        cases = ((["a"], {"ROS_NAMESPACE": "robot2"}, "/robot2/odom"),
                 (["b", "-robot_namespace", "robot3", "-y", "2"], {}, "/robot3/odom"),
                 (["c", "-y", "4"], {}, "/odom"))
        with ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
            for done in pool.map(lambda case: self.run_command(
                    ["-urdf", "-param", "/robot_description", "-model"] + case[0], None, case[1]), cases):
                self.assert_success(done)
        published = dict(rospy.get_published_topics())
        for _, _, topic in cases:
            self.assertIn(topic, published)

    def test_joint_positions_frame_and_namespace_of_the_simulation(self):
        self.simulation.call("pause_physics")       # otherwise the wheel would roll
        done = self.run_command(ROBOT + ["m2wr", "-z", "0.1", "-J", "joint_left_wheel", "1.5",
                                         "-J", "joint_right_wheel", "-0.5", "-gazebo_namespace", "/gazebo",
                                         "-reference_frame", "ground_plane"])
        self.assert_success(done)
        states = Recorder("/joint_states", JointState).connected()
        self.simulation.call("unpause_physics")
        state = states.next()[0]
        positions = dict(zip(state.name, state.position))
        states.close()
        self.assertAlmostEqual(positions["joint_left_wheel"], 1.5, delta=0.02)
        self.assertAlmostEqual(positions["joint_right_wheel"], -0.5, delta=0.02)

    def test_unpause(self):
        self.simulation.call("pause_physics")
        before = self.simulation.time()
        self.assert_success(self.run_command(ROBOT + ["m2wr"]))
        self.assertEqual(self.simulation.time(), before)
        self.assert_success(self.run_command(ROBOT + ["m2wr_2", "-x", "2", "-unpause"]))
        self.simulation.wait_for_time(before + 0.1)

    def test_wait_for_another_model(self):
        with Running(self.command + ROBOT + ["late", "-x", "2", "-wait", "early"]) as waiting:
            waiting.wait_for_text("Waiting for model early")
            self.simulation.run_for(0.3)
            self.assertEqual(self.simulation.models(), ["ground_plane"])
            self.assert_success(self.run_command(ROBOT + ["early"]))
            self.assertEqual(waiting.wait(), 0, waiting.text)
        self.assertEqual(self.simulation.models(), ["ground_plane", "early", "late"])

    def test_bond_deletes_the_model_at_the_end(self):
        with Running(self.command + ROBOT + ["m2wr", "-b"]) as bond:
            bond.wait_for_text("delete model m2wr")
            self.assertIn("m2wr", self.simulation.models())
            code, _ = bond.end(signal.SIGINT)
            self.assertEqual(code, 0, bond.text)
        wait_until(lambda: "m2wr" not in self.simulation.models(), "the deletion of m2wr", 10.0)


if __name__ == "__main__":
    rospy.init_node("check_spawn_command", disable_rostime=True)
    run_checks("spawn_command", SpawnCommand)
