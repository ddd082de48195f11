#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""ekf_localization_node, twist_mux and TurtleBot2's nodelets as the launch files of robots start them."""
import math
import os
import sys
import unittest

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool, String
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, run_checks, wait_until, yaw_of  # noqa: E402

STEP, SPEED, RATE, SLIP = 0.02, 0.5, 0.3, 1.2       # s, m/s, rad/s; the wheels report SLIP times the turn


class CheckFusionAndMux(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.now = 10.0
        cls.clock = rospy.Publisher("/clock", Clock, queue_size=1000)
        cls.wheels = rospy.Publisher("/wheels/odom", Odometry, queue_size=1000)
        cls.imu = rospy.Publisher("/imu/data", Imu, queue_size=1000)
        cls.set_pose = rospy.Publisher("/set_pose", PoseWithCovarianceStamped, queue_size=1)
        for publisher in (cls.clock, cls.wheels, cls.imu, cls.set_pose):
            wait_until(publisher.get_num_connections, "a subscriber of %s" % publisher.resolved_name)

    def drive(self, steps, odometry):
        """Publish time and both sensors; the yaw rate of the wheels is off."""
        for _ in range(steps):
            type(self).now += STEP
            stamp = rospy.Time.from_sec(self.now)
            wheels, imu = Odometry(child_frame_id="base_link"), Imu()
            wheels.header.stamp = imu.header.stamp = stamp
            wheels.header.frame_id, imu.header.frame_id = "odom", "base_link"
            wheels.pose.pose.orientation.w = 1.0
            wheels.twist.twist.linear.x, wheels.twist.twist.angular.z = SPEED, SLIP * RATE
            wheels.twist.covariance = [1e-3 * (place % 7 == 0) for place in range(36)]
            imu.angular_velocity.z, imu.orientation_covariance[0] = RATE, -1.0
            imu.angular_velocity_covariance = [1e-6 * (place % 4 == 0) for place in range(9)]
            imu.linear_acceleration_covariance[0] = -1.0
            self.wheels.publish(wheels)
            self.imu.publish(imu)
            count = len(odometry.messages)
            self.clock.publish(Clock(stamp))
            wait_until(lambda: len(odometry.messages) > count, "odometry at %.2f s" % self.now)   # noqa: B023

    def test_the_gyro_corrects_wheels_that_slip(self):
        odometry = Recorder("/odometry/filtered", Odometry).connected()
        transforms = Recorder("/tf", TFMessage).connected()
        self.addCleanup(odometry.close)
        self.addCleanup(transforms.close)
        self.drive(100, odometry)
        first, last = odometry.messages[0], odometry.messages[-1]
        elapsed = (last.header.stamp - first.header.stamp).to_sec()
        turned = yaw_of(last.pose.pose.orientation) - yaw_of(first.pose.pose.orientation)
        self.assertAlmostEqual(turned, RATE * elapsed, delta=0.02 * RATE * elapsed)
        chord = 2.0 * SPEED / RATE * math.sin(0.5 * RATE * elapsed)
        shift = [getattr(last.pose.pose.position, axis) - getattr(first.pose.pose.position, axis) for axis in "xy"]
        self.assertAlmostEqual(math.hypot(*shift), chord, delta=0.02 * chord)
        self.assertEqual((last.header.frame_id, last.child_frame_id), ("odom", "base_link"))
        wait_until(lambda: transforms.messages and
                   transforms.messages[-1].transforms[0].header.stamp >= last.header.stamp, "the transform")
        found = transforms.messages[-1].transforms[0]
        self.assertEqual((found.header.frame_id, found.child_frame_id), ("odom", "base_link"))

        pose = PoseWithCovarianceStamped()
        pose.header.frame_id, pose.pose.pose.orientation.w, pose.pose.pose.position.x = "odom", 1.0, 7.0
        self.set_pose.publish(pose)
        wait_until(lambda: self.drive(1, odometry) or odometry.messages[-1].pose.pose.position.x > 6.9, "the new pose")

    def test_the_strongest_command_passes_unless_it_is_locked(self):
        out = Recorder("/robot/cmd_vel", Twist).connected()
        self.addCleanup(out.close)
        weak, strong = (rospy.Publisher(name, Twist, queue_size=10) for name in ("/cmd_vel", "/joy/cmd_vel"))
        lock = rospy.Publisher("/e_stop", Bool, queue_size=1)
        for publisher in (weak, strong, lock):
            wait_until(publisher.get_num_connections, "twist_mux")

        def send(publisher, speed):
            twist = Twist()
            twist.linear.x = speed
            publisher.publish(twist)

        def passed():
            return [message.linear.x for message in out.messages]

        send(weak, 2.0)
        wait_until(lambda: 2.0 in passed(), "the weak command")
        send(strong, 1.0)
        wait_until(lambda: 1.0 in passed(), "the strong command")
        count = len(passed())
        send(weak, 2.0)
        send(weak, 2.0)
        send(strong, 3.0)
        wait_until(lambda: 3.0 in passed(), "the next strong command")
        status = Recorder("/diagnostics", DiagnosticArray)
        self.addCleanup(status.close)
        for closed, level in ((True, 1), (False, 0)):
            lock.publish(closed)
            status.wait(lambda messages: messages[-1].status[0].level == level, "the lock")     # noqa: B023
        send(strong, 5.0)
        wait_until(lambda: 5.0 in passed(), "a command after the lock")
        lock.publish(True)
        status.wait(lambda messages: messages[-1].status[0].level == 1, "the lock")
        send(strong, 4.0)
        status.next(2)
        self.assertNotIn(4.0, passed())
        self.assertNotIn(2.0, passed()[count:])

    def test_nodelets_smooth_and_choose_commands(self):
        out = Recorder("/mobile_base/commands/velocity", Twist).connected()
        active = Recorder("/cmd_vel_mux/active", String).connected()
        self.addCleanup(out.close)
        self.addCleanup(active.close)
        navi, teleop = (rospy.Publisher(name, Twist, queue_size=10)
                        for name in ("/navigation_velocity_smoother/raw_cmd_vel", "/cmd_vel_mux/input/teleop"))
        for publisher in (navi, teleop):
            wait_until(publisher.get_num_connections, "a subscriber of %s" % publisher.resolved_name)

        def send(publisher, speed):
            """Publish a command, and let a cycle of the smoother pass."""
            twist = Twist()
            twist.linear.x = speed
            publisher.publish(twist)
            type(self).now += STEP
            self.clock.publish(Clock(rospy.Time.from_sec(self.now)))

        def speeds():
            return [message.linear.x for message in out.messages]

        wait_until(lambda: send(navi, 0.4) or 0.4 in speeds(), "the whole speed")
        count = len(speeds())                   # from here on all nodes are connected
        wait_until(lambda: send(navi, 0.1) or 0.1 in speeds()[count:], "the lower speed")
        falling = speeds()[count - 1:]
        self.assertTrue(all(0.0 <= before - later < 0.5 * 0.2 + 1e-9 for before, later in zip(falling, falling[1:])),
                        falling)                # 0.5 m/s^2 at 10 Hz, or twice as much after a message that was dropped
        wait_until(lambda: send(teleop, -0.2) or -0.2 in speeds(), "the command of higher priority")
        count = len(speeds())
        for _ in range(20):
            send(navi, 0.4)
            send(teleop, -0.2)
        wait_until(lambda: len(speeds()) > count + 10, "more commands")
        self.assertEqual(set(speeds()[count:]), {-0.2})
        active.wait(lambda messages: messages[-1].data == "by hand", "the source of higher priority")
        wait_until(lambda: send(navi, 0.4) or active.messages[-1].data == "navigation", "the first source")


if __name__ == "__main__":
    rospy.init_node("check_fusion_and_mux")
    run_checks("check_fusion_and_mux", CheckFusionAndMux)
