#!/usr/bin/env python3
"""Launch files, robots and worlds in the shape of other people's packages (data/foreign) work as they are."""
import math
import os
import sys
import unittest

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, LaserScan
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from launch_runs import Launched, foreign_environment  # noqa: E402
from sim_probe import Recorder, Simulation, run_checks, wait_until, yaw_of  # noqa: E402


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

    def test_arm_waits_for_the_world_and_takes_its_joint_positions(self):
        with self.run_launch("arm_gazebo", "arm_world.launch", "paused:=true") as run:
            run.wait_for_text("Waiting for model crate")
            self.simulation.call("unpause_physics")         # no states are published before
            self.assertEqual(run.wait_for_models("arm"), ["ground_plane", "crate", "arm"])
            run.wait_for_text("Set model configuration status: SetModelConfiguration: success")
            states = Recorder("/arm/joint_states", JointState).connected()
            self.assertEqual(list(states.next()[0].name), ["shoulder", "elbow"])
            states.close()

    def test_lines_of_the_years_before_noetic(self):
        with self.run_launch("old_robot", "old_robot.launch") as run:
            self.assertEqual(run.wait_for_models("old")[:3], ["ground_plane", "corner", "old"])
            self.simulation.call("unpause_physics")
            run.wait_for_models("post")
            self.assertAlmostEqual(self.simulation.call("get_model_state", "post", "").pose.position.x, 2.0, delta=0.01)
            self.assertIn("there is no display", run.text)
            self.assertNotIn("Traceback", run.text)


if __name__ == "__main__":
    rospy.init_node("check_foreign_launch", disable_rostime=True)
    run_checks("foreign_launch", ForeignLaunch)
