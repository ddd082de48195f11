#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""reading_laser on recorded scans: its five numbers agree with the boxes' geometry and with the report's slices."""
import os
import sys
import unittest

import numpy as np
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(os.path.dirname(sys.path[0]), "scripts"))
import report_rules  # noqa: E402
from bag_player import SCAN, Fixture, Player  # noqa: E402
from graph_wait import wait_until  # noqa: E402


class ReadingLaser(unittest.TestCase):
    """One list for each scan, right to left."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("check_bag_reading_laser")
        cls.player = Player("/reading_laser", [SCAN], commands=False)

    def play(self, name):
        """Play the scans of a fixture; yields (scan, list that the node logged, row of the YAML)."""
        fixture, player = Fixture(name, [SCAN]), self.player
        rows = fixture.info["expected"]["sectors"]["rows"]
        self.assertEqual(len(fixture.messages), len(rows))
        player.begin(fixture.messages[0][2])
        for (topic, message, stamp_ns), row in zip(fixture.messages, rows):
            self.assertEqual(round(row[0] * 1e9), stamp_ns)
            before = len(player.lists())
            player.set_clock(stamp_ns)
            player.publish(topic, message, stamp_ns)
            wait_until(lambda: len(player.lists()) > before, "a list for the scan at %.3f s" % row[0])
            self.assertEqual(len(player.lists()), before + 1, "more than one list for one scan")
            yield message, player.lists()[-1], row

    def judge(self, name):
        """Compare every list with the geometry. Returns how many numbers were compared and how many are below 10 m."""
        tolerance = Fixture(name, [SCAN]).info["expected"]["sectors"]["tolerance"]
        judged = near = 0
        for _, numbers, row in self.play(name):
            self.assertEqual(len(numbers), 5)
            for sector, number, expected in zip(report_rules.SECTORS, numbers, row[4:]):
                if expected is None:
                    continue
                judged, near = judged + 1, near + (expected < 10.0)
                self.assertLessEqual(abs(number - expected), tolerance, "%s at %.3f s: %.3f m, the boxes' geometry "
                                     "gives %.3f m" % (sector, row[0], number, expected))
        return judged, near

    def test_sectors_of_a_drive_past_boxes_match_the_geometry(self):
        judged, near = self.judge("boxes_drive")
        self.assertGreater(judged, 450)
        self.assertGreater(near, 300)

    def test_sectors_of_a_360_degree_scan_are_selected_by_angle(self):
        judged, near = self.judge("yard_360")
        self.assertGreater(judged, 300)
        self.assertGreater(near, 120)

    def test_sectors_equal_the_slices_of_the_report(self):
        for message, numbers, row in self.play("boxes_drive"):
            ranges = np.array(message.ranges)
            slices = [ranges[first:last + 1] for first, last in report_rules.READING_LASER_BEAMS]
            np.testing.assert_allclose(numbers, [min(min(part), 10.0) for part in slices], rtol=0, atol=1e-6,
                                       err_msg="at %.3f s" % row[0])


if __name__ == "__main__":
    rostest.rosrun("m2wr_test", "bag_reading_laser", ReadingLaser)
