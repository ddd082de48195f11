#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""One whole run of Bug 2 in the simulator, from its first state to its last, judged by the published messages."""
import json
import math
import os
import sys
import time
import unittest
from collections import namedtuple

import numpy as np
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from std_srvs.srv import Empty

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from graph_wait import START_TIME, wait_for_connection, wait_until  # noqa: E402

GO, WALL, REACHED, UNREACHABLE = "go_to_point", "wall_following", "goal_reached", "goal_unreachable"
SIMULATION = "m2wr_sim: simulation"
#: go_to_point stops 0.3 m from the goal; Bug 2 regards it as reached below 0.31 m [m].
REACHED_DISTANCE = 0.31
#: Half-width of the m-line, plus the distance the robot may travel in the period in which it crosses the line [m].
LINE_DISTANCE = 0.1 + 0.05
#: The leave point must be this much nearer to the goal than the hit point [m].
NEARER = 0.2
#: Largest distance between two odometry messages, 50 ms apart [m]: 0.6 m/s and the jerk of a start.
ODOM_STEP = 0.08
#: Bug 2 puts the robot at height 0, half in the floor; it is pushed out in this time [s].
SETTLING = 1.5
#: Wall seconds allowed for each simulated second at the requested speed: other programs use the machine as well.
PATIENCE = 4.0
#: Simulated seconds per second that are expected at full speed.
FULL_SPEED = 4.0

Change = namedtuple("Change", "state time")


class Run:
    """What one run published."""

    def __init__(self):
        self.options = rospy.get_param("~")
        self.start = rospy.get_param("/initial_x"), rospy.get_param("/initial_y")
        self.goal = rospy.get_param("/des_pos_x"), rospy.get_param("/des_pos_y")
        self.changes, self.reasons, self.points, self.odometry, self.contacts = [], [], {GO: [], WALL: []}, [], {}
        self.judged_until = -1.0        # simulated time [s] of the last contact statistics
        self.reset_at = None
        rospy.Subscriber("/odom", Odometry, self._on_odometry, queue_size=1000)
        rospy.Subscriber("/bug2/state", String, self._on_state)
        rospy.Subscriber("/bug2/status", String, self._on_status)
        rospy.Subscriber("/bug2/hit_point", PointStamped, lambda message: self._on_point(WALL, message))
        rospy.Subscriber("/bug2/leave_point", PointStamped, lambda message: self._on_point(GO, message))
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics)

    def _on_odometry(self, message):
        pose, q, twist = message.pose.pose, message.pose.pose.orientation, message.twist.twist
        self.odometry.append((message.header.stamp.to_sec(), pose.position.x, pose.position.y, pose.position.z,
                              q.x, q.y, q.z, q.w, twist.linear.x, twist.linear.y, twist.angular.z))

    def _on_state(self, message):
        self.changes.append(Change(message.data, self.now()))

    def _on_status(self, message):
        status = json.loads(message.data)
        # the first status after a change carries its reason; order is kept within a topic, not between topics
        if not self.reasons or self.reasons[-1][0] != status["state"]:
            self.reasons.append((status["state"], status["reason"]))

    def _on_point(self, state, message):
        self.points[state].append((message.point.x, message.point.y))

    def _on_diagnostics(self, message):
        for status in message.status:
            if status.name == SIMULATION:
                values = {entry.key: entry.value for entry in status.values}
                self.contacts = {key: value for key, value in values.items() if key.startswith("touches of")}
                self.judged_until = float(values["simulated time [s]"])

    def now(self):
        """Return the simulated time [s] of the newest odometry."""
        return self.odometry[-1][0] if self.odometry else 0.0

    def states(self):
        """Return the names of the states in order."""
        return [change.state for change in self.changes]

    def ended(self):
        """Return whether Bug 2 has ended, or has used up its time or its number of state changes."""
        return bool(self.changes) and (self.changes[-1].state in (REACHED, UNREACHABLE)
                                       or self.now() > self.options["time_limit"])

    def watch(self):
        """Start the paused simulation and wait for the end of the run."""
        for topic in ("/bug2/state", "/bug2/status", "/bug2/hit_point", "/bug2/leave_point"):
            wait_for_connection("/bug2", "i", topic)
        wait_for_connection("/gazebo", "i", "/diagnostics")
        rospy.wait_for_service("/gazebo/unpause_physics", START_TIME)
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
        patience = PATIENCE * self.options["time_limit"] / (self.options["real_time_factor"] or FULL_SPEED) + START_TIME
        if self.options["reset_world"]:
            wait_until(lambda: WALL in self.states(), "the first wall", patience, pause=0.05)
            self.reset_at = self.now()
            rospy.ServiceProxy("/gazebo/reset_world", Empty)()
        wait_until(self.ended, lambda: "the end of the run; states %s, at %.1f s" % (self.changes, self.now()),
                   patience, pause=0.05)
        end = self.now() + 1.0
        wait_until(lambda: self.judged_until > end, lambda: "diagnostics after %.1f s; the newest are from %.1f s" % (
            end, self.judged_until), patience, pause=0.05)

    def table(self):
        """Return the odometry as an array (N, 11): stamp, x, y, z, quaternion, twist."""
        return np.array(self.odometry)

    def goal_distance(self, point):
        """Return the distance [m] of a point from the goal."""
        return math.hypot(point[0] - self.goal[0], point[1] - self.goal[1])

    def line_distance(self, point):
        """Return the distance [m] of a point from the line through start and goal."""
        along = np.subtract(self.goal, self.start)
        offset = np.subtract(point, self.start)
        return abs(along[0] * offset[1] - along[1] * offset[0]) / np.hypot(*along)


class Bug2(unittest.TestCase):
    """The run is made once; each test examines one aspect of it."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("check_bug2")
        cls.run_ = Run()
        began = time.monotonic()
        cls.run_.watch()
        rospy.loginfo("%s after %.1f s simulated, %.1f s of wall time: %s", cls.run_.states()[-1],
                      cls.run_.changes[-1].time, time.monotonic() - began, cls.run_.reasons)
        cls.options = cls.run_.options

    def test_outcome(self):
        self.assertEqual(self.run_.states()[-1], self.options["outcome"], self.run_.changes)

    def test_states_alternate(self):
        states = self.run_.states()
        self.assertEqual(states[0], GO)
        middle = states[:-1] if states[-1] in (REACHED, UNREACHABLE) else states
        self.assertEqual(middle, [(GO, WALL)[index % 2] for index in range(len(middle))])
        if states[-1] in (REACHED, UNREACHABLE):
            self.assertEqual(middle[-1], {REACHED: GO, UNREACHABLE: WALL}[states[-1]])
        walls = middle.count(WALL)
        self.assertGreaterEqual(walls, self.options["least_walls"], states)
        self.assertLessEqual(walls, self.options["most_walls"], states)

    def test_time(self):
        self.assertLess(self.run_.changes[-1].time, self.options["time_limit"])

    def test_there_was_no_contact(self):
        self.assertGreater(self.run_.judged_until, self.run_.changes[-1].time)
        self.assertEqual(self.run_.contacts, {})

    def test_the_robot_rests_at_the_expected_place(self):
        last = self.run_.table()[-1]
        distance = self.run_.goal_distance(last[1:3])
        if self.options["outcome"] == REACHED:
            self.assertLessEqual(distance, REACHED_DISTANCE)
        else:
            self.assertGreater(distance, REACHED_DISTANCE)
        self.assertLess(np.max(np.abs(last[8:11])), 0.02, "the robot still moves a second after the end")

    def test_odometry_is_finite_and_continuous(self):
        table = self.run_.table()
        self.assertTrue(np.all(np.isfinite(table)))
        np.testing.assert_allclose(np.linalg.norm(table[:, 4:8], axis=1), 1.0, atol=1e-6)
        drive = table[table[:, 0] > self.run_.changes[0].time]
        settled = drive[drive[:, 0] > drive[0, 0] + SETTLING]
        np.testing.assert_allclose(settled[:, 3], 0.1, atol=0.03, err_msg="height of the chassis")
        jumps = drive[1:][np.hypot(*np.diff(drive[:, 1:3], axis=0).T) > ODOM_STEP]
        if self.run_.reset_at is None:
            self.assertEqual(len(jumps), 0, jumps)
        else:
            self.assertEqual(len(jumps), 1, jumps)
            np.testing.assert_allclose(jumps[0][1:3], self.run_.start, atol=0.05)

    def test_hit_and_leave_points(self):
        run = self.run_
        hits, leaves, states = run.points[WALL], run.points[GO], run.states()
        self.assertEqual(len(hits), states.count(WALL))
        self.assertEqual([state for state, _ in run.reasons], states)
        whys = [reason for state, reason in run.reasons if state == GO][1:]
        if run.reset_at is not None:            # moved away from the first wall, which it never leaves
            self.assertEqual(whys.pop(0), "the robot was put elsewhere")
            hits = hits[1:]
        expected = len(hits) - (states[-1] == UNREACHABLE)      # the last wall is not left
        self.assertEqual((len(leaves), len(whys)), (expected, expected))
        never_left = (self.options["outcome"] == UNREACHABLE) + (run.reset_at is not None)
        self.assertGreaterEqual(expected, self.options["least_walls"] - never_left)
        for hit in hits:
            self.assertLess(run.goal_distance(hit), run.goal_distance(run.start) - NEARER)
        for hit, leave, reason in zip(hits, leaves, whys):
            if self.options["leave_rule"] == "report":
                self.assertEqual(reason, "on the line")
                self.assertLess(run.line_distance(leave), LINE_DISTANCE)
            else:
                self.assertIn("on the m-line", reason)
                self.assertLess(run.goal_distance(leave), run.goal_distance(hit) - NEARER)
                self.assertLess(run.line_distance(leave), LINE_DISTANCE)


if __name__ == "__main__":
    rostest.rosrun("m2wr_test", rospy.myargv(sys.argv)[1] if len(rospy.myargv(sys.argv)) > 1 else "bug2", Bug2)
