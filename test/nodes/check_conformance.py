#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What programs written for Gazebo rely on, at full speed: states, drive, laser, friction, resets.

No case depends on the speed of the simulation: each checks a distance, a stamp, or a state that lasts.
"""
import math
import os
import sys
import unittest

import rospy
from geometry_msgs.msg import Point, Twist, Vector3, Wrench
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan

from gazebo_msgs.msg import LinkStates, ModelState, ModelStates

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, data_text, make_pose, run_checks, wait_until, xyz, yaw_of  # noqa: E402

LASER = """
<sdf version="1.6"><model name="scanner"><static>true</static><link name="link">
  <sensor name="s" type="ray"><update_rate>20</update_rate>
    <ray><scan><horizontal><samples>%d</samples><min_angle>%g</min_angle><max_angle>%g</max_angle></horizontal></scan>
      <range><min>%g</min><max>%g</max></range>%s</ray>
    <plugin name="p" filename="libgazebo_ros_laser.so"><topicName>/look</topicName><frameName>eye</frameName></plugin>
  </sensor></link></model></sdf>"""
NOISE = "<noise><type>gaussian</type><mean>0</mean><stddev>%g</stddev></noise>"
BOX = """
<sdf version="1.6"><model name="box"><static>true</static><link name="link">
  <collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link></model></sdf>"""

GROUND = '<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include></world></sdf>'


class Conformance(unittest.TestCase):
    """Every case begins with only the ground, and the simulation at full speed."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.urdf = rospy.get_param("/robot_description")
        cls.command = rospy.Publisher("/cmd_vel", Twist, queue_size=1, latch=True)

    def setUp(self):
        self.simulation.call("unpause_physics")
        self.simulation.delete_all()

    def listen(self, topic, kind):
        recorder = Recorder(topic, kind)
        self.addCleanup(recorder.close)
        return recorder

    def spawn(self, name, xml, pose=(0.0, 0.0, 0.1, 0.0), kind="urdf", namespace="/"):
        answer = self.simulation.spawn(name, xml, pose, namespace, kind=kind)
        self.assertTrue(answer.success, answer.status_message)

    def drive(self, linear_x, angular_z):
        self.command.publish(Twist(Vector3(linear_x, 0.0, 0.0), Vector3(0.0, 0.0, angular_z)))

    def put(self, name, x, y, z, yaw, frame="world"):
        answer = self.simulation.call("set_model_state", ModelState(name, make_pose(x, y, z, yaw), Twist(), frame))
        self.assertEqual(answer.status_message, "SetModelState: set model state done")

    def pose(self, name, frame=""):
        answer = self.simulation.call("get_model_state", name, frame)
        self.assertTrue(answer.success, answer.status_message)
        return xyz(answer.pose.position) + (yaw_of(answer.pose.orientation),)

    # ---- set_model_state ---------------------------------------------------------------------------------------

    def test_rotation_in_the_own_frame_then_five_metres_then_home(self):
        self.drive(0.0, 0.0)
        self.spawn("m2wr", self.urdf)
        odometry = self.listen("/odom", Odometry)
        odometry.wait(lambda messages: len(messages) > 20, "the robot to settle")
        self.put("m2wr", 0.0, 0.0, 0.0, math.pi / 4, "m2wr::link_chassis")
        self.assertAlmostEqual(self.pose("m2wr")[3], math.pi / 4, delta=0.05)
        odometry.clear()
        self.drive(0.5, 0.0)

        def far(messages):
            for message in messages:
                x, y, _ = xyz(message.pose.pose.position)
                if math.hypot(x, y) >= 5.0:
                    return x, y
            return None

        x, y = odometry.wait(far, "five metres")
        self.assertAlmostEqual(x, 5.0 * math.sqrt(0.5), delta=0.2)
        self.assertAlmostEqual(y, 5.0 * math.sqrt(0.5), delta=0.2)
        self.simulation.call("pause_physics")
        self.put("m2wr", 0.0, 0.0, 0.1, 0.0)
        for found, wanted in zip(self.pose("m2wr"), (0.0, 0.0, 0.1, 0.0)):
            self.assertAlmostEqual(found, wanted, delta=0.01)

    # ---- drive -------------------------------------------------------------------------------------------------

    def test_odometry_is_the_pose_in_the_world_frame(self):
        self.drive(0.0, 0.0)
        odometry = self.listen("/odom", Odometry)
        self.spawn("m2wr", self.urdf, (2.0, 1.0, 0.1, math.pi))
        message = odometry.wait(lambda messages: messages[0], "odometry")
        self.assertEqual((message.header.frame_id, message.child_frame_id), ("odom", "link_chassis"))
        pose = message.pose.pose
        for found, wanted in zip(xyz(pose.position), (2.0, 1.0, 0.1)):
            self.assertAlmostEqual(found, wanted, delta=0.01)
        self.assertAlmostEqual(abs(yaw_of(pose.orientation)), math.pi, delta=0.01)
        diagonal = [message.pose.covariance[7 * index] for index in range(6)]
        self.assertEqual(diagonal, [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3])

    def test_noetic_uses_the_joint_tags_so_the_robot_turns_right(self):
        self.drive(0.0, 0.0)
        self.spawn("m2wr", self.urdf)
        odometry = self.listen("/odom", Odometry)
        self.drive(0.0, 0.5)
        odometry.wait(lambda messages: messages[-1].twist.twist.angular.z < -0.45, "a turn to the right")

    def test_the_last_command_holds(self):
        self.spawn("m2wr", self.urdf)
        odometry = self.listen("/odom", Odometry)
        self.drive(0.3, 0.0)
        first = odometry.wait(lambda messages: [m for m in messages if m.twist.twist.linear.x > 0.28], "motion")[0]
        last = odometry.wait(lambda messages: [
            m for m in messages if (m.header.stamp - first.header.stamp).to_sec() > 20.0], "twenty more seconds")[0]
        self.assertAlmostEqual(last.twist.twist.linear.x, 0.3, delta=0.01)

    def test_ticks_come_every_period_and_stamps_never_repeat(self):
        self.drive(0.2, 0.0)
        odometry = self.listen("/odom", Odometry)
        self.spawn("m2wr", self.urdf)
        messages = odometry.wait(lambda messages: len(messages) >= 100 and list(messages), "a hundred messages")
        steps = {(two.header.stamp - one.header.stamp).to_nsec() for one, two in zip(messages, messages[1:])}
        self.assertEqual(steps, {50000000})

    def test_without_publishTf_there_is_no_odometry_topic(self):
        silent = self.urdf.replace("<leftJoint>", "<publishTf>false</publishTf><leftJoint>")
        self.assertNotEqual(silent, self.urdf)
        self.spawn("m2wr", silent)
        topics = dict(rospy.get_published_topics())
        self.assertIn("/m2wr/laser/scan", topics)
        self.assertNotIn("/odom", topics)

    def test_default_namespaces_of_drive_and_laser(self):
        relative = self.urdf.replace("/m2wr/laser/scan", "scan")
        self.assertNotEqual(relative, self.urdf)
        self.spawn("rover", relative, namespace="")
        topics = dict(rospy.get_published_topics())
        self.assertIn("/rover/odom", topics)
        self.assertIn("/scan", topics)

    def test_a_start_command_uses_the_default_torque(self):
        self.assertIn("<torque>", self.urdf)        # an ignored element: its 0.1 N m would not move the robot
        self.drive(0.5, 0.0)
        self.spawn("m2wr", self.urdf)
        self.listen("/odom", Odometry).wait(lambda messages: messages[-1].twist.twist.linear.x > 0.49, "full speed")

    # ---- laser -------------------------------------------------------------------------------------------------

    def scanner(self, samples=640, half=1.5, nearest=0.08, farthest=10.0, noise=""):
        scans = self.listen("/look", LaserScan)
        self.spawn("scanner", LASER % (samples, -half, half, nearest, farthest, noise), (0.0, 0.0, 0.5, 0.0), "sdf")
        return scans

    def fresh(self, scans):
        """Return a scan that was taken after this call; older ones may still be in transit."""
        now = self.simulation.time()
        return scans.wait(lambda messages: messages[-1].header.stamp.to_sec() > now and messages[-1], "a fresh scan")

    def test_an_empty_world_gives_infinity_everywhere(self):
        scan = self.fresh(self.scanner())
        self.assertEqual(len(scan.ranges), 640)
        self.assertTrue(all(value == math.inf for value in scan.ranges))
        self.assertEqual((scan.scan_time, scan.time_increment, scan.header.frame_id), (0.0, 0.0, "eye"))
        self.assertAlmostEqual(scan.angle_increment, 3.0 / 639, delta=1e-7)

    def test_a_box_is_measured_until_its_model_is_deleted(self):
        scans = self.scanner(samples=641)
        self.spawn("box", BOX, (1.0, 0.0, 0.5, 0.0), "sdf")
        scan = self.fresh(scans)
        self.assertAlmostEqual(scan.ranges[320], 0.5, delta=1e-5)
        self.assertEqual((scan.ranges[0], scan.ranges[-1]), (math.inf, math.inf))
        self.simulation.call("delete_model", "box")
        self.assertTrue(all(value == math.inf for value in self.fresh(scans).ranges))

    def test_objects_below_range_min_are_not_seen(self):
        scans = self.scanner(samples=641, nearest=0.6)      # rays begin inside the box
        self.spawn("box", BOX, (1.0, 0.0, 0.5, 0.0), "sdf")
        self.assertAlmostEqual(self.fresh(scans).ranges[320], 1.5, delta=1e-5)

    def test_a_single_beam_points_forward(self):
        scans = self.scanner(samples=1)
        self.spawn("box", BOX, (1.0, 0.0, 0.5, 0.0), "sdf")
        self.assertAlmostEqual(self.fresh(scans).ranges[0], 0.5, delta=1e-5)

    def test_noise_changes_finite_readings_only(self):
        scans = self.scanner(samples=641, noise=NOISE % 0.02)
        self.spawn("box", BOX, (1.0, 0.0, 0.5, 0.0), "sdf")
        self.fresh(scans)
        taken = scans.next(40)
        seen = [scan.ranges[320] for scan in taken]
        self.assertGreater(len(set(seen)), len(seen) // 2)
        self.assertAlmostEqual(sum(seen) / len(seen), 0.5, delta=5.0 * 0.02 / math.sqrt(len(seen)))
        for scan in taken:
            self.assertEqual(scan.ranges[0], math.inf)
            self.assertTrue(all(0.08 <= value <= 10.0 or value == math.inf for value in scan.ranges))

    def test_scans_keep_their_rate(self):
        stamps = [scan.header.stamp.to_nsec() for scan in self.scanner().next(60)]
        self.assertEqual({two - one for one, two in zip(stamps, stamps[1:])}, {50000000})

    # ---- physics -----------------------------------------------------------------------------------------------

    def test_a_sliding_box_stops_after_the_coulomb_distance(self):
        self.spawn("puck", data_text("puck.sdf"), (0.0, 0.0, 0.1, 0.0), "sdf")
        self.simulation.run_for(0.5)
        self.simulation.call("pause_physics")
        start = self.pose("puck")
        state = ModelState("puck", make_pose(*start), Twist(Vector3(2.0, 0.0, 0.0), Vector3()), "world")
        self.simulation.call("set_model_state", state)
        self.simulation.call("unpause_physics")
        self.simulation.run_for(2.0)
        stopped = self.pose("puck")
        self.assertAlmostEqual(stopped[0] - start[0], 2.0 ** 2 / (2.0 * 0.5 * 9.8), delta=0.01)
        self.simulation.run_for(1.0)
        self.assertAlmostEqual(self.pose("puck")[0], stopped[0], delta=1e-3)

    def test_gravity_is_9_8(self):
        self.assertEqual(self.simulation.call("get_physics_properties").gravity.z, -9.8)
        self.simulation.call("pause_physics")
        self.spawn("puck", data_text("puck.sdf"), (0.0, 0.0, 1e5, 0.0), "sdf")
        begun = self.simulation.time()
        self.simulation.call("unpause_physics")
        self.simulation.run_for(2.0)
        self.simulation.call("pause_physics")
        elapsed = self.simulation.time() - begun
        self.assertAlmostEqual(self.pose("puck")[2] - 1e5, -4.9 * elapsed * (elapsed + 0.001), delta=1e-3)

    def test_a_robot_at_rest_does_not_drift(self):
        self.drive(0.0, 0.0)
        self.spawn("m2wr", self.urdf)
        self.simulation.run_for(2.0)
        before = self.pose("m2wr")
        self.simulation.run_for(20.0)
        for found, wanted in zip(self.pose("m2wr"), before):
            self.assertAlmostEqual(found, wanted, delta=1e-4)
        self.assertAlmostEqual(before[2], 0.1, delta=1e-3)

    # ---- time, states, resets ----------------------------------------------------------------------------------

    def test_the_ground_is_listed_first_and_lights_are_not(self):
        self.spawn("m2wr", self.urdf)
        models, links = self.listen("/gazebo/model_states", ModelStates), self.listen("/gazebo/link_states", LinkStates)
        names = models.wait(lambda messages: "m2wr" in messages[-1].name and messages[-1], "the robot's state").name
        self.assertEqual(names, ["ground_plane", "m2wr"])
        names = links.wait(lambda messages: len(messages[-1].name) > 1 and messages[-1], "links").name
        self.assertEqual(names, ["ground_plane::link", "m2wr::link_chassis", "m2wr::link_left_wheel",
                                 "m2wr::link_right_wheel"])

    def test_time_stops_while_paused_and_services_answer(self):
        self.simulation.call("pause_physics")
        before = self.simulation.time()
        clock = self.listen("/clock", Clock)
        clock.connected()
        self.spawn("m2wr", self.urdf)
        self.put("m2wr", 1.0, 0.0, 0.1, 0.0)
        self.assertAlmostEqual(self.pose("m2wr")[0], 1.0, delta=1e-9)
        self.assertEqual(self.simulation.time(), before)
        clock.clear()
        self.simulation.call("unpause_physics")
        first = clock.wait(lambda messages: messages[0], "the clock").clock.to_sec()
        self.assertLess(first - before, 0.011)

    def test_reset_world_keeps_time_reset_simulation_does_not(self):
        self.drive(0.5, 0.0)
        self.spawn("m2wr", self.urdf, (1.0, 1.0, 0.1, 0.5))
        joints = self.listen("/joint_states", JointState)
        joints.wait(lambda messages: min(messages[-1].position) > 5.0, "the wheels to turn")
        self.drive(0.0, 0.0)
        joints.wait(lambda messages: max(abs(rate) for rate in messages[-1].velocity) < 0.01, "the robot to stop")
        self.simulation.call("pause_physics")
        before = self.simulation.time()
        angle = self.simulation.call("get_joint_properties", "joint_left_wheel").position[0]
        self.assertGreater(angle, 5.0)
        self.simulation.call("reset_world")
        self.assertEqual(self.simulation.time(), before)
        self.assertAlmostEqual(self.pose("m2wr")[0], 1.0, delta=1e-6)
        self.assertAlmostEqual(self.simulation.call("get_joint_properties", "joint_left_wheel").position[0], angle,
                               delta=1e-6)
        self.simulation.call("reset_simulation")
        self.assertEqual(self.simulation.time(), 0.0)
        self.assertEqual(self.simulation.models(), ["ground_plane", "m2wr"])
        self.assertEqual(self.simulation.call("get_joint_properties", "joint_left_wheel").position[0], 0.0)
        self.assertTrue(self.simulation.call("get_physics_properties").pause)
        clock = self.listen("/clock", Clock)
        clock.connected().clear()
        self.simulation.call("unpause_physics")
        self.assertEqual(clock.wait(lambda messages: messages[0], "the clock").clock.to_nsec(), 1000000)

    def test_plain_link_names_are_frames_but_tf_frames_are_not(self):
        self.spawn("m2wr", self.urdf, (1.0, 1.0, 0.1, 0.0))
        self.assertAlmostEqual(self.pose("m2wr", "link_chassis")[0], 0.0, delta=1e-9)
        for frame in ("odom", "default"):
            self.assertEqual(self.simulation.call("get_model_state", "m2wr", frame).success, False)

    def test_links_behind_fixed_joints_are_merged_but_keep_frame_ids(self):
        self.drive(0.0, 0.0)
        self.spawn("m2wr", self.urdf)
        told = self.simulation.call("get_model_properties", "m2wr")
        self.assertEqual(told.body_names, ["link_chassis", "link_left_wheel", "link_right_wheel"])
        self.assertEqual(told.joint_names, ["joint_left_wheel", "joint_right_wheel"])
        self.assertEqual(self.simulation.call("get_link_state", "m2wr::sensor_laser", "").success, False)
        scan = self.listen("/m2wr/laser/scan", LaserScan).next()[0]
        self.assertEqual(scan.header.frame_id, "sensor_laser")

    def test_a_state_without_twist_stops_robot_and_wheels(self):
        self.drive(0.5, 0.0)
        self.spawn("m2wr", self.urdf)
        self.listen("/odom", Odometry).wait(lambda messages: messages[-1].twist.twist.linear.x > 0.4, "full speed")
        self.simulation.call("pause_physics")
        self.put("m2wr", 0.0, 0.0, 0.1, 0.0)
        self.assertEqual(self.simulation.call("get_joint_properties", "joint_left_wheel").rate[0], 0.0)
        self.assertEqual(self.simulation.call("get_model_state", "m2wr", "").twist, Twist())

    def test_a_wrench_without_duration_has_no_effect(self):
        self.simulation.call("pause_physics")
        self.spawn("puck", data_text("puck.sdf"), (0.0, 0.0, 1e5, 0.0), "sdf")
        answer = self.simulation.call("apply_body_wrench", "puck::body", "", Point(),
                                      Wrench(Vector3(1e3, 0.0, 0.0), Vector3()), rospy.Time(), rospy.Duration(0))
        self.assertEqual((answer.success, answer.status_message), (True, ""))
        self.simulation.call("unpause_physics")
        self.simulation.run_for(0.1)
        self.assertAlmostEqual(self.pose("puck")[0], 0.0, delta=1e-9)

    def test_a_stream_of_states_moves_a_falling_body(self):
        self.spawn("box", BOX.replace("<static>true</static>", ""), (1.0, 0.0, 0.5, 0.0), "sdf")
        topic = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=10)
        wait_until(lambda: topic.get_num_connections() > 0, "the simulation to subscribe")
        for count in range(200):
            topic.publish(ModelState("box", make_pose(1.0 + 0.01 * count, 0.0, 5.0), Twist(), "world"))
        wait_until(lambda: abs(self.pose("box")[0] - 2.99) < 1e-6, "the last of many states")
        topic.unregister()
        wait_until(lambda: self.pose("box")[2] < 1.0, "the fall afterwards")

    def test_all_models_can_be_deleted_and_the_ground_added_again(self):
        self.spawn("m2wr", self.urdf)
        for name in self.simulation.models():
            self.assertEqual(self.simulation.call("delete_model", name).status_message,
                             "DeleteModel: successfully deleted model")
        self.assertEqual(self.simulation.models(), [])
        self.simulation.run_for(0.5)
        self.spawn("ground_plane", GROUND, (0.0, 0.0, 0.0, 0.0), "sdf")
        self.spawn("m2wr", self.urdf)
        self.simulation.run_for(1.0)
        self.assertAlmostEqual(self.pose("m2wr")[2], 0.1, delta=1e-3)

    def test_an_existing_name_is_refused_and_not_changed(self):
        self.spawn("box", BOX, (1.0, 0.0, 0.5, 0.0), "sdf")
        answer = self.simulation.spawn("box", BOX, kind="sdf")
        self.assertEqual((answer.success, answer.status_message),
                         (False, "SpawnModel: Failure - entity already exists."))
        wait_until(lambda: self.simulation.models() == ["ground_plane", "box"], "the one box")


if __name__ == "__main__":
    rospy.init_node("check_conformance", disable_rostime=True)
    run_checks("conformance", Conformance)
