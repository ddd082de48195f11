#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Reading and setting the state of models: texts, frames, topics, joints, properties."""
import math
import os
import sys
import unittest

import rospy
from geometry_msgs.msg import Pose, Twist, Vector3
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState

from gazebo_msgs.msg import LinkStates, ModelState, ModelStates
from gazebo_msgs.srv import GetModelState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, data_text, make_pose, run_checks, wait_until, xyz, yaw_of  # noqa: E402

LINKS = ["link_chassis", "link_left_wheel", "link_right_wheel"]
COLLISIONS = [
    "link_chassis_fixed_joint_lump__collision_chassis_collision",
    "link_chassis_fixed_joint_lump__caster_front_collision_collision_1",
    "link_chassis_fixed_joint_lump__sensor_laser_collision_2",
    "link_left_wheel_fixed_joint_lump__link_right_wheel_collision_collision",
    "link_right_wheel_collision_collision",
]
COM_X = 0.15 * 1.0 / 6.0      # m; 5 kg of chassis at x = 0 and 1 kg of laser at x = 0.15
DONE = "SetModelState: set model state done"


class State(unittest.TestCase):
    """Every case begins paused, with m2wr at the origin."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.urdf = rospy.get_param("/robot_description")

    def setUp(self):
        self.simulation.call("pause_physics")
        self.simulation.delete_all()
        self.assertTrue(self.simulation.spawn("m2wr", self.urdf).success)

    def put(self, name, pose, linear=(0.0, 0.0, 0.0), angular=(0.0, 0.0, 0.0), frame=""):
        """Call set_model_state with ``pose`` a Pose or (x, y, z, yaw)."""
        pose = pose if isinstance(pose, Pose) else make_pose(*pose)
        twist = Twist(Vector3(*linear), Vector3(*angular))
        answer = self.simulation.call("set_model_state", ModelState(name, pose, twist, frame))
        return answer.success, answer.status_message

    def get(self, name, frame=""):
        """Call get_model_state, which must succeed."""
        answer = self.simulation.call("get_model_state", name, frame)
        self.assertEqual((answer.success, answer.status_message), (True, "GetModelState: got properties"))
        return answer

    def assert_place(self, answer, expected):
        """Compare x, y, z and yaw of an answer; all computed in double precision, hence 1e-9."""
        found = xyz(answer.pose.position) + (yaw_of(answer.pose.orientation),)
        for have, want in zip(found, expected):
            self.assertAlmostEqual(have, want, delta=1e-9)

    def assert_vector(self, vector, expected):
        for have, want in zip(xyz(vector), expected):
            self.assertAlmostEqual(have, want, delta=1e-9)

    # ---- texts -------------------------------------------------------------------------------------------------

    def test_texts_of_failures(self):
        answer = self.simulation.call("get_model_state", "no_such_model", "")
        self.assertEqual((answer.success, answer.status_message), (False, "GetModelState: model does not exist"))
        for frame in ("nowhere", "odom", "default"):        # frames of tf and the world's own name are no entities
            answer = self.simulation.call("get_model_state", "m2wr", frame)
            self.assertEqual((answer.success, answer.status_message), (
                False, "GetModelState: reference relative_entity_name not found, did you forget to scope the body by "
                       "model name?"))
            self.assertEqual(self.put("m2wr", (0.0, 0.0, 0.1, 0.0), frame=frame),
                             (False, "SetModelState: specified reference frame entity does not exist"))
        self.assertEqual(self.put("no_such_model", (0.0, 0.0, 0.1, 0.0)),
                         (False, "SetModelState: model does not exist"))

    def test_numbers_that_are_not_finite_are_refused(self):
        before = self.get("m2wr")
        for pose, linear in (((math.nan, 0.0, 0.1, 0.0), (0.0, 0.0, 0.0)),
                             ((0.0, 0.0, 0.1, 0.0), (math.inf, 0.0, 0.0))):
            success, text = self.put("m2wr", pose, linear)
            self.assertFalse(success)
            self.assertIn("not finite", text)
        self.assertEqual(self.get("m2wr").pose, before.pose)

    def test_header_counts_the_calls_for_each_model_from_one(self):
        for name in ("counted", "apart"):
            self.assertTrue(self.simulation.spawn(name, data_text("crate.sdf"), kind="sdf").success)
        persistent = rospy.ServiceProxy("/gazebo/get_model_state", GetModelState, persistent=True)
        self.addCleanup(persistent.close)       # the count does not depend on the connection
        self.assertEqual([self.get("counted").header.seq for _ in range(3)], [1, 2, 3])
        self.assertEqual([persistent("apart", "").header.seq for _ in range(2)], [1, 2])
        self.assertEqual(persistent("counted", "nowhere").success, False)
        self.assertEqual([persistent("counted", "").header.seq, self.get("apart").header.seq], [5, 3])
        other = [self.get("ground_plane", "m2wr").header]
        self.assertEqual(other[0].frame_id, "m2wr")
        self.assertAlmostEqual(other[0].stamp.to_sec(), self.simulation.time(), delta=1e-6)

    # ---- frames ------------------------------------------------------------------------------------------------

    def test_pose_and_velocity_in_the_world(self):
        for frame in ("", "world", "map", "/map"):
            answer = self.put("m2wr", (1.0, 2.0, 0.3, 2.5), (0.1, 0.2, 0.3), (0.0, 0.0, 0.7), frame)
            self.assertEqual(answer, (True, DONE))
            answer = self.get("m2wr", frame)
            self.assert_place(answer, (1.0, 2.0, 0.3, 2.5))
            # set for the chassis' centre of mass, read at its frame's origin, 0.025 m further back
            sideways = 0.7 * COM_X
            self.assert_vector(answer.twist.linear,
                               (0.1 + sideways * math.sin(2.5), 0.2 - sideways * math.cos(2.5), 0.3))
            self.assert_vector(answer.twist.angular, (0.0, 0.0, 0.7))
            self.assertEqual(self.put("m2wr", (0.0, 0.0, 0.1, 0.0)), (True, DONE))
            self.assert_vector(self.get("m2wr").twist.linear, (0.0, 0.0, 0.0))

    def test_frame_of_another_model_and_of_links(self):
        self.assertTrue(self.simulation.spawn("other", self.urdf, (5.0, 5.0, 0.1, math.pi / 2.0)).success)
        for frame in ("other", "other::link_chassis"):
            self.assertEqual(self.put("m2wr", (1.0, 2.0, 0.0, 0.5), (1.0, 0.0, 0.0), frame=frame), (True, DONE))
            answer = self.get("m2wr")
            self.assert_place(answer, (3.0, 6.0, 0.1, math.pi / 2.0 + 0.5))
            self.assert_vector(answer.twist.linear, (0.0, 1.0, 0.0))
            answer = self.get("m2wr", frame)
            self.assert_place(answer, (1.0, 2.0, 0.0, 0.5))
            self.assert_vector(answer.twist.linear, (1.0, 0.0, 0.0))
        # a plain link name is an entity as well; the first model in load order wins
        self.assertEqual(self.put("m2wr", (0.0, 0.0, 0.1, 0.0)), (True, DONE))
        self.assert_place(self.get("other", "link_chassis"), (5.0, 5.0, 0.0, math.pi / 2.0))
        self.assert_place(self.get("m2wr", "other::link_right_wheel"), (-4.95, 4.8, 0.0, -math.pi / 2.0))

    def test_zero_quaternion_means_no_rotation(self):
        pose = Pose()
        pose.position.x, pose.position.z = 1.0, 0.1
        self.assertEqual(self.put("m2wr", pose), (True, DONE))
        self.assert_place(self.get("m2wr"), (1.0, 0.0, 0.1, 0.0))
        pose.orientation.z = pose.orientation.w = 3.0       # is normalised
        self.assertEqual(self.put("m2wr", pose), (True, DONE))
        self.assert_place(self.get("m2wr"), (1.0, 0.0, 0.1, math.pi / 2.0))

    def test_a_start_at_height_zero_settles_on_the_wheels(self):
        """Bug 2 of the report puts the robot at z = 0, its wheels a radius deep in the floor."""
        self.assertEqual(self.put("m2wr", (2.0, -1.0, 0.0, 0.8)), (True, DONE))
        self.simulation.call("unpause_physics")
        self.simulation.run_for(3.0)
        answer = self.get("m2wr")
        self.assertAlmostEqual(answer.pose.position.z, 0.1, delta=0.002)
        self.assertAlmostEqual(answer.pose.position.x, 2.0, delta=0.01)
        self.assertAlmostEqual(answer.pose.position.y, -1.0, delta=0.01)
        self.assertAlmostEqual(yaw_of(answer.pose.orientation), 0.8, delta=0.01)
        self.assertLess(math.hypot(answer.pose.orientation.x, answer.pose.orientation.y), 0.005)
        self.assertLess(max(abs(value) for value in xyz(answer.twist.linear)), 0.01)

    # ---- topics ------------------------------------------------------------------------------------------------

    def test_a_topic_sets_a_state_while_paused(self):
        log = Recorder("/rosout", Log).connected()
        topic = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=10)
        wait_until(lambda: topic.get_num_connections() > 0, "the simulation on /gazebo/set_model_state")
        topic.publish(ModelState(model_name="no_such_model", pose=make_pose()))
        log.wait(lambda messages: any("no_such_model" in m.msg and m.level >= Log.WARN for m in messages), "a warning")
        topic.publish(ModelState(model_name="m2wr", pose=make_pose(1.0, 1.0, 0.1, 1.0)))
        wait_until(lambda: abs(self.get("m2wr").pose.position.x - 1.0) < 1e-9, "m2wr at x = 1", 10.0)
        self.assert_place(self.get("m2wr"), (1.0, 1.0, 0.1, 1.0))
        topic.unregister()
        log.close()

    def test_state_topics_list_everything_in_load_order(self):
        models = Recorder("/gazebo/model_states", ModelStates).connected()
        links = Recorder("/gazebo/link_states", LinkStates).connected()
        self.put("m2wr", (1.0, 2.0, 0.1, 1.5))
        answer = self.simulation.spawn("crate", data_text("crate.sdf"), (5.0, 0.0, 0.0, 0.0), kind="sdf")
        self.assertTrue(answer.success, answer.status_message)
        self.simulation.call("unpause_physics")
        message = models.next()[0]
        self.assertEqual(message.name, ["ground_plane", "m2wr", "crate"])
        self.assertEqual((len(message.pose), len(message.twist)), (3, 3))
        self.assertAlmostEqual(message.pose[1].position.y, 2.0, delta=0.01)
        self.assertAlmostEqual(yaw_of(message.pose[1].orientation), 1.5, delta=0.01)
        self.assertEqual(xyz(message.pose[2].position), (5.5, 0.0, 0.0))
        message = links.next()[0]
        self.assertEqual(message.name, ["ground_plane::link"] + ["m2wr::" + name for name in LINKS] + ["crate::link"])
        places = dict(zip(message.name, message.pose))
        # the wheel tagged right stands to the left of the robot: 0.2 m at yaw 1.5, and 0.05 m behind
        offset = (-0.05 * math.cos(1.5) - 0.2 * math.sin(1.5), -0.05 * math.sin(1.5) + 0.2 * math.cos(1.5))
        self.assertAlmostEqual(places["m2wr::link_right_wheel"].position.x, 1.0 + offset[0], delta=0.01)
        self.assertAlmostEqual(places["m2wr::link_right_wheel"].position.y, 2.0 + offset[1], delta=0.01)
        self.assertEqual(xyz(places["crate::link"].position), (5.5, 0.0, 0.25))
        self.simulation.call("delete_model", "m2wr")
        models.wait(lambda messages: messages[-1].name == ["ground_plane", "crate"], "states without m2wr")
        models.close()
        links.close()

    # ---- properties and joints ---------------------------------------------------------------------------------

    def test_world_properties(self):
        answer = self.simulation.call("get_world_properties")
        self.assertEqual((answer.success, answer.status_message), (True, "GetWorldProperties: got properties"))
        self.assertEqual(answer.model_names, ["ground_plane", "m2wr"])
        self.assertTrue(answer.rendering_enabled)

    def test_model_properties(self):
        answer = self.simulation.call("get_model_properties", "m2wr")
        self.assertEqual((answer.success, answer.status_message), (True, "GetModelProperties: got properties"))
        self.assertEqual(answer.body_names, LINKS)
        self.assertEqual(answer.geom_names, COLLISIONS)
        self.assertEqual(answer.joint_names, ["joint_left_wheel", "joint_right_wheel"])
        self.assertEqual((answer.canonical_body_name, answer.parent_model_name, answer.child_model_names), ("", "", []))
        self.assertFalse(answer.is_static)
        answer = self.simulation.call("get_model_properties", "ground_plane")
        self.assertEqual((answer.body_names, answer.geom_names, answer.is_static), (["link"], ["collision"], True))
        answer = self.simulation.call("get_model_properties", "no_such_model")
        self.assertEqual((answer.success, answer.status_message), (False, "GetModelProperties: model does not exist"))

    def configure(self, name, **positions):
        answer = self.simulation.call("set_model_configuration", name, "", list(positions), list(positions.values()))
        return answer.success, answer.status_message

    def test_joint_positions(self):
        self.assertEqual(self.configure("no_such_model"), (False, "SetModelConfiguration: model does not exist"))
        answer = self.simulation.call("set_model_configuration", "m2wr", "", ["joint_left_wheel"], [])
        self.assertEqual((answer.success, answer.status_message), (
            False, "SetModelConfiguration: joint name and position list have different lengths"))
        for position in (math.nan, 1e300):
            self.assertFalse(self.configure("m2wr", joint_left_wheel=position)[0])
        states = Recorder("/joint_states", JointState).connected()
        # unknown joints are ignored; angles are cumulative, not wrapped
        self.assertEqual(self.configure("m2wr", joint_left_wheel=7.5, joint_right_wheel=-0.25, no_such_joint=1.0),
                         (True, "SetModelConfiguration: success"))
        self.assert_place(self.get("m2wr"), (0.0, 0.0, 0.1, 0.0))
        self.simulation.call("unpause_physics")
        message = states.next()[0]
        positions = dict(zip(message.name, message.position))
        self.assertAlmostEqual(positions["joint_left_wheel"], 7.5, delta=0.02)
        self.assertAlmostEqual(positions["joint_right_wheel"], -0.25, delta=0.02)
        states.close()


if __name__ == "__main__":
    rospy.init_node("check_state", disable_rostime=True)
    run_checks("state", State)
