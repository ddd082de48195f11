#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""With ~loss_ends a model that diverges ends the run: step, body and command are named, the bag is complete."""
import math
import os
import shutil
import sys
import tempfile
import unittest

import rosbag
import rospy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Running, Simulation, marked, run_checks, wait_until  # noqa: E402

LAUNCH = """<launch>
  <param name="/gazebo/loss_ends" value="true"/>
  <include file="$(find m2wr_sim)/launch/bug2.launch">
    <arg name="gui" value="false"/>
    <arg name="record" value="%s"/>
  </include>
</launch>
"""
# its rest position is far outside the world: the two links accelerate in opposite directions
SPRING = """<sdf version="1.6"><model name="spring">
  <link name="base"><pose>0 0 1 0 0 0</pose></link>
  <link name="arm"><pose>0 0 1.5 0 0 0</pose></link>
  <joint name="hinge" type="prismatic"><parent>base</parent><child>arm</child>
    <axis><xyz>0 0 1</xyz>
      <dynamics><spring_reference>1e12</spring_reference><spring_stiffness>1e9</spring_stiffness></dynamics></axis></joint>
</model></sdf>"""
SENSED = {"/odom", "/m2wr/laser/scan", "/joint_states", "/tf"}


def numbers_of(message):
    """All floating-point numbers of a message, at any depth; without the infinity of a beam that hits nothing."""
    found, waiting = [], [message]
    while waiting:
        part = waiting.pop()
        if isinstance(part, float):
            found.append(part)
        elif isinstance(part, (list, tuple)):
            waiting.extend(part)
        elif hasattr(part, "__slots__"):
            waiting.extend(getattr(part, name) for name in part.__slots__)
    return [value for value in found if value != math.inf]


class Diverged(unittest.TestCase):
    """bug2.launch on this test's own master, with a bag."""

    def test_the_run_ends_with_a_reason_and_a_complete_bag(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        bag, launch = os.path.join(folder, "run.bag"), os.path.join(folder, "run.launch")
        with open(launch, "w", encoding="utf-8") as stream:
            stream.write(LAUNCH % bag)
        with Running(["roslaunch", launch]) as run:
            run.wait_for_text("state changed: Go to point")
            wait_until(lambda: os.path.isfile(bag + ".active") and os.path.getsize(bag + ".active") > 100000,
                       "the bag to grow")
            simulation = Simulation()
            simulation.run_for(1.0)
            try:                        # the node may be gone before it answers
                simulation.spawn("spring", SPRING, (5.0, 5.0, 0.0, 0.0), kind="sdf")
            except (rospy.ServiceException, rospy.ROSException) as error:
                rospy.loginfo("no answer to the spawn request: %s", error)
            run.wait()
            self.assertRegex(run.text,
                             r"step \d+ \(1 ms each\): the simulation diverged: spring::\w+ is at \(.*Motors: hinge")
            self.assertNotIn("Traceback", run.text)
            self.assertNotIn("core dumped", run.text)
            wait_until(lambda: not marked(run.mark), "everything that the run has started to end")
        self.assertEqual(sorted(os.listdir(folder)), ["run.bag", "run.launch"])
        seen, last = set(), 0.0
        with rosbag.Bag(bag) as written:
            for topic, message, _ in written.read_messages():
                seen.add(topic)
                if topic in SENSED:
                    numbers = numbers_of(message)
                    self.assertTrue(all(abs(value) < 1e13 for value in numbers), "%s: %s" % (topic, message))
                if topic == "/odom":
                    last = message.header.stamp.to_sec()
                    self.assertLess(abs(message.pose.pose.position.x), 100.0)
        self.assertLessEqual(SENSED, seen)
        self.assertGreater(last, 1.0)


if __name__ == "__main__":
    rospy.init_node("check_diverged", disable_rostime=True)
    run_checks("diverged", Diverged)
