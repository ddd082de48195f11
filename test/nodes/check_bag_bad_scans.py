#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Invalid scans: every node that reads scans names the fault, ignores the scan, and continues."""
import json
import math
import os
import sys
import unittest

import numpy as np
import rospy
import rostest
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

from gazebo_msgs.srv import SetModelState, SetModelStateResponse

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from bag_player import ODOM, SCAN, TURN_NS, Player  # noqa: E402
from graph_wait import ANSWER_TIME, wait_until  # noqa: E402

READERS = ("/reading_laser", "/wall_follower", "/bug2")
BEAMS, LIMIT = 720, 1.570796
#: Beams of the front-right sector, near enough for wall_follower's state 2, and not in the way of Bug 2.
FRIGHT = slice(200, 240)
#: Warnings are throttled to one in 5 s [ns].
APART_NS = 10 * 10**9
NAN = float("nan")
ATTEMPTS = 3


def scan(ranges):
    """Return a scan with the angles of the robot's laser and any number of readings."""
    message = LaserScan(angle_min=-LIMIT, angle_max=LIMIT, angle_increment=2 * LIMIT / (BEAMS - 1),
                        range_min=0.1, range_max=10.0, ranges=list(ranges))
    message.header.frame_id = "sensor_laser"
    return message


def good_ranges(near):
    """Return readings with nothing near, or with a wall in the front-right sector only."""
    ranges = np.full(BEAMS, 5.0)
    if near:
        ranges[FRIGHT] = 1.3
    return ranges


class BadScans(unittest.TestCase):
    """This test is the simulator for Bug 2 with its behaviours, and for reading_laser."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("check_bag_bad_scans")
        cls.statuses = []
        rospy.Service("/gazebo/set_model_state", SetModelState, lambda request: SetModelStateResponse(success=True))
        rospy.Subscriber("/bug2/status", String, cls.statuses.append)
        # commands come from go_to_point, which Bug 2 keeps switched on: there is no obstacle
        cls.player = player = Player("/go_to_point", [ODOM], others=READERS)
        for node in READERS:
            player.also_to(SCAN, node)
        player.also_to(ODOM, "/bug2")
        player.also_to(ODOM, "/wall_follower")
        cls.stamp_ns, cls.near = 0, False
        player.begin(0)
        wait_until(cls.started, "Bug 2 to start")
        # the lists come in order: after this one there is none left from the start
        cls.give(np.full(BEAMS, 4.0))
        wait_until(lambda: [4.0] * 5 in player.lists("/reading_laser"), "the list of the last scan of the start")

    @classmethod
    def started(cls):
        """Give Bug 2 the time and messages of one more period; return whether it has started."""
        cls.give(good_ranges(False))
        return bool(cls.statuses)

    @classmethod
    def give(cls, ranges, later_ns=TURN_NS):
        """Advance time; publish an odometry message and a scan."""
        cls.stamp_ns += later_ns
        odometry = Odometry()
        odometry.header.frame_id, odometry.pose.pose.orientation.w = "odom", 1.0
        cls.player.set_clock(cls.stamp_ns)
        cls.player.publish(ODOM, odometry, cls.stamp_ns)
        cls.player.publish(SCAN, scan(ranges), cls.stamp_ns)

    def all_nodes_continue(self):
        """A valid scan that differs from the last valid one must have its effect in every node."""
        cls, player = type(self), self.player
        cls.near = not cls.near
        line = "Wall follower - [%d] - %s" % ((2, "follow the wall") if cls.near else (0, "find the wall"))
        start, lists, statuses = len(player.log), len(player.lists("/reading_laser")), len(cls.statuses)
        self.give(good_ranges(cls.near))
        wait_until(lambda: len(player.lists("/reading_laser")) > lists, "a list of reading_laser")
        wait_until(lambda: line in player.lines(start=start, node="/wall_follower"),
                   "wall_follower to log \"%s\"" % line)
        self.assertEqual(len(player.lists("/reading_laser")), lists + 1, "reading_laser logged a list for a bad scan")
        for _ in range(20):
            cls.stamp_ns += TURN_NS
            player.turn(cls.stamp_ns)
        wait_until(lambda: len(cls.statuses) > statuses, "bug2 to publish its status")
        self.assertEqual(json.loads(cls.statuses[-1].data)["state"], "go_to_point")
        return player.lists("/reading_laser")[-1]

    def refused(self, ranges, sentence):
        """Give a scan after a good one; every reader must warn, with ``sentence``, and then continue."""
        start, wanted = len(self.player.log), {node: "%s: %s refused: laser scan: %s" % (node, SCAN, sentence)
                                               for node in READERS}

        def missing():
            return {text for node, text in wanted.items() if text not in self.player.lines(Log.WARN, start, node)}

        for attempt in range(ATTEMPTS):
            self.let_time_pass()
            lists = len(self.player.lists("/reading_laser"))
            self.give(ranges, 0)
            try:
                wait_until(lambda: not missing(), lambda: "the warnings %s" % missing(),
                           ANSWER_TIME if attempt == ATTEMPTS - 1 else 2.0)
                break
            except AssertionError:
                # rospy drops a line for /rosout when another thread of the node is just logging
                if attempt == ATTEMPTS - 1:
                    raise
        self.assertEqual(len(self.player.lists("/reading_laser")), lists)
        self.all_nodes_continue()

    def let_time_pass(self):
        """Advance time until a warning is not throttled any more and every node rests."""
        self.all_nodes_continue()
        type(self).stamp_ns += APART_NS
        self.player.set_clock(self.stamp_ns)
        self.all_nodes_continue()

    def test_a_scan_without_readings(self):
        self.refused([], "0 readings, expected at least 2")

    def test_a_scan_of_one_reading(self):
        self.refused([2.0], "1 reading, expected at least 2")

    def test_a_scan_of_nan_only(self):
        self.refused([NAN] * BEAMS, "all 720 readings are NaN, expected ranges in metres")

    def test_a_sector_of_nan_only(self):
        ranges = good_ranges(False)
        ranges[288:431] = NAN
        self.refused(ranges, "all 143 readings of sector front are NaN")

    def test_too_few_readings(self):
        self.refused([2.0] * 360, "360 readings, expected 720 for -1.5708 to 1.5708 rad in steps of 0.00437 rad")

    def test_too_many_readings(self):
        self.refused([2.0] * 1000, "1000 readings, expected 720 for -1.5708 to 1.5708 rad in steps of 0.00437 rad")

    def test_single_nan_and_infinite_readings_are_accepted(self):
        type(self).near = not self.near
        ranges = good_ranges(self.near)
        ranges[::7], ranges[3::7] = NAN, math.inf
        lists = len(self.player.lists("/reading_laser"))
        self.give(ranges)
        wait_until(lambda: len(self.player.lists("/reading_laser")) > lists, "a list of reading_laser")
        expected = [5.0, 1.3 if self.near else 5.0, 5.0, 5.0, 5.0]
        np.testing.assert_allclose(self.player.lists("/reading_laser")[-1], expected, atol=1e-6)


if __name__ == "__main__":
    rostest.rosrun("m2wr_test", "bag_bad_scans", BadScans)
