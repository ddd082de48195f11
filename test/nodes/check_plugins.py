#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The plugins over ROS: topics, types, frames, first values, a service while paused, a collision with a wall."""
import math
import os
import sys
import unittest

import rospy
import tf2_ros
from geometry_msgs.msg import Twist, Vector3, Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, Range
from std_srvs.srv import Empty

from gazebo_msgs.msg import ContactsState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import PATIENCE, Recorder, Simulation, run_checks, seconds_of, wait_until, xyz  # noqa: E402

PUBLISHED = {"/odom": "nav_msgs/Odometry", "/truth": "nav_msgs/Odometry", "/imu/data": "sensor_msgs/Imu",
             "/imu/body": "sensor_msgs/Imu", "/sonar": "sensor_msgs/Range", "/bumper": "gazebo_msgs/ContactsState",
             "/wheel_load": "geometry_msgs/WrenchStamped", "/joint_states": "sensor_msgs/JointState"}
START = (1.0, 0.5)
FACE = 3.0              # x of the wall's near side
WALL = """<sdf version="1.6"><model name="wall"><static>true</static><link name="link">
<collision name="brick"><geometry>
<box><size>0.2 4 1</size></box></geometry></collision></link></model></sdf>"""
WEIGHT = 9.8 * 12.1     # N, of the rover


class Plugins(unittest.TestCase):
    """The cases run in the order of their names: first the robot at rest, last the collision."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("rover")
        assert cls.simulation.spawn("wall", WALL, (FACE + 0.1, 0.5, 0.5, 0.0), kind="sdf").success
        cls.simulation.run_for(1.0)
        cls.topic = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
        wait_until(lambda: cls.topic.get_num_connections() > 0, "the rover on /cmd_vel")

    def next(self, topic, kind, count=1):
        recorder = Recorder(topic, kind).connected()
        try:
            return recorder.next(count)[:count]        # on a busy machine there may be more
        finally:
            recorder.close()

    def test_1_topics_have_their_types(self):
        known = dict(rospy.get_published_topics())
        self.assertEqual({topic: known.get(topic) for topic in PUBLISHED}, PUBLISHED)

    def test_2_odometry_and_truth_agree(self):
        odometry, truth = self.next("/odom", Odometry)[0], self.next("/truth", Odometry)[0]
        for message in (odometry, truth):
            self.assertAlmostEqual(message.pose.pose.position.x, START[0], delta=0.01)
            self.assertAlmostEqual(message.pose.pose.position.y, START[1], delta=0.01)
        self.assertEqual((odometry.header.frame_id, odometry.child_frame_id), ("odom", "base_footprint"))
        self.assertEqual((truth.header.frame_id, truth.child_frame_id), ("world", "base_footprint"))

    def test_2_inertial_units_at_rest(self):
        sensor, body = self.next("/imu/data", Imu, 20), self.next("/imu/body", Imu, 20)
        for messages, upward in ((sensor, 9.8), (body, 0.0)):
            for have, want in zip(xyz(messages[-1].linear_acceleration), (0.0, 0.0, upward)):
                self.assertAlmostEqual(have, want, delta=0.01)
            stamps = seconds_of(messages)
            self.assertAlmostEqual((stamps[-1] - stamps[0]) / 19.0, 0.02, delta=1e-6)
        self.assertEqual((sensor[0].header.frame_id, body[0].header.frame_id), ("base_link", "base_footprint"))

    def test_2_the_wheel_force_is_its_share_of_the_load(self):
        message, = self.next("/wheel_load", WrenchStamped)
        force = message.wrench.force
        # the ground carries the wheel itself: the joint measures the rest of a quarter, in axes rotating with the wheel
        self.assertAlmostEqual(math.hypot(force.x, force.z), WEIGHT / 4.0 - 0.5 * 9.8, delta=0.5)
        self.assertEqual(message.header.frame_id, "left_front_wheel")

    def test_2_the_sonar_sees_the_wall(self):
        message, = self.next("/sonar", Range)
        self.assertAlmostEqual(message.range, FACE - START[0] - 0.3, delta=0.01)
        self.assertEqual((message.header.frame_id, message.radiation_type), ("scanner", Range.ULTRASOUND))
        self.assertAlmostEqual(message.field_of_view, 0.2, places=6)

    def test_2_there_is_no_contact(self):
        messages = self.next("/bumper", ContactsState, 5)
        self.assertEqual([len(message.states) for message in messages], [0] * 5)
        self.assertEqual(messages[0].header.frame_id, "base_footprint")

    def test_2_frames_are_connected(self):
        tree = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(tree)
        for frame, height in (("base_footprint", 0.0), ("scanner", 0.25), ("right_rear_wheel", 0.1)):
            found = tree.lookup_transform("odom", frame, rospy.Time(0), rospy.Duration(PATIENCE))
            self.assertAlmostEqual(found.transform.translation.z, height, delta=0.01, msg=frame)
        listener.unregister()

    def test_3_the_calibration_service_answers_while_paused(self):
        rospy.wait_for_service("/imu/calibrate", timeout=PATIENCE)
        calibrate = rospy.ServiceProxy("/imu/calibrate", Empty)
        calibrate()
        self.simulation.call("pause_physics")
        try:
            calibrate()
        finally:
            self.simulation.call("unpause_physics")

    def test_4_a_force_shifts_the_load(self):
        topic = rospy.Publisher("/push", Wrench, queue_size=1)
        wait_until(lambda: topic.get_num_connections() > 0, "the rover on /push")
        topic.publish(Wrench(force=Vector3(0.0, 0.0, 0.5 * WEIGHT)))
        recorder = Recorder("/wheel_load", WrenchStamped).connected()
        pressed = WEIGHT / 8.0 - 0.5 * 9.8
        recorder.wait(lambda messages: abs(math.hypot(messages[-1].wrench.force.x, messages[-1].wrench.force.z)
                                           - pressed) < 0.5, "half the load on the wheel")
        topic.publish(Wrench())
        recorder.wait(lambda messages: math.hypot(messages[-1].wrench.force.x, messages[-1].wrench.force.z)
                      > pressed + 10.0, "the whole load on the wheel")
        recorder.close()

    def test_5_a_collision_with_the_wall_is_published(self):
        bumper, speeds = Recorder("/bumper", ContactsState).connected(), Recorder("/truth", Odometry).connected()
        self.topic.publish(Twist(Vector3(0.5, 0.0, 0.0), Vector3()))
        speeds.wait(lambda messages: abs(messages[-1].twist.twist.linear.x - 0.5) < 0.01, "half a metre a second")
        bumper.wait(lambda messages: any(message.states for message in messages), "a contact")
        state = bumper.wait(lambda messages: next((state for state in messages[-1].states
                                                   if state.total_wrench.force.x < -5.0), None), "a force of the wall")
        self.assertEqual((state.collision1_name.split("::")[0], state.collision2_name), ("rover", "wall::link::brick"))
        self.assertEqual(len(state.contact_positions), len(state.wrenches))
        self.assertAlmostEqual(state.contact_positions[0].x, FACE, delta=0.01)
        self.assertAlmostEqual(state.contact_normals[0].x, -1.0, delta=0.01)
        self.topic.publish(Twist(Vector3(-0.3, 0.0, 0.0), Vector3()))
        bumper.wait(lambda messages: not messages[-1].states, "the robot to drive back")
        bumper.close()
        speeds.close()


if __name__ == "__main__":
    rospy.init_node("check_plugins")        # with simulated time, which tf needs
    run_checks("plugins", Plugins)
