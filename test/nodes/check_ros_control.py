#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A robot whose controllers are loaded, switched and removed by the commands and messages of ros_control."""
import math
import os
import signal
import sys
import unittest

import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from controller_manager_msgs.srv import ListControllers
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectoryPoint

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from launch_runs import Launched, foreign_environment  # noqa: E402
from sim_probe import Recorder, Running, Simulation, program, run_checks, run_program, wait_until, yaw_of  # noqa: E402

NAMESPACE = "/sweeper"
MANAGER = NAMESPACE + "/controller_manager"


def states():
    """Return the states of the loaded controllers by name."""
    rospy.wait_for_service(MANAGER + "/list_controllers", 30.0)
    reply = rospy.ServiceProxy(MANAGER + "/list_controllers", ListControllers)()
    return {controller.name: controller.state for controller in reply.controller}


class RosControl(unittest.TestCase):
    """One launch; the parts follow each other."""

    def test_controllers_from_the_launch_to_the_end(self):
        run = self.enter(Launched(["sweeper_gazebo", "sweeper_world.launch", "namespace:=" + NAMESPACE],
                                  foreign_environment()))
        run.wait_for_models("sweeper")
        wait_until(lambda: states() == {"joints": "running", "drive": "running"}, "joints and drive running")
        self.drive_with_the_controller()
        self.switch_by_the_command()
        self.follow_a_trajectory_and_remove_it()
        self.reject_what_is_wrong()

    def enter(self, context):
        """Enter a context until the end of the case."""
        self.addCleanup(context.__exit__, None, None, None)
        return context.__enter__()

    def listen(self, topic, kind):
        recorder = Recorder(topic, kind).connected()
        self.addCleanup(recorder.close)
        return recorder

    def command(self, *words):
        """Run the command controller_manager in the robot's namespace; returns its exit code and output."""
        done = run_program([program("controller_manager", "controller_manager"), *words],
                           environment={"ROS_NAMESPACE": NAMESPACE})
        return done.returncode, done.stdout

    def drive_with_the_controller(self):
        self.odometry = self.listen(NAMESPACE + "/drive/odom", Odometry)
        self.joints = self.listen(NAMESPACE + "/joint_states", JointState)
        self.assertEqual(self.joints.next()[0].name, ["front_left_wheel", "front_right_wheel", "mast_lift",
                                                      "rear_left_wheel", "rear_right_wheel"])
        publisher = rospy.Publisher(NAMESPACE + "/drive/cmd_vel", Twist, queue_size=1)
        for linear, angular, there in ((0.8, 0.0, lambda pose: pose.position.x > 0.5),
                                       (0.0, 1.0, lambda pose: yaw_of(pose.orientation) > 0.5)):
            twist = Twist()
            twist.linear.x, twist.angular.z = linear, angular

            def arrived(twist=twist, there=there):
                publisher.publish(twist)
                return self.odometry.messages and there(self.odometry.messages[-1].pose.pose)
            wait_until(arrived, "odometry after %s m/s, %s rad/s" % (linear, angular))
        # the command times out, and the robot stops
        wait_until(lambda: abs(self.odometry.next()[0].twist.twist.angular.z) < 1e-3, "a robot that has stopped")
        measured = self.odometry.next()[0]
        truth = Simulation().call("get_model_state", "sweeper", "").pose
        self.assertEqual((measured.header.frame_id, measured.child_frame_id), ("odom", "base_link"))
        self.assertAlmostEqual(measured.pose.pose.position.x, truth.position.x, delta=0.1)
        turned = yaw_of(truth.orientation), yaw_of(measured.pose.pose.orientation)
        self.assertTrue(0.7 < turned[0] / turned[1] < 1.3, "turned %g rad, odometry %g rad" % turned)

    def switch_by_the_command(self):
        code, text = self.command("load", "front_wheels")
        self.assertEqual((code, text.strip()), (0, "Loaded 'front_wheels'"))
        code, text = self.command("start", "front_wheels")              # its wheels belong to drive
        self.assertEqual(code, 1)
        self.assertIn("Error when starting ['front_wheels']", text)
        self.assertEqual(self.command("stop", "drive"), (0, "Stopped ['drive'] successfully\n"))
        self.assertEqual(self.command("start", "front_wheels"), (0, "Started ['front_wheels'] successfully\n"))
        self.assertEqual(states(), {"joints": "running", "drive": "stopped", "front_wheels": "running"})
        publisher = rospy.Publisher(NAMESPACE + "/front_wheels/command", Float64MultiArray, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "the controller of the front wheels")
        publisher.publish(Float64MultiArray(data=[3.0, 3.0]))
        self.joints.wait(lambda messages: math.isclose(messages[-1].velocity[0], 3.0, abs_tol=0.1),
                         "the front left wheel at 3 rad/s")
        self.assertEqual(self.command("kill", "front_wheels")[0], 0)
        self.assertEqual(self.command("start", "drive")[0], 0)
        self.assertIn("'drive' - 'hardware_interface::VelocityJointInterface' ( running )", self.command("list")[1])

    def follow_a_trajectory_and_remove_it(self):
        with Running([program("controller_manager", "spawner"), "mast", "__ns:=" + NAMESPACE]) as spawner:
            wait_until(lambda: states().get("mast") == "running", "a running mast")
            client = actionlib.SimpleActionClient(NAMESPACE + "/mast/follow_joint_trajectory",
                                                  FollowJointTrajectoryAction)
            self.assertTrue(client.wait_for_server(rospy.Duration(30.0)))
            goal = FollowJointTrajectoryGoal()
            goal.trajectory.joint_names = ["mast_lift"]
            goal.trajectory.points = [JointTrajectoryPoint(positions=[height], velocities=[0.0],
                                                           time_from_start=rospy.Duration(time))
                                      for height, time in ((0.3, 1.0), (0.2, 1.5))]
            client.send_goal(goal)
            self.assertTrue(client.wait_for_result(rospy.Duration(30.0)), "the goal has no result")
            self.assertEqual((client.get_state(), client.get_result().error_code), (3, 0))
            self.joints.wait(lambda messages: math.isclose(messages[-1].position[2], 0.2, abs_tol=0.01), "0.2 m")
            code, seconds = spawner.end(signal.SIGINT)
            self.assertEqual(code, 0)
            self.assertLess(seconds, 10.0)
            self.assertNotIn("Traceback", spawner.text)
        self.assertEqual(states(), {"joints": "running", "drive": "running"})

    def reject_what_is_wrong(self):
        """The simulation continues after each of them."""
        code, text = self.command("load", "nothing")
        self.assertEqual(code, 1)
        done = run_program([program("controller_manager", "spawner"), "--timeout", "1", "drive", "__ns:=/elsewhere"])
        self.assertEqual(done.returncode, 1)
        self.assertIn("robots with a controller manager: %s." % NAMESPACE, done.stdout + done.stderr)
        self.joints.next(3)


if __name__ == "__main__":
    rospy.init_node("check_ros_control", disable_rostime=True)
    run_checks("ros_control", RosControl)
