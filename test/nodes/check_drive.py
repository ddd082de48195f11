#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""/cmd_vel in, /odom and tf out: rate, stamps, frames, covariance, speeds, and refused commands."""
import math
import os
import sys
import unittest

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, run_checks, seconds_of, wait_until, xyz, yaw_of  # noqa: E402

PERIOD = 0.05           # s; updateRate 20 of the description
SHARE = 0.001           # allowed deviation of a speed: a tenth of a percent
STRAY = 1e-4            # m/s or rad/s, along axes without a command
AHEAD = 0.05            # m from the axle to the origin of the chassis
REFUSED = "refused a velocity command"
SETTLED = 1.0           # s; the robot follows a new command well before that


def unwrapped(angles):
    """Return angles without jumps of 2 pi."""
    for index in range(1, len(angles)):
        angles[index] = angles[index - 1] + math.remainder(angles[index] - angles[index - 1], 2.0 * math.pi)
    return angles


class Drive(unittest.TestCase):
    """The robot is spawned at time zero while the world is paused, so that the first odometry has a known stamp."""

    @classmethod
    def setUpClass(cls):
        cls.step = rospy.get_param("~step")
        cls.simulation = Simulation()
        cls.log = Recorder("/rosout", Log).connected()
        cls.transforms, cls.odometry = Recorder("/tf", TFMessage), Recorder("/odom", Odometry)
        spawned = cls.simulation.spawn("m2wr", rospy.get_param("/robot_description"))
        assert spawned.success and cls.simulation.time() == 0.0, spawned
        cls.odometry.connected()
        cls.transforms.connected()
        cls.topic = rospy.Publisher("/cmd_vel", Twist, queue_size=1)
        wait_until(lambda: cls.topic.get_num_connections() > 0, "the robot on /cmd_vel")
        cls.simulation.call("unpause_physics")
        cls.first = cls.odometry.wait(lambda messages: len(messages) >= 20 and list(messages), "twenty messages")

    def send(self, linear, angular):
        self.topic.publish(Twist(Vector3(linear, 0.0, 0.0), Vector3(0.0, 0.0, angular)))

    def drive(self, linear, angular, seconds):
        """Send a command and return the odometry of ``seconds``, from the time at which the robot follows it."""
        self.send(linear, angular)
        self.wait_for_speeds(linear, angular, 0.02)
        begin = self.odometry.messages[-1].header.stamp.to_sec() + SETTLED
        self.odometry.wait(lambda messages: messages[-1].header.stamp.to_sec() >= begin + seconds,
                           "%g s of driving" % seconds)
        return [message for message in self.odometry.messages if message.header.stamp.to_sec() >= begin]

    def wait_for_speeds(self, linear, angular, within):
        self.odometry.wait(lambda messages: abs(messages[-1].twist.twist.linear.x - linear) < within
                           and abs(messages[-1].twist.twist.angular.z - angular) < within,
                           "the speeds %g m/s, %g rad/s" % (linear, angular))

    def tearDown(self):
        self.send(0.0, 0.0)
        self.wait_for_speeds(0.0, 0.0, 1e-3)
        self.odometry.clear()
        self.transforms.clear()

    @staticmethod
    def rates(messages):
        """Speed along the path [m/s] and yaw rate [rad/s] from the poses of the first and the last message."""
        elapsed = (messages[-1].header.stamp - messages[0].header.stamp).to_sec()
        yaws = unwrapped([yaw_of(message.pose.pose.orientation) for message in messages])
        turned = yaws[-1] - yaws[0]
        chord = math.dist(xyz(messages[0].pose.pose.position), xyz(messages[-1].pose.pose.position))
        half = 0.5 * turned
        arc = chord * half / math.sin(half) if abs(half) > 1e-6 else chord
        return arc / elapsed, turned / elapsed

    # ---- messages ----------------------------------------------------------------------------------------------

    def test_odometry_starts_one_step_after_the_first_period(self):
        stamps = seconds_of(self.first)
        self.assertAlmostEqual(stamps[0], PERIOD + self.step, delta=1e-9)
        self.assert_on_the_grid(stamps)

    def assert_on_the_grid(self, stamps):
        """Each stamp is a whole number of periods after the previous one; few are lost between the processes."""
        steps = [(b - a) / PERIOD for a, b in zip(stamps, stamps[1:])]
        for periods in steps:
            self.assertAlmostEqual(periods, round(periods), delta=1e-6)
            self.assertGreaterEqual(round(periods), 1)
        lost = sum(round(periods) - 1 for periods in steps)
        self.assertLessEqual(lost, 0.1 * len(stamps), "%d of %d messages are missing" % (lost, len(stamps) + lost))

    def test_frames_and_covariance(self):
        for message in self.first:
            self.assertEqual((message.header.frame_id, message.child_frame_id), ("odom", "link_chassis"))
            expected = [0.0] * 36
            for index, value in zip(range(0, 36, 7), (1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3)):
                expected[index] = value
            self.assertEqual(list(message.pose.covariance), expected)
            self.assertEqual(list(message.twist.covariance), [0.0] * 36)
            twist = message.twist.twist
            self.assertEqual((twist.linear.z, twist.angular.x, twist.angular.y), (0.0, 0.0, 0.0))
        self.assertAlmostEqual(self.first[-1].pose.pose.position.z, 0.1, delta=1e-3)

    def test_transform_equals_odometry_and_never_repeats(self):
        self.transforms.clear()
        odometry = self.drive(0.3, 0.4, 2.0)
        last = odometry[-1].header.stamp
        self.transforms.wait(lambda messages: messages[-1].transforms[0].header.stamp >= last,
                             "transforms up to %s" % last)
        found = [t for m in self.transforms.messages for t in m.transforms if t.child_frame_id == "link_chassis"]
        stamps = [t.header.stamp.to_nsec() for t in found]
        self.assertEqual(stamps, sorted(set(stamps)))
        by_stamp = {t.header.stamp.to_nsec(): t for t in found}
        for message in odometry:
            transform = by_stamp[message.header.stamp.to_nsec()]
            self.assertEqual(transform.header.frame_id, "odom")
            self.assertEqual(xyz(transform.transform.translation), xyz(message.pose.pose.position))
            self.assertEqual(transform.transform.rotation, message.pose.pose.orientation)

    # ---- speeds ------------------------------------------------------------------------------------------------

    def assert_speeds(self, linear, angular, seconds):
        """The chassis' origin, AHEAD of the axle, moves at v along x and at AHEAD w along y; returns the odometry."""
        messages = self.drive(linear, angular, seconds)
        self.assert_on_the_grid(seconds_of(messages))
        speed, rate = self.rates(messages)
        expected = math.hypot(linear, AHEAD * angular)
        self.assertAlmostEqual(speed, expected, delta=SHARE * expected)
        self.assertAlmostEqual(rate, angular, delta=max(SHARE * abs(angular), STRAY))
        twists = [message.twist.twist for message in messages]
        for found, wanted in ((sum(t.linear.x for t in twists), linear), (sum(t.angular.z for t in twists), angular)):
            self.assertAlmostEqual(found / len(twists), wanted, delta=max(SHARE * abs(wanted), STRAY))
        # heading and velocity of a step are half a step apart, which gives v a small y component
        self.assertAlmostEqual(sum(t.linear.y for t in twists) / len(twists), AHEAD * angular,
                               delta=STRAY + abs(linear * angular) * self.step)
        return messages

    def test_straight_ahead_and_back(self):
        messages = self.assert_speeds(0.5, 0.0, 10.0)
        first, last = messages[0].pose.pose, messages[-1].pose.pose
        yaw = yaw_of(first.orientation)
        dx, dy = last.position.x - first.position.x, last.position.y - first.position.y
        aside = dy * math.cos(yaw) - dx * math.sin(yaw)
        self.assertLess(abs(aside), 1e-4, "drift over five metres")
        self.assert_speeds(-0.5, 0.0, 3.0)

    def test_spin_both_ways(self):
        for rate in (0.5, -0.5):
            messages = self.assert_speeds(0.0, rate, 4.0)
            places = [xyz(message.pose.pose.position) for message in messages]
            self.assertLess(max(math.dist(place, places[0]) for place in places), 2.01 * AHEAD)

    def test_circles(self):
        for linear, angular in ((0.5, 0.5), (0.4, -0.8)):
            messages = self.assert_speeds(linear, angular, 5.0)
            speed, rate = self.rates(messages)
            radius = math.hypot(linear / angular, AHEAD)
            self.assertAlmostEqual(speed / abs(rate), radius, delta=2.0 * SHARE * radius)

    def test_parked_robot_stays_where_it_is(self):
        begin = self.drive(0.0, 0.0, PERIOD)[-1]
        end = self.odometry.wait(lambda messages: (messages[-1].header.stamp - begin.header.stamp).to_sec() >= 20.0
                                 and messages[-1], "20 s of parking")
        self.assertLess(math.dist(xyz(begin.pose.pose.position), xyz(end.pose.pose.position)), 1e-6)
        self.assertLess(abs(yaw_of(end.pose.pose.orientation) - yaw_of(begin.pose.pose.orientation)), 1e-6)

    # ---- commands ----------------------------------------------------------------------------------------------

    def test_non_finite_commands_are_refused_and_the_last_one_holds(self):
        self.drive(0.3, 0.2, 0.5)
        self.log.clear()
        for linear, angular in ((math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)):
            self.send(linear, angular)
            first = self.odometry.messages[-1].header.stamp
            self.odometry.wait(lambda messages: (messages[-1].header.stamp - first).to_sec() >= 0.2,
                               "odometry after a command")
        line = self.log.wait(lambda messages: [m for m in messages if REFUSED in m.msg], "a warning")[0]
        self.assertEqual(line.level, Log.WARN)
        for words in ("m2wr", "nan", "finite", "linear.x = 0.3", "angular.z = 0.2"):
            self.assertIn(words, line.msg)
        for message in self.odometry.messages[-5:]:
            self.assertAlmostEqual(message.twist.twist.linear.x, 0.3, delta=0.003)
            self.assertAlmostEqual(message.twist.twist.angular.z, 0.2, delta=0.002)
        said = [m for m in self.log.messages if REFUSED in m.msg]
        self.assertEqual(len(said), 1, "the warning is throttled: four commands within a second of simulated time")

    def test_last_command_holds(self):
        messages = self.drive(0.2, 0.0, 8.0)
        self.assertAlmostEqual(messages[-1].twist.twist.linear.x, 0.2, delta=0.001)

    def test_other_components_of_a_command_are_ignored(self):
        first = self.drive(0.0, 0.0, PERIOD)[-1]
        self.topic.publish(Twist(Vector3(0.0, 0.7, 0.7), Vector3(0.7, 0.7, 0.0)))
        last = self.odometry.wait(lambda messages: (messages[-1].header.stamp - first.header.stamp).to_sec() >= 2.0
                                  and messages[-1], "two seconds of odometry")
        self.assertLess(math.dist(xyz(first.pose.pose.position), xyz(last.pose.pose.position)), 1e-6)


if __name__ == "__main__":
    rospy.init_node("check_drive", disable_rostime=True)
    run_checks("drive", Drive)
