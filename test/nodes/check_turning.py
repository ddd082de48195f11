#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The direction in which the robot turns with each wheel convention, and the message about it."""
import math
import os
import sys
import unittest

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, run_checks, wait_until, yaw_of  # noqa: E402

RATE = 0.5          # rad/s
SHARE = 0.001
LEFT, RIGHT = 1, -1


class Turning(unittest.TestCase):
    """Robots in one world that differ only in name, convention and <legacyMode>."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.models()
        cls.log = Recorder("/rosout", Log).connected()
        cls.places = iter(range(100))

    def with_legacy_mode(self, value):
        """The description with a <legacyMode> tag in the drive plugin."""
        xml = rospy.get_param("/robot_description")
        changed = xml.replace("<leftJoint>", "<legacyMode>%s</legacyMode><leftJoint>" % value)
        self.assertNotEqual(changed, xml)
        return changed

    @staticmethod
    def as_described(convention):
        """The description with a <wheelConvention> tag in the drive plugin."""
        return rospy.get_param("/robot_description").replace(
            "<leftJoint>", "<wheelConvention>%s</wheelConvention><leftJoint>" % convention)

    def assert_turns(self, name, direction, xml=None):
        """Spawn a robot, command RATE, and compare its change of yaw in one second with the closed form."""
        xml = xml or rospy.get_param("/robot_description")
        answer = self.simulation.spawn(name, xml, (0.0, 3.0 * next(self.places), 0.1, 0.0), name)
        self.assertTrue(answer.success, answer.status_message)
        odometry = Recorder("/%s/odom" % name, Odometry).connected()
        topic = rospy.Publisher("/%s/cmd_vel" % name, Twist, queue_size=1)
        wait_until(lambda: topic.get_num_connections() > 0, "robot %s on its cmd_vel" % name)
        command = Twist()
        command.angular.z = RATE
        topic.publish(command)
        odometry.wait(lambda messages: abs(messages[-1].twist.twist.angular.z) > 0.9 * RATE, "a turning %s" % name)
        first = odometry.next(10)[-1]       # half a second later the rate is constant
        last = odometry.wait(lambda messages: (messages[-1].header.stamp - first.header.stamp).to_sec() >= 1.0
                             and messages[-1], "odometry one second later")
        seconds = (last.header.stamp - first.header.stamp).to_sec()
        turned = math.remainder(yaw_of(last.pose.pose.orientation) - yaw_of(first.pose.pose.orientation), 2.0 * math.pi)
        self.assertAlmostEqual(turned / seconds, direction * RATE, delta=SHARE * RATE)
        self.assertAlmostEqual(last.twist.twist.angular.z, direction * RATE, delta=0.01 * RATE)
        odometry.close()
        topic.unregister()
        self.simulation.call("delete_model", name)

    def test_m2wr_turns_left_with_its_own_launch_files(self):
        self.assert_turns("m2wr", LEFT)

    def test_a_parameter_set_before_the_spawn_wins(self):
        rospy.set_param("/gazebo/wheel_conventions/chosen", "rep103")
        self.assert_turns("chosen", LEFT)
        rospy.set_param("/gazebo/wheel_conventions/chosen", "noetic")
        self.assert_turns("chosen", RIGHT, self.as_described("kinetic"))
        rospy.set_param("/gazebo/wheel_conventions/chosen", "left")
        answer = self.simulation.spawn("chosen", rospy.get_param("/robot_description"), namespace="chosen")
        self.assertFalse(answer.success)
        for word in ("~wheel_conventions/chosen", "'left'", "noetic, kinetic, rep103"):
            self.assertIn(word, answer.status_message)
        rospy.delete_param("/gazebo/wheel_conventions/chosen")

    def test_a_description_can_choose(self):
        self.assert_turns("other", LEFT, self.as_described("kinetic"))
        self.assert_turns("m2wr", LEFT, self.as_described("noetic"))     # sim.launch has set the parameter

    def test_other_names_have_noetics_mapping_and_turn_right(self):
        self.assert_turns("other", RIGHT)

    def test_noetic_does_not_read_legacy_mode(self):
        self.assert_turns("other", RIGHT, self.with_legacy_mode("true"))
        self.assert_turns("other", RIGHT, self.with_legacy_mode("false"))

    def test_kinetic_obeys_legacy_mode(self):
        self.assert_turns("legacy_false", RIGHT, self.with_legacy_mode("false"))
        self.assert_turns("legacy_true", LEFT, self.with_legacy_mode("true"))

    def test_rep103_uses_the_positions_of_the_wheels(self):
        self.assert_turns("rep103", LEFT)
        self.assert_turns("rep103", LEFT, rospy.get_param("/swapped_description"))

    def test_swapped_joints_make_noetics_mapping_right(self):
        self.assert_turns("other", LEFT, rospy.get_param("/swapped_description"))

    def test_one_line_at_spawn_names_sides_direction_and_setting(self):
        # each line is logged once in a process: other positions of the wheels make it another line
        xml = rospy.get_param("/robot_description").replace("0.20", "0.21")
        self.assertNotEqual(xml, rospy.get_param("/robot_description"))
        for name, level, words in (("m2wr", Log.INFO, ("kinetic", "counter-clockwise")),
                                   ("other", Log.WARN, ("noetic", "turns it clockwise"))):
            self.log.clear()
            self.assertTrue(self.simulation.spawn(name, xml, namespace=name).success)
            self.log.wait(lambda messages: any(m.msg == 'spawned "%s"' % name for m in messages), "the spawn's end")
            lines = [m for m in self.log.messages if "RIGHT side" in m.msg]
            self.assertEqual(len(lines), 1)
            self.assertEqual(lines[0].level, level)
            for word in words + ("joint_left_wheel", "joint_right_wheel", "~wheel_conventions/" + name):
                self.assertIn(word, lines[0].msg)
            self.simulation.call("delete_model", name)

    def test_no_message_where_names_and_sides_agree(self):
        self.log.clear()
        xml = rospy.get_param("/swapped_description")
        self.assertTrue(self.simulation.spawn("other", xml, namespace="other").success)
        self.log.wait(lambda messages: [m for m in messages if m.msg == 'spawned "other"'], "the end of the spawn")
        self.assertEqual([m.msg for m in self.log.messages if "wheel_convention" in m.msg], [])
        self.simulation.call("delete_model", "other")


if __name__ == "__main__":
    rospy.init_node("check_turning", disable_rostime=True)
    run_checks("turning", Turning)
