#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""explore.launch robots:=2 known_init_poses:=false: two robots find where the other one is, and save one map."""
import math
import os
import re
import shutil
import sys
import tempfile
import unittest

import rospy
from nav_msgs.msg import OccupancyGrid

from gazebo_msgs.msg import ModelStates

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from launch_runs import Launched  # noqa: E402
from m2wr_maps.saved_map_reader import read_map  # noqa: E402
from sim_probe import Recorder, data_path, run_checks, yaw_of  # noqa: E402

PATIENCE = 240.0            # s of wall time for a run, also on a busy machine
OFF, TURNED = 0.15, 0.04    # m, rad: three cells; the error of both mappers and of the comparison
SHARE = 99.0                # %
AREA = 30.0                 # m^2: least free area of the map; of 34 m^2 between the walls some is unknown behind edges
PLACED = re.compile(r"the map of robot2 lies at \((-?[\d.]+), (-?[\d.]+)\), (-?[\d.]+) rad on that of robot1")


def planar(pose):
    """Return x, y and yaw of a message."""
    return pose.position.x, pose.position.y, yaw_of(pose.orientation)


class UnknownStarts(unittest.TestCase):
    def test_two_robots_find_each_other_and_save_one_map(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        models = Recorder("/gazebo/model_states", ModelStates)
        maps = Recorder("/map", OccupancyGrid)
        for recorder in (models, maps):
            self.addCleanup(recorder.close)
        with Launched(["m2wr_sim", "explore.launch", "robots:=2", "known_init_poses:=false", "gui:=false",
                       "world:=" + data_path("l_shaped.world"), "initial_x:=-0.5", "initial_y:=0", "initial_yaw:=0.6",
                       "return_to_start:=false", "map:=" + os.path.join(folder, "plan")]) as run:
            run.wait(PATIENCE)
            text = run.text
        first = next(message for message in models.messages if {"robot1", "robot2"} <= set(message.name))
        one, other = (planar(first.pose[first.name.index(name)]) for name in ("robot1", "robot2"))
        found = PLACED.search(text)
        self.assertTrue(found, text)
        x, y, yaw = (float(number) for number in found.groups())
        true_x = math.cos(one[2]) * (other[0] - one[0]) + math.sin(one[2]) * (other[1] - one[1])
        true_y = math.cos(one[2]) * (other[1] - one[1]) - math.sin(one[2]) * (other[0] - one[0])
        self.assertLess(math.hypot(x - true_x, y - true_y), OFF, text)
        self.assertLess(abs(math.remainder(yaw - other[2] + one[2], 2.0 * math.pi)), TURNED, text)
        self.assertNotIn("is taken from that of", text)
        share = re.search(r"(\d+\.\d) % of the \d+ m\^2 that the robots can reach were seen", text)
        self.assertTrue(share and float(share.group(1)) >= SHARE, text)
        self.assertIn("no reachable frontier is left", text)
        self.assertNotIn("it is not certain where", text)
        self.assertFalse(re.findall(r"contact of robot\d::.* and robot\d::", text), text)
        plan = read_map(os.path.join(folder, "plan.yaml"))
        self.assertGreater((plan.data == 0).sum() * plan.resolution ** 2, AREA, text)
        self.assertEqual({message.header.frame_id for message in maps.messages}, {"world"})


if __name__ == "__main__":
    rospy.init_node("explore_unknown_starts_check")
    run_checks("unknown_starts", UnknownStarts)
