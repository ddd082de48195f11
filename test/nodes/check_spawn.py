#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""spawn_urdf_model, spawn_sdf_model and delete_model: texts, poses, namespaces, respawn, and refusals."""
import math
import os
import sys
import time
import unittest

import rosgraph
import rospy
from geometry_msgs.msg import Pose
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, data_text, make_pose, run_checks, wait_until, xyz, yaw_of  # noqa: E402

SPAWNED = "SpawnModel: Successfully spawned entity"
UNREADABLE = ("GazeboRosApiPlugin SpawnModel Failure: input model_xml not SDF or URDF, or cannot be converted to "
              "Gazebo compatible format.")
AT_ONCE = 5.0           # s; without simulated time to wait for, an answer takes milliseconds


class Spawn(unittest.TestCase):
    """Every case begins with an empty, unpaused world."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.urdf = rospy.get_param("/robot_description")
        cls.crate = data_text("crate.sdf")
        cls.log = Recorder("/rosout", Log).connected()
        cls.master = rosgraph.Master(rospy.get_name())

    def setUp(self):
        self.simulation.call("unpause_physics")
        self.simulation.delete_all()

    def refusal(self, *arguments, **options):
        """Spawn a model for which the call itself must fail; returns the text of the failure."""
        with self.assertRaises(rospy.ServiceException) as caught:
            self.simulation.spawn(*arguments, **options)
        return str(caught.exception)

    def topics(self):
        """Topics of the simulation whose last part is one of the robot's: published and subscribed."""
        state = self.master.getSystemState()
        names = [name for part in state[:2] for name, nodes in part if "/gazebo" in nodes]
        return sorted(name for name in names if name.rsplit("/", 1)[-1] in ("odom", "cmd_vel", "joint_states", "scan"))

    # ---- texts -------------------------------------------------------------------------------------------------

    def test_texts_of_success_and_failure(self):
        answer = self.simulation.spawn("m2wr", self.urdf)
        self.assertEqual((answer.success, answer.status_message), (True, SPAWNED))
        answer = self.simulation.spawn("m2wr", self.urdf, (3.0, 0.0, 0.1, 0.0))
        self.assertEqual((answer.success, answer.status_message), (
            False, "SpawnModel: Failure - entity already exists."))
        answer = self.simulation.spawn("other", self.urdf, frame="nowhere")
        self.assertEqual((answer.success, answer.status_message), (
            False, "SpawnModel: reference reference_frame not found, did you forget to scope the link by model name?"))
        answer = self.simulation.spawn("crate", self.crate, kind="sdf")
        self.assertEqual((answer.success, answer.status_message), (True, SPAWNED))
        self.assertEqual(self.simulation.models(), ["ground_plane", "m2wr", "crate"])
        answer = self.simulation.call("delete_model", "m2wr")
        self.assertEqual((answer.success, answer.status_message), (True, "DeleteModel: successfully deleted model"))
        for name in ("m2wr", "no_such_model", ""):
            answer = self.simulation.call("delete_model", name)
            self.assertEqual((answer.success, answer.status_message), (False, "DeleteModel: model does not exist"))
        self.assertEqual(self.simulation.models(), ["ground_plane", "crate"])

    def test_invalid_xml_makes_the_call_fail(self):
        for text in ("", "hello", self.crate):
            self.assertIn("SpawnModel: Failure - entity format is invalid.", self.refusal("m2wr", text))
        self.assertIn("urdf reference package name does not exist: no_such_package",
                      self.refusal("m2wr", data_text("bad", "unknown_package.urdf")))
        self.assertEqual(self.simulation.models(), ["ground_plane"])

    def test_unreadable_xml_gives_gazebos_text_and_a_logged_reason(self):
        self.log.clear()
        for text in ("", "hello", "<html/>"):
            answer = self.simulation.spawn("bad", text, kind="sdf")
            self.assertEqual((answer.success, answer.status_message), (False, UNREADABLE))
        self.log.wait(lambda messages: any("begins with <html>; expected <sdf>" in m.msg for m in messages), "a reason")

    def test_the_service_for_sdf_takes_a_urdf(self):
        self.assertEqual(self.simulation.spawn("m2wr", self.urdf, kind="sdf").status_message, SPAWNED)
        self.assertIn("/odom", self.topics())

    def test_bad_descriptions_are_refused_and_the_element_is_named(self):
        for name, words in (("no_links.urdf", ("robot", "at least one <link>")),
                            ("limit_without_effort.urdf", ("shoulder", "effort", "expected")),
                            ("negative_mass.urdf", ("base", "mass is -5", "expected a positive mass")),
                            ("broken.urdf", ("mismatch", "line")),
                            ("entities.urdf", ("entit",))):
            answer = self.simulation.spawn("bad", data_text("bad", name))
            self.assertFalse(answer.success, name)
            self.assertTrue(answer.status_message.startswith(UNREADABLE), answer.status_message)
            for word in words:
                self.assertIn(word, answer.status_message[len(UNREADABLE):], name)
            self.assertNotIn("Traceback", answer.status_message)
        self.assertEqual(self.simulation.models(), ["ground_plane"])

    def test_a_plugin_without_its_joint_is_named_and_the_rest_runs(self):
        self.log.clear()
        answer = self.simulation.spawn("bad", data_text("bad", "missing_joint.urdf"))
        self.assertEqual((answer.success, answer.status_message), (True, SPAWNED))
        line = self.log.wait(lambda messages: [m for m in messages if m.level == Log.ERROR], "an error")[0]
        for words in ("joint_left", "joint_right_wheel", "drive", "will not run"):
            self.assertIn(words, line.msg)
        self.assertNotIn("Traceback", line.msg)
        self.assertNotIn("/cmd_vel", self.topics())
        self.simulation.run_for(0.2)

    def test_numbers_that_are_not_finite_are_refused(self):
        for pose in ((math.nan, 0.0, 0.1, 0.0), (0.0, math.inf, 0.1, 0.0)):
            answer = self.simulation.spawn("m2wr", self.urdf, pose)
            self.assertFalse(answer.success)
            self.assertIn("not finite", answer.status_message)

    # ---- poses -------------------------------------------------------------------------------------------------

    def pose_of(self, name):
        answer = self.simulation.call("get_model_state", name, "")
        self.assertTrue(answer.success, answer.status_message)
        return answer.pose

    def assert_pose(self, name, expected):
        """Compare x, y, z, yaw; Gazebo writes a spawned pose as text of six digits, hence 1e-5."""
        pose = self.pose_of(name)
        for found, wanted in zip(xyz(pose.position) + (yaw_of(pose.orientation),), expected):
            self.assertAlmostEqual(found, wanted, delta=1e-5)

    def test_initial_pose_reference_frame_and_the_models_own_pose(self):
        self.simulation.call("pause_physics")
        self.simulation.spawn("first", self.urdf, (1.0, 2.0, 0.1, math.pi / 2.0))
        self.assert_pose("first", (1.0, 2.0, 0.1, math.pi / 2.0))
        self.simulation.spawn("second", self.urdf, (1.0, 0.0, 0.0, 0.25), frame="first")
        self.assert_pose("second", (1.0, 3.0, 0.1, math.pi / 2.0 + 0.25))
        self.simulation.spawn("third", self.urdf, (0.0, 1.0, 0.2, 0.0), frame="first::link_chassis")
        self.assert_pose("third", (0.0, 2.0, 0.3, math.pi / 2.0))
        for frame in ("", "world", "map", "/map"):
            self.simulation.spawn("crate", self.crate, (4.0, 4.0, 0.0, math.pi), frame=frame, kind="sdf")
            self.assert_pose("crate", (3.5, 4.0, 0.0, math.pi))
            self.simulation.call("delete_model", "crate")

    def test_default_constructed_pose_means_no_rotation(self):
        self.simulation.call("pause_physics")
        answer = self.simulation.call("spawn_urdf_model", "m2wr", self.urdf, "/", Pose(), "")
        self.assertTrue(answer.success, answer.status_message)
        self.assert_pose("m2wr", (0.0, 0.0, 0.0, 0.0))
        self.assertEqual(self.pose_of("m2wr").orientation.w, 1.0)

    # ---- namespaces --------------------------------------------------------------------------------------------

    def test_namespaces(self):
        tagged = self.urdf.replace("<leftJoint>", "<robotNamespace>/own</robotNamespace><leftJoint>")
        self.assertIn("/own", tagged)
        for namespace, xml, prefix in (("/", self.urdf, ""), ("robot1", self.urdf, "/robot1"),
                                       ("/robot1", self.urdf, "/robot1"), ("/a/b", self.urdf, "/a/b"),
                                       ("", self.urdf, "/m2wr"), ("robot1", tagged, "/own")):
            answer = self.simulation.spawn("m2wr", xml, namespace=namespace)
            self.assertTrue(answer.success, answer.status_message)
            # joint states do not come from a plugin of the description, so the tag of the drive does not change them
            states = {"/own": "/robot1"}.get(prefix, prefix)
            self.assertEqual(self.topics(), sorted([prefix + "/cmd_vel", prefix + "/odom", states + "/joint_states",
                                                    "/m2wr/laser/scan"]), namespace)
            self.simulation.call("delete_model", "m2wr")
            self.assertEqual(self.topics(), [])

    # ---- again -------------------------------------------------------------------------------------------------

    def test_respawn_under_the_same_name_keeps_subscribers(self):
        odometry, scans = Recorder("/odom", Odometry), Recorder("/m2wr/laser/scan", LaserScan)
        for x in (0.0, 1.0, 2.0):
            self.assertTrue(self.simulation.spawn("m2wr", self.urdf, (x, 0.0, 0.1, 0.0)).success)
            spawned = self.simulation.time()
            for recorder in (odometry, scans):
                recorder.clear()
                recorder.wait(lambda messages: len(messages) >= 3, "three messages after spawning at x = %g" % x)
            self.assertAlmostEqual(odometry.messages[-1].pose.pose.position.x, x, delta=0.01)
            self.assertGreater(odometry.messages[-1].header.stamp.to_sec(), spawned - 0.1)
            self.assertEqual(len(scans.messages[-1].ranges), 720)
            self.assertTrue(self.simulation.call("delete_model", "m2wr").success)
            wait_until(lambda: self.topics() == [], "the end of the deleted robot's topics", 10.0)
        odometry.close()
        scans.close()

    # ---- paused ------------------------------------------------------------------------------------------------

    def test_while_paused_every_answer_comes_at_once(self):
        self.simulation.call("pause_physics")
        begun, time_before = time.monotonic(), self.simulation.time()
        self.assertEqual(self.simulation.spawn("m2wr", self.urdf).status_message, SPAWNED)
        self.assertFalse(self.simulation.spawn("bad", data_text("bad", "broken.urdf")).success)
        self.assertFalse(self.simulation.spawn("bad", data_text("bad", "entities.urdf")).success)
        self.refusal("bad", data_text("bad", "unknown_package.urdf"))
        self.assertEqual(self.simulation.models(), ["ground_plane", "m2wr"])
        self.assertEqual(self.simulation.call("delete_model", "m2wr").status_message,
                         "DeleteModel: successfully deleted model")
        self.assertLess(time.monotonic() - begun, AT_ONCE)
        self.assertEqual(self.simulation.time(), time_before)

    def test_a_spawned_pose_is_where_a_reset_puts_the_model(self):
        self.simulation.spawn("m2wr", self.urdf, (1.0, 1.0, 0.1, 0.5))
        self.assertTrue(self.simulation.call("set_model_state", model_state=self.somewhere()).success)
        self.assertGreater(self.pose_of("m2wr").position.x, 3.0)
        self.simulation.call("pause_physics")
        self.simulation.call("reset_world")
        self.assert_pose("m2wr", (1.0, 1.0, 0.1, 0.5))

    @staticmethod
    def somewhere():
        """A state of m2wr far from where it was spawned."""
        from gazebo_msgs.msg import ModelState
        return ModelState(model_name="m2wr", pose=make_pose(4.0, 4.0, 0.1, 2.0))


if __name__ == "__main__":
    rospy.init_node("check_spawn", disable_rostime=True)
    run_checks("spawn", Spawn)
