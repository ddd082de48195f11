#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""wall_follower with its guard on a recorded drive: no command leads into a box; far from boxes the table decides."""
import math
import os
import sys
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(os.path.dirname(sys.path[0]), "scripts"))
import plane_geometry  # noqa: E402
from bag_player import ODOM, SCAN, Fixture, Player  # noqa: E402

SWITCH = "/wall_follower_switch"
#: The guard acts on a wall within 1.35 m of the axle; farther away than this [m] it does nothing.
UNDISTURBED = 1.45
#: A command is extrapolated for this time [s]: twenty periods of the loop that could replace it.
HELD = 1.0
#: Clearance [m] that must remain at the end: the guard keeps the turning circle 0.03 m clear, half of it may be noise.
LEFT_CLEAR = 0.015


class WallGuard(unittest.TestCase):
    """Evaluated at the pose in the bag; the commands themselves are not driven."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("check_bag_wall_guard")
        cls.player = Player("/wall_follower", [SCAN, ODOM])

    def commands(self, name):
        """Play odometry and scans of a fixture; yields (stamp [s], pose, command, states the table may be in)."""
        fixture, player = Fixture(name, [SCAN, ODOM]), self.player
        states = {round(row[0] * 1e9): row[1] for row in fixture.info["expected"]["wall_follower"]["rows"]}
        first = {topic: message for topic, message, _ in reversed(fixture.messages)}
        first_ns = next(stamp_ns for topic, _, stamp_ns in fixture.messages if topic == ODOM)
        allowed = [states[min(states)]]
        player.begin(first_ns)
        player.switch(SWITCH, True)
        player.lead_in([(ODOM, first[ODOM]), (SCAN, first[SCAN])], first_ns)
        for topic, message, stamp_ns in fixture.messages:
            if topic == SCAN:
                allowed = allowed[-1:] + [states[stamp_ns]]     # the node may still use the previous scan
            if stamp_ns < first_ns:
                continue
            player.publish(topic, message, stamp_ns)
            if topic == ODOM:
                where, q = message.pose.pose.position, message.pose.pose.orientation
                pose = (where.x, where.y, 2 * math.atan2(q.z, q.w))
                yield stamp_ns * 1e-9, pose, player.turn(stamp_ns), sum(allowed, [])
        player.switch(SWITCH, False)

    def test_no_command_leads_into_a_box(self):
        boxes = plane_geometry.read_boxes(Fixture("boxes_drive", [SCAN]).world())
        table = Fixture("boxes_drive", [SCAN]).info["expected"]["wall_follower"]["commands"]
        undisturbed = guarded = driving = 0
        for stamp, pose, command, states in self.commands("boxes_drive"):
            what = "at %.3f s, at (%.2f, %.2f, %.2f), command %s" % ((stamp,) + pose + (command,))
            for fifth in range(1, 6):
                later = plane_geometry.drive(pose, command[0], command[1], HELD * fifth / 5)
                self.assertGreater(plane_geometry.clearance(later, boxes), LEFT_CLEAR, what)
            if plane_geometry.distance([plane_geometry.axle(pose)], boxes) > UNDISTURBED and not guarded:
                undisturbed += 1
                self.assertIn(list(command), [table[state] for state in states], what)
            elif list(command) not in table.values():
                guarded += 1
                driving += command[0] > 0.05
        self.assertGreater(undisturbed, 20)
        self.assertGreater(guarded, 200)
        self.assertGreater(driving, 50)


if __name__ == "__main__":
    rostest.rosrun("m2wr_test", "bag_wall_guard", WallGuard)
