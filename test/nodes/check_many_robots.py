#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Several robots in one world: topics and frames of their own, no conflicts on /tf, mutual detection and contact."""
import math
import os
import sys
import unittest
from collections import Counter

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, LaserScan
from tf2_msgs.msg import TFMessage

from gazebo_msgs.msg import ModelState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, make_pose, run_checks, seconds_of, wait_until  # noqa: E402

NAMES = ("robot1", "robot2", "robot3")
TOPICS = ("cmd_vel", "odom", "joint_states", "m2wr/laser/scan")
ROOM = (30.0, 30.0)     # m, a place outside all obstacles
REAR = 0.25             # m from the chassis frame to the flat back


class ManyRobots(unittest.TestCase):
    """The cases run in the order of their names; the first examines the state after the launch."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        for name in NAMES:
            cls.simulation.wait_for_model(name)
        wait_until(lambda: cls.simulation.time() > 0.3, "time to advance after the last robot was spawned")
        cls.commands = {name: rospy.Publisher("/%s/cmd_vel" % name, Twist, queue_size=1) for name in NAMES}
        for name, publisher in cls.commands.items():
            wait_until(lambda p=publisher: p.get_num_connections() > 0, "a subscriber to %s/cmd_vel" % name)

    def position(self, name):
        """x, y of a robot in the world."""
        point = self.simulation.call("get_model_state", name, "").pose.position
        return point.x, point.y

    def put(self, name, x, y, yaw=0.0):
        """Place a robot, at rest."""
        answer = self.simulation.call("set_model_state", ModelState(
            model_name=name, pose=make_pose(ROOM[0] + x, ROOM[1] + y, 0.1, yaw)))
        self.assertTrue(answer.success, answer.status_message)

    def drive(self, name, linear_x, angular_z=0.0):
        """Send a velocity command."""
        command = Twist()
        command.linear.x, command.angular.z = linear_x, angular_z
        self.commands[name].publish(command)

    def stop(self, name):
        """Stop a robot and wait until it rests: a command may arrive late."""
        def stands():
            twist = self.simulation.call("get_model_state", name, "").twist
            return abs(twist.linear.x) + abs(twist.linear.y) + abs(twist.angular.z) < 1e-3

        self.drive(name, 0.0)
        wait_until(stands, "%s to stop" % name)

    def collisions(self):
        """The simulation's counts of contact events until now, by robot."""
        recorder, since = Recorder("/diagnostics", DiagnosticArray).connected(), self.simulation.time()
        message = recorder.wait(lambda messages: seconds_of(messages)[-1] >= since and messages[-1], "a count from now")
        recorder.close()
        counts = {pair.key: int(pair.value) for status in message.status for pair in status.values
                  if pair.key.startswith("touches of ")}
        return {name: counts.get("touches of " + name, 0) for name in NAMES}

    def test_1_all_are_separate_and_without_contact(self):
        places = [self.position(name) for name in NAMES]
        for k, place in enumerate(places):
            for other in places[k + 1:]:
                self.assertGreater(math.dist(place, other), 1.49)
        self.simulation.run_for(1.0)
        self.assertEqual(self.collisions(), dict.fromkeys(NAMES, 0))
        for name, place in zip(NAMES, places):
            self.assertLess(math.dist(self.position(name), place), 0.01, name)

    def test_2_each_has_its_topics_and_none_is_shared(self):
        published, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
        ours = {name for part in (published, subscribed) for name, nodes in part if "/gazebo" in nodes
                and name.rsplit("/", 1)[-1] in ("cmd_vel", "odom", "joint_states", "scan")}
        self.assertEqual(ours, {"/%s/%s" % (name, topic) for name in NAMES for topic in TOPICS})
        for topic, nodes in published:
            if topic in ours:
                self.assertEqual([node for node in nodes if node != rospy.get_name()],
                                 [] if topic.endswith("cmd_vel") else ["/gazebo"], topic)

    def test_3_messages_name_the_frames_of_their_robot(self):
        for name in NAMES:
            for topic, kind in (("odom", Odometry), ("m2wr/laser/scan", LaserScan), ("joint_states", JointState)):
                recorder = Recorder("/%s/%s" % (name, topic), kind).connected()
                message = recorder.next()[-1]
                recorder.close()
                if topic == "odom":
                    self.assertEqual((message.header.frame_id, message.child_frame_id),
                                     (name + "/odom", name + "/link_chassis"))
                elif topic == "joint_states":
                    self.assertEqual(sorted(message.name), ["joint_left_wheel", "joint_right_wheel"])
                else:
                    self.assertEqual(message.header.frame_id, name + "/sensor_laser")

    def test_4_frames_form_one_tree_with_one_publisher_each(self):
        moving, still = Recorder("/tf", TFMessage).connected(), Recorder("/tf_static", TFMessage)
        expected = {"%s/%s" % (name, link): "%s/%s" % (name, parent) for name in NAMES for link, parent in (
            ("link_chassis", "odom"), ("link_left_wheel", "link_chassis"), ("link_right_wheel", "link_chassis"),
            ("sensor_laser", "link_chassis"))}
        expected.update(("%s/odom" % name, "world") for name in NAMES)

        def parents(messages):
            return {(transform.child_frame_id.lstrip("/"), transform.header.frame_id.lstrip("/"))
                    for message in list(messages) for transform in message.transforms}

        still.wait(lambda messages: len(parents(messages)) == 2 * len(NAMES),
                   "one fixed frame above and one in each robot")
        moving.wait(lambda messages: len(messages) > 200, "200 messages")
        self.assertEqual(parents(still.messages) | parents(moving.messages), set(expected.items()))
        stamps = Counter((transform.child_frame_id, transform.header.stamp.to_nsec())
                         for message in list(moving.messages) for transform in message.transforms)
        self.assertEqual([key for key, count in stamps.items() if count > 1], [], "sent twice")
        moving.close()
        still.close()

    def test_5_a_command_moves_one_robot(self):
        for k, name in enumerate(NAMES):
            self.put(name, 0.0, 3.0 * k)
        self.simulation.run_for(0.3)
        before = {name: self.position(name) for name in NAMES}
        self.drive("robot2", 0.5)
        wait_until(lambda: self.position("robot2")[0] - before["robot2"][0] > 0.7, "robot2 to drive 0.7 m")
        self.stop("robot2")
        after = {name: self.position(name) for name in NAMES}
        self.assertAlmostEqual(after["robot2"][1], before["robot2"][1], delta=0.01)
        for name in ("robot1", "robot3"):
            self.assertLess(math.dist(after[name], before[name]), 1e-3, name)

    def test_6_they_see_one_another(self):
        self.put("robot1", 0.0, 0.0)
        self.put("robot2", 2.0, 0.0)
        self.put("robot3", 0.15, 3.0)
        self.simulation.run_for(0.5)
        recorder = Recorder("/robot1/m2wr/laser/scan", LaserScan).connected()
        since = self.simulation.time()
        scan = recorder.wait(lambda messages: seconds_of(messages)[-1] > since and messages[-1], "a scan from now on")
        recorder.close()
        # both lasers are 0.15 m ahead of their chassis, their housings of radius 0.05 m stand in the plane of the scan
        ahead = min(scan.ranges[355:365])
        self.assertAlmostEqual(ahead, 2.0 - 0.05, delta=0.06)                   # noise: 0.01 m
        # robot 3 is seen from its right: first its right wheel, 0.2 m from its axis; the other parts are within 0.4 m
        beside = min(scan.ranges[-30:])
        self.assertAlmostEqual(beside, 3.0 - 0.22, delta=0.08)
        self.assertEqual(min(scan.ranges[60:300]), math.inf)                    # nothing to the right

    def test_7_they_collide(self):
        self.put("robot1", 0.0, 0.0, math.pi)       # back to back
        self.put("robot2", 1.2, 0.0)
        self.put("robot3", 0.0, 5.0)
        self.simulation.run_for(0.3)
        before = self.collisions()
        self.drive("robot1", -0.4)
        wait_until(lambda: self.position("robot1")[0] - ROOM[0] > 1.2 - 2.0 * REAR - 0.02, "the backs to meet")
        self.simulation.run_for(1.0)
        states = self.simulation.call("get_model_state", "robot2", "robot1").pose.position     # of one instant
        self.stop("robot1")
        after = self.collisions()
        self.assertGreater(math.hypot(states.x, states.y), 2.0 * REAR - 0.01)   # no penetration
        for name in ("robot1", "robot2"):
            self.assertGreater(after[name], before[name], name)
        self.assertEqual(after["robot3"], before["robot3"])


if __name__ == "__main__":
    rospy.init_node("check_many_robots", disable_rostime=True)
    run_checks("many_robots", ManyRobots)
