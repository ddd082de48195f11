#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""move_base drives the robot to goals on a map of the world; bad goals end with their reason."""
import math
import os
import sys

import dynamic_reconfigure.client
import numpy as np
import rosnode
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import PolygonStamped, PoseStamped, Twist
from map_msgs.msg import OccupancyGridUpdate
from move_base_msgs.msg import MoveBaseGoal
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from nav_msgs.srv import GetPlan
from std_srvs.srv import Empty

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from navigation_case import NavigationCase, pose  # noqa: E402
from sim_probe import Recorder, run_checks, wait_until  # noqa: E402

DRIVE = 150.0                       # s of simulated time that a goal may take


class Navigation(NavigationCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.odometry = Recorder("odom", Odometry)
        cls.commands = Recorder("cmd_vel", Twist)

    def place(self):
        """Return x, y of the robot."""
        position = self.odometry.next()[-1].pose.pose.position
        return np.array([position.x, position.y])

    def test_1_a_goal_behind_walls_is_reached(self):
        plans = Recorder("/move_base/NavfnROS/plan", Path)
        state, text = self.drive(pose(0.0, -4.0, 0.5), DRIVE)
        self.assertEqual((state, text), (GoalStatus.SUCCEEDED, "Goal reached."))
        self.assertLess(np.hypot(*(self.place() - [0.0, -4.0])), 0.2)
        plans.wait(lambda messages: messages, "a plan")
        self.assertGreater(len(plans.messages[0].poses), 100)

    def test_2_costmaps_are_published(self):
        whole = Recorder("/move_base/global_costmap/costmap", OccupancyGrid)
        whole.wait(lambda messages: messages, "a global costmap")
        self.assertEqual((whole.messages[0].info.width, whole.messages[0].info.resolution), (420, np.float32(0.05)))
        self.assertTrue({0, 99, 100} <= set(whole.messages[0].data))
        local = Recorder("/move_base/local_costmap/costmap", OccupancyGrid)
        local.wait(lambda messages: messages, "a local costmap")
        self.assertEqual((local.messages[0].header.frame_id, local.messages[0].info.width), ("odom", 120))
        updates = Recorder("/move_base/local_costmap/costmap_updates", OccupancyGridUpdate)
        updates.wait(lambda messages: messages, "a change of the local costmap")
        outline = Recorder("/move_base/local_costmap/footprint", PolygonStamped)
        outline.wait(lambda messages: messages, "a footprint")
        self.assertEqual(len(outline.messages[0].polygon.points), 4)

    def test_3_a_plan_can_be_asked_for_at_any_time(self):
        ask = rospy.ServiceProxy("/move_base/make_plan", GetPlan)
        answer = ask(pose(0.0, 8.0), pose(0.0, -4.0), 0.0)
        self.assertGreater(len(answer.plan.poses), 100)
        shown = Recorder("/move_base/NavfnROS/plan", Path)
        wait_until(shown.connected, "a connection to the plan")
        self.assertEqual(ask(pose(0.0, 8.0), pose(30.0, 0.0), 0.0).plan.poses, [])
        shown.wait(lambda messages: messages and not messages[-1].poses, "an empty plan, so that no old one stays")
        self.client.send_goal(MoveBaseGoal(target_pose=pose(3.0, -4.0)))
        self.assertGreater(len(ask(PoseStamped(), pose(0.0, 8.0), 0.5).plan.poses), 100)
        self.client.cancel_goal()
        self.client.wait_for_result(rospy.Duration(10.0))

    def test_4_a_cancelled_goal_stops_the_robot(self):
        self.client.send_goal(MoveBaseGoal(target_pose=pose(5.0, -5.0)))
        self.commands.clear()
        self.commands.wait(lambda messages: any(each.linear.x > 0.1 or abs(each.angular.z) > 0.1 for each in messages),
                           "a command")
        self.client.cancel_goal()
        self.assertTrue(self.client.wait_for_result(rospy.Duration(10.0)))
        self.assertEqual(self.client.get_state(), GoalStatus.PREEMPTED)
        self.commands.wait(lambda messages: (messages[-1].linear.x, messages[-1].angular.z) == (0.0, 0.0), "a stop")

    def test_5_goals_that_cannot_be_used_are_aborted_with_the_reason(self):
        rospy.ServiceProxy("/move_base/clear_costmaps", Empty)()
        bad = pose(0.0, 0.0)
        bad.pose.orientation.w = 0.0
        state, text = self.drive(bad, 20.0)
        self.assertEqual((state, text), (GoalStatus.ABORTED,
                                         "Aborting on goal because it was sent with an invalid quaternion"))
        state, text = self.drive(pose(0.0, 0.0, frame="nowhere"), 20.0)
        self.assertEqual(state, GoalStatus.ABORTED)
        self.assertIn("the goal is in frame nowhere", text)
        state, text = self.drive(pose(math.nan, 0.0), 20.0)
        self.assertEqual(state, GoalStatus.ABORTED)
        self.assertIn("expected finite numbers", text)

    def test_6_parameters_can_be_changed(self):
        base = dynamic_reconfigure.client.Client("/move_base", timeout=10.0)
        self.addCleanup(base.close)
        changed = base.update_configuration({"planner_frequency": 2.0, "base_global_planner": "ThetaStar"})
        self.assertEqual((changed["planner_frequency"], changed["base_global_planner"]), (2.0, "ThetaStar"))
        inflation = dynamic_reconfigure.client.Client("/move_base/global_costmap/inflation_layer", timeout=10.0)
        self.addCleanup(inflation.close)
        inflation.update_configuration({"inflation_radius": 0.5})
        self.assertEqual(rospy.get_param("/move_base/global_costmap/inflation_layer/inflation_radius"), 0.5)
        self.assertEqual(rospy.get_param("/move_base/NavfnROS/allow_unknown"), True)

    def test_7_a_goal_from_rviz_is_followed(self):
        publisher = rospy.Publisher("move_base_simple/goal", PoseStamped, queue_size=1)
        current = Recorder("/move_base/current_goal", PoseStamped)
        wait_until(lambda: publisher.get_num_connections() and current.connected(), "connections")
        begun = self.place()
        target = begun + [1.0, 0.0]
        publisher.publish(pose(*target))
        current.wait(lambda messages: messages, "the current goal")
        wait_until(lambda: np.hypot(*(self.place() - target)) < 0.2, "the robot at the goal", 60.0)

    def test_8_a_node_that_is_ended_stops_the_robot(self):
        self.client.send_goal(MoveBaseGoal(target_pose=pose(5.0, -5.0)))
        self.commands.clear()
        self.commands.wait(lambda messages: messages[-1].linear.x > 0.1, "a drive")
        rosnode.kill_nodes(["/move_base"])
        self.commands.wait(lambda messages: (messages[-1].linear.x, messages[-1].angular.z) == (0.0, 0.0), "a stop")
        wait_until(lambda: "/move_base" not in rosnode.get_node_names(), "the end of move_base", 30.0)
        last = self.commands.messages[-1]
        self.assertEqual((last.linear.x, last.angular.z), (0.0, 0.0))


if __name__ == "__main__":
    rospy.init_node("navigation")
    run_checks("navigation", Navigation)
