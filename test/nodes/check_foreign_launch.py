#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Launch files, robots and worlds as in packages of other authors (data/foreign) work unmodified."""
import math
import os
import sys
import unittest

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, Imu, JointState, LaserScan, PointCloud2
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from launch_runs import Launched, foreign_environment  # noqa: E402
from sim_probe import Recorder, Simulation, data_path, run_checks, wait_until, yaw_of  # noqa: E402


class ForeignLaunch(unittest.TestCase):
    """Each case launches one package on the master of this test and ends it again."""

    def setUp(self):
        self.simulation = Simulation()

    def run_launch(self, *words, **environment):
        return Launched(list(words), foreign_environment(**environment))

    def drive(self, topic, odometry, linear_x, angular_z, condition, what):
        """Send a command, and wait for odometry that meets the condition."""
        command = rospy.Publisher(topic, Twist, queue_size=1)
        wait_until(lambda: command.get_num_connections() > 0, "a robot on %s" % topic)
        twist = Twist()
        twist.linear.x, twist.angular.z = linear_x, angular_z
        command.publish(twist)
        odometry.wait(condition, what)
        command.unregister()

    def test_teaching_robot_in_a_room_from_the_model_path(self):
        with self.run_launch("tb_gazebo", "tb_world.launch", TB_MODEL="scout") as run:
            self.assertEqual(run.wait_for_models("tb_scout"), ["ground_plane", "tb_room", "tb_scout"])
            odometry = Recorder("/odom", Odometry).connected()
            first = odometry.next()[0]
            self.assertEqual((first.header.frame_id, first.child_frame_id), ("odom", "base_footprint"))
            self.assertAlmostEqual(first.pose.pose.position.x, -1.0, delta=0.02)
            self.assertAlmostEqual(first.pose.pose.position.y, -0.5, delta=0.02)
            scan = Recorder("/scan", LaserScan).connected()
            ranges = scan.next(3)[-1].ranges       # walls at 1.95 m: ahead 2.95, left 2.45, behind 0.95, right 1.45
            for index, distance in ((0, 2.95), (90, 2.45), (180, 0.95), (269, 1.45)):
                self.assertAlmostEqual(ranges[index], distance, delta=0.08)
            self.drive("/cmd_vel", odometry, 0.0, 1.0, lambda messages: messages[-1].twist.twist.angular.z > 0.8,
                       "a left turn")
            joints = Recorder("/joint_states", JointState).connected()
            self.assertEqual(set(joints.next()[0].name), {"wheel_left_joint", "wheel_right_joint"})
            frames = Recorder("/tf", TFMessage).connected()
            for parent, child in (("odom", "base_footprint"), ("base_link", "wheel_left_link")):
                frames.wait(lambda messages, pair=(parent, child): any(
                    pair == (entry.header.frame_id, entry.child_frame_id)
                    for message in messages for entry in message.transforms), "%s to %s" % (parent, child))
            for recorder in (odometry, scan, joints, frames):
                recorder.close()

    def test_rover_in_a_namespace_started_paused(self):
        with self.run_launch("rover_gazebo", "rover_empty_world.launch") as run:
            run.wait_for_models("rover")
            self.simulation.wait_for_time(0.5)              # -unpause
            odometry = Recorder("/rover/odom", Odometry).connected()
            self.assertAlmostEqual(yaw_of(odometry.next()[0].pose.pose.orientation), math.pi / 2.0, delta=0.02)
            self.drive("/rover/cmd_vel", odometry, 0.5, 0.0,
                       lambda messages: messages[-1].pose.pose.position.y > 0.3, "a rover that drives along y")
            self.assertAlmostEqual(odometry.messages[-1].pose.pose.position.x, 1.0, delta=0.05)
            odometry.close()

    def test_arm_waits_for_the_world_and_gets_its_joint_positions(self):
        with self.run_launch("arm_gazebo", "arm_world.launch", "paused:=true") as run:
            run.wait_for_text("Waiting for model crate")
            self.simulation.call("unpause_physics")         # no states are published before
            self.assertEqual(run.wait_for_models("arm"), ["ground_plane", "crate", "arm"])
            run.wait_for_text("Set model configuration status: SetModelConfiguration: success")
            states = Recorder("/arm/joint_states", JointState).connected()
            self.assertEqual(list(states.next()[0].name), ["shoulder", "elbow"])
            states.close()

    def listen(self, topic, kind):
        recorder = Recorder(topic, kind).connected()
        self.addCleanup(recorder.close)
        return recorder

    def assert_frames(self, *pairs):
        """Wait until all these (parent, child) have been on /tf."""
        frames = self.listen("/tf", TFMessage)
        frames.wait(lambda messages: set(pairs) <= {(entry.header.frame_id, entry.child_frame_id) for message in
                                                    messages for entry in message.transforms}, "frames %s" % (pairs,))

    def test_warehouse_robot_with_casters_gpu_laser_and_cameras(self):
        with self.run_launch("hauler_gazebo", "hauler_world.launch") as run:
            self.assertEqual(run.wait_for_models("hauler"), ["ground_plane", "shelf_ahead", "parcel", "hauler"])
            picture = self.listen("/hauler/camera1/image_raw", Image).next()[0]
            self.assertEqual(len(picture.data), picture.step * picture.height)
            self.assertGreater(len(set(picture.data)), 10)                              # the shelf, floor and sky
            self.assertGreater(self.listen("/kinect/depth/points", PointCloud2).next()[0].width, 0)
            scans, odometry = self.listen("/hauler/laser/scan", LaserScan), self.listen("/hauler/odom", Odometry)
            scan = scans.next(3)[-1]
            self.assertEqual((len(scan.ranges), scan.header.frame_id), (720, "hokuyo_link"))
            self.assertAlmostEqual(scan.ranges[360], 4.0 - 0.5 - 0.4, delta=0.06)       # shelf front, laser mount
            truth = self.listen("/ground_truth/state", Odometry)
            self.drive("/hauler/cmd_vel", odometry, 0.8, 0.0, lambda messages: messages[-1].pose.pose.position.x > 1.0,
                       "a metre ahead by the encoders")
            at = truth.next()[0].pose.pose.position
            self.assertAlmostEqual(at.y, 0.0, delta=0.05)
            self.assertAlmostEqual(scans.next()[-1].ranges[360], 3.6 - at.x, delta=0.3)         # it still moves
            self.drive("/hauler/cmd_vel", odometry, 0.0, 0.8,
                       lambda messages: yaw_of(messages[-1].pose.pose.orientation) > 1.0, "a left turn")
            self.assertGreater(yaw_of(truth.next()[0].pose.pose.orientation), 0.8)      # the casters align first
            joints = self.listen("/joint_states", JointState).next()[0]
            self.assertEqual([name for name in joints.name if name.endswith("swivel")],
                             ["front_left_swivel", "front_right_swivel"])
            self.assertEqual(len(self.listen("/scan", LaserScan).next()[0].ranges), 720)       # relayed
            self.assert_frames(("map", "odom"), ("odom", "base_footprint"), ("chassis", "left_wheel"),
                               ("front_left_fork", "front_left_roller"))

    def test_sdf_carts_from_the_world_a_file_and_the_database(self):
        with self.run_launch("sdf_cart_gazebo", "carts.launch") as run:
            self.assertEqual(run.wait_for_models("second", "third")[:2], ["ground_plane", "first"])
            run.wait_for_text("some_world_plugin")
            for name, scan in (("first", "/scan"), ("second", "/second/scan"), ("third", "/third/scan")):
                odometry = self.listen("/%s/odom" % name, Odometry)
                start = odometry.next()[0].pose.pose.position.x
                self.drive("/%s/cmd_vel" % name, odometry, 0.5, 0.0, lambda messages, start=start:
                           messages[-1].pose.pose.position.x > start + 0.3, "%s 0.3 m ahead" % name)
                self.assertEqual(len(self.listen(scan, LaserScan).next()[0].ranges), 181)
                self.assertAlmostEqual(self.listen("/%s/imu" % name, Imu).next()[0].linear_acceleration.z, 9.8,
                                       delta=1.0)
            self.assert_frames(("odom", "chassis"), ("chassis", "left_wheel"))

    def test_two_robots_with_namespaces_and_tf_prefixes(self):
        with self.run_launch("fleet_bringup", "fleet.launch") as run:
            run.wait_for_models("Robot1", "Robot2")
            for number, heading in ((1, 0.0), (2, math.pi)):
                name, prefix = "/robot%d" % number, "robot%d_tf/" % number
                odometry = self.listen(name + "/odom", Odometry)
                first = odometry.next()[0]
                self.assertEqual((first.header.frame_id, first.child_frame_id),
                                 (prefix + "odom", prefix + "base_footprint"))
                self.assertEqual(self.listen(name + "/scan", LaserScan).next()[0].header.frame_id,
                                 prefix + "base_scan")
                self.listen(name + "/imu", Imu).next()
                start, ahead = first.pose.pose.position.x, math.cos(heading)
                self.drive(name + "/cmd_vel", odometry, 0.2, 0.0, lambda messages: (
                    messages[-1].pose.pose.position.x - start) * ahead > 0.1, "robot %d ahead" % number)
            self.assert_frames(*((prefix + parent, prefix + child) for prefix in ("robot1_tf/", "robot2_tf/")
                                 for parent, child in (("odom", "base_footprint"), ("base_link", "wheel_left_link"))))

    def test_a_robot_and_a_world_in_one_command(self):
        robot = data_path("foreign", "hauler_description", "urdf", "hauler.urdf.xacro")
        world = data_path("foreign", "hauler_gazebo", "worlds", "aisle.world")
        with self.run_launch("m2wr_sim", "sim.launch", "world:=" + world, "model:=" + robot, "name:=robot", "x:=1",
                             "y:=-1", "yaw:=1.570796", "model_args:=gpu=false", "gui:=false") as run:
            run.wait_for_models("robot")
            self.assertNotIn("gpu_ray", rospy.get_param("robot_description"))
            odometry = self.listen("/hauler/odom", Odometry)
            pose = self.simulation.call("get_model_state", "robot", "").pose
            self.assertAlmostEqual(pose.position.x, 1.0, delta=0.02)
            self.assertAlmostEqual(yaw_of(pose.orientation), math.pi / 2.0, delta=0.02)
            self.drive("/hauler/cmd_vel", odometry, 0.4, 0.0,
                       lambda messages: messages[-1].twist.twist.linear.x > 0.3, "a robot that drives")
            wait_until(lambda: self.simulation.call("get_model_state", "robot", "").pose.position.y > -0.9,
                       "the robot farther along x")
            self.assertEqual(len(self.listen("/hauler/laser/scan", LaserScan).next()[0].ranges), 720)

    def test_launch_lines_older_than_noetic(self):
        with self.run_launch("old_robot", "old_robot.launch") as run:
            self.assertEqual(run.wait_for_models("old")[:3], ["ground_plane", "corner", "old"])
            self.simulation.call("unpause_physics")
            run.wait_for_models("post")
            self.assertAlmostEqual(self.simulation.call("get_model_state", "post", "").pose.position.x, 2.0, delta=0.01)
            self.assertIn("there is no display", run.text)
            self.assertIn("Finished loading Gazebo ROS API Plugin.", run.text)
            self.assertNotIn("Traceback", run.text)


if __name__ == "__main__":
    rospy.init_node("check_foreign_launch", disable_rostime=True)
    run_checks("foreign_launch", ForeignLaunch)
