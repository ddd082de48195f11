#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""wall_follower on recorded scans: its table without the guard, compared with the geometry of the boxes."""
import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from bag_player import SCAN, TURN_NS, Fixture, Player  # noqa: E402
from graph_wait import wait_until  # noqa: E402

SWITCH = "/wall_follower_switch"


class WallFollower(unittest.TestCase):
    """State by state through the recorded drives."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("check_bag_wall_follower")
        cls.player = Player("/wall_follower", [SCAN])

    def follow(self, name):
        """Play the scans of a fixture; every command must be one that the geometry allows. Returns the states seen."""
        fixture, player = Fixture(name, [SCAN]), self.player
        table = fixture.info["expected"]["wall_follower"]
        state_of = {tuple(command): state for state, command in table["commands"].items()}
        stamps = [stamp_ns for _, _, stamp_ns in fixture.messages]
        player.begin(stamps[0])
        player.switch(SWITCH, True)
        player.lead_in([], stamps[0])
        seen, before = [], None
        for (topic, message, stamp_ns), following_ns, row in zip(
                fixture.messages, stamps[1:] + [stamps[-1] + 4 * TURN_NS], table["rows"]):
            self.assertEqual(round(row[0] * 1e9), stamp_ns)
            player.publish(topic, message, stamp_ns)
            for turn_ns in range(stamp_ns, following_ns, TURN_NS):
                state = state_of.get(player.turn(turn_ns))
                allowed = set(row[1]) | (before or set(range(3)))
                self.assertIn(state, allowed, "at %.3f s the command was %s; the geometry asks for state %s"
                              % (turn_ns * 1e-9, player.commands[-1][1], row[1]))
            self.assertIn(state, row[1], "%.2f s after the scan at %.3f s the command was %s; the geometry asks for "
                          "state %s" % ((following_ns - stamp_ns) * 1e-9, row[0], player.commands[-1][1], row[1]))
            before = set(row[1])
            seen += [state] if not seen or seen[-1] != state else []
        self.switch_off()
        return seen

    def switch_off(self):
        """Switch the node off; it must stop the robot."""
        player, before = self.player, len(self.player.commands)
        player.switch(SWITCH, False)
        wait_until(lambda: len(player.commands) > before, "the zero command that ends the drive")
        self.assertEqual(player.commands[-1][1], (0.0, 0.0))

    def test_a_drive_past_boxes(self):
        seen = self.follow("boxes_drive")
        self.assertEqual(set(seen), {0, 1, 2})
        names = ("find the wall", "turn left", "follow the wall")
        for state in (1, 2):
            self.assertIn("Wall follower - [%d] - %s" % (state, names[state]), self.player.lines())

    def test_a_360_degree_scanner(self):
        self.assertEqual(set(self.follow("yard_360")), {0, 1, 2})


if __name__ == "__main__":
    rostest.rosrun("m2wr_test", "bag_wall_follower", WallFollower)
