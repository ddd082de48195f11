#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A house of three hundred boxes: from the start of the node to the robot's first scan."""
import os
import shutil
import signal
import sys
import tempfile
import time
import unittest

import rospy
from sensor_msgs.msg import LaserScan

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Running, Simulation, make_pose, program, run_checks  # noqa: E402

BOXES, ROOMS = 300, 20
WITHIN = 3.0            # s, to the first scan

BOX = """
      <link name="wall_%d"><pose>%g %g 1.25 0 0 %g</pose>
        <collision name="collision"><geometry><box><size>%g 0.15 2.5</size></box></geometry></collision>
        <visual name="visual"><geometry><box><size>%g 0.15 2.5</size></box></geometry>
          <material><script><uri>file://media/materials/scripts/gazebo.material</uri><name>Gazebo/Grey</name></script>
          </material></visual>
      </link>"""


def house():
    """Return the text of a world: one static model of many links, as editors export it, and a few movable ones."""
    walls = [BOX % (index, 1.5 * (index % ROOMS) - 15.0, 1.2 * (index // ROOMS) + 2.0, 1.5707 * (index % 2), 1.0, 1.0)
             for index in range(BOXES)]
    return """<?xml version="1.0"?>
<sdf version="1.6"><world name="default">
  <include><uri>model://ground_plane</uri></include><include><uri>model://sun</uri></include>
  <physics type="ode"><max_step_size>0.001</max_step_size><real_time_update_rate>1000</real_time_update_rate></physics>
  <scene><ambient>0.4 0.4 0.4 1</ambient></scene>
  <model name="house"><static>1</static>%s</model>
</world></sdf>""" % "".join(walls)


def limit():
    """WITHIN where a processor is free, more in proportion to the load of the machine."""
    return WITHIN * max(1.0, os.getloadavg()[0] / os.cpu_count())


class House(unittest.TestCase):
    """The check starts the node itself and measures the time."""

    def test_the_first_scan_comes_soon(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        path = os.path.join(folder, "house.world")
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(house())
        simulation, scans = Simulation(), Recorder("/m2wr/laser/scan", LaserScan)
        begun = time.monotonic()
        with Running([program("m2wr_sim", "m2wr_sim_node"), "_world:=" + path]) as node:
            rospy.wait_for_service("/gazebo/spawn_urdf_model", timeout=60.0)
            answer = simulation.call("spawn_urdf_model", "m2wr", rospy.get_param("/robot_description"), "/",
                                     make_pose(z=0.1), "")
            self.assertTrue(answer.success, answer.status_message)
            scan = scans.wait(lambda messages: messages[0], "the first scan")
            elapsed = time.monotonic() - begun
            self.assertEqual(len(scan.ranges), 720)
            self.assertLess(min(scan.ranges), 10.0)
            told = simulation.call("get_model_properties", "house")
            self.assertEqual((len(told.body_names), told.is_static), (BOXES, True))
            node.end(signal.SIGINT)
        rospy.loginfo("the first scan came after %.2f s", elapsed)
        self.assertLess(elapsed, limit())


if __name__ == "__main__":
    rospy.init_node("check_house", disable_rostime=True)
    run_checks("house", House)
