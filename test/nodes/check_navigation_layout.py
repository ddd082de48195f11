#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""move_base, started as other packages start it, drives to a goal; the layers of the old layout are made."""
import math
import os
import signal
import sys

import rospy
from actionlib_msgs.msg import GoalStatus
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import PointCloud2

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from navigation_case import NavigationCase, pose  # noqa: E402
from sim_probe import Recorder, Running, program, run_checks  # noqa: E402

DRIVE = 60.0                # s of simulated time for 3 m
GOAL = 3.0, 7.0             # m


class NavigationLayout(NavigationCase):

    def test_1_a_goal_is_reached_and_the_controller_shows_its_work(self):
        own = "/move_base/DWAPlannerROS/"
        shown = [Recorder(own + name, kind) for name, kind in (
            ("global_plan", Path), ("local_plan", Path), ("cost_cloud", PointCloud2),
            ("trajectory_cloud", PointCloud2))]
        odometry = Recorder("odom", Odometry)
        state, text = self.drive(pose(*GOAL), DRIVE)
        self.assertEqual(state, GoalStatus.SUCCEEDED, text)
        position = odometry.next()[-1].pose.pose.position
        self.assertLess(math.hypot(position.x - GOAL[0], position.y - GOAL[1]), 0.2)
        for recorder in shown:
            recorder.wait(lambda messages: messages, "a message on " + recorder.topic)
        cloud = shown[2].messages[0]
        self.assertEqual([field.name for field in cloud.fields],
                         ["x", "y", "z", "path_cost", "goal_cost", "occ_cost", "total_cost"])

    def test_2_the_parameters_of_layers_are_where_rqt_expects_them(self):
        for name, layers in (("global", ["static_layer", "obstacle_layer", "inflation_layer"]),
                             ("local", ["obstacle_layer", "inflation_layer"])):
            place = "/move_base/%s_costmap/" % name
            self.assertEqual([layer["name"] for layer in rospy.get_param(place + "plugins")], layers)
            self.assertEqual(rospy.get_param(place + "inflation_layer/inflation_radius"), 0.8)
            self.assertEqual(rospy.get_param(place + "obstacle_layer/laser/topic"), "/m2wr/laser/scan")

    def test_3_a_parameter_without_effect_is_named_once(self):
        sentence = "parameter ~shutdown_costmaps has no effect"
        with Running([program("move_base", "move_base"), "__name:=second", "_shutdown_costmaps:=true"]) as node:
            node.wait_for_text(sentence)
            node.end(signal.SIGINT)
            self.assertEqual(node.text.count(sentence), 1, node.text)


if __name__ == "__main__":
    rospy.init_node("navigation_layout")
    run_checks("navigation_layout", NavigationLayout)
