#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""go_to_point on recorded odometry: commands and logged states against the report's table."""
import os
import re
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from bag_player import ODOM, Fixture, Player  # noqa: E402
from graph_wait import wait_until  # noqa: E402

SWITCH = "/go_to_point_switch"


class GoToPoint(unittest.TestCase):
    """The whole bag once, then the switch."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("check_bag_go_to_point")
        cls.player = Player("/go_to_point", [ODOM])
        cls.fixture = Fixture("turn_and_go", [ODOM])
        cls.expected = cls.fixture.info["expected"]["go_to_point"]
        goal = rospy.get_param("/des_pos_x"), rospy.get_param("/des_pos_y")
        assert list(goal) == cls.fixture.info["expected"]["goal"], "the goal in the .test is not that of the bag"

    def play(self):
        """Play the bag with the node switched on; returns [(stamp [s], command)] and the states it logged."""
        player, first_ns = self.player, self.fixture.messages[0][2]
        player.begin(first_ns)
        lines = len(player.log)
        player.switch(SWITCH, True)
        player.lead_in([(ODOM, self.fixture.messages[0][1])], first_ns)
        commands = len(player.commands)
        for topic, message, stamp_ns in self.fixture.messages:
            player.publish(topic, message, stamp_ns)
            player.turn(stamp_ns)
        found = [(stamp_ns * 1e-9, command) for stamp_ns, command in player.commands[commands:]]
        return found, [int(match.group(1)) for match in
                       (re.match(r"State changed to \[(\d)\]$", line) for line in player.lines(start=lines)) if match]

    def switch_off(self):
        """Switch the node off; there must be one zero command, and none after it."""
        player, before = self.player, len(self.player.commands)
        player.switch(SWITCH, False)
        wait_until(lambda: len(player.commands) > before, "the zero command that ends the drive")
        self.assertEqual(player.commands[-1][1], (0.0, 0.0))

    def test_commands_follow_the_reports_table(self):
        commands, states = self.play()
        self.switch_off()
        rows, tolerance = self.expected["rows"], self.expected["tolerance"]
        changes = [entry for index, entry in enumerate(commands) if index == 0 or entry[1] != commands[index - 1][1]]
        self.assertEqual([list(command) for _, command in changes], [row[1:] for row in rows])
        for (stamp, command), row in zip(changes, rows):
            self.assertLessEqual(abs(stamp - row[0]), tolerance + 1e-6, "command %s came at %.3f s, expected at %.3f s"
                                 % (command, stamp, row[0]))
        self.assertEqual(states, [state for _, state in self.expected["entered"]])

    def test_each_start_begins_by_correcting_the_heading(self):
        # the bag ends in state 2, which only a restart leaves
        for _ in range(2):
            commands, states = self.play()
            self.switch_off()
            self.assertEqual(list(commands[0][1]), self.expected["rows"][0][1:])
            self.assertEqual(states[0], 1)

    def test_no_command_is_sent_while_switched_off(self):
        player, first_ns = self.player, self.fixture.messages[0][2]
        player.switch(SWITCH, False)
        player.begin(first_ns)
        before = len(player.commands)
        for topic, message, stamp_ns in self.fixture.messages[:20]:
            player.publish(topic, message, stamp_ns)
            player.set_clock(stamp_ns)
            player.switch(SWITCH, False)    # an answer of the node: a command sent before it would have arrived
        self.assertEqual(player.commands[before:], [])
        player.switch(SWITCH, True)
        self.assertEqual(player.turn(self.fixture.messages[20][2]), tuple(self.expected["rows"][0][1:]))
        self.switch_off()


if __name__ == "__main__":
    rostest.rosrun("m2wr_test", "bag_go_to_point", GoToPoint)
