#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""/clock at 1000 Hz: every millisecond once, in order, none lost."""
import os
import sys
import unittest

import rospy
from rosgraph_msgs.msg import Clock

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, run_checks  # noqa: E402

STEP_NS, COUNT = 1000000, 3000


class ClockRate(unittest.TestCase):

    def test_every_step_has_its_clock(self):
        messages = Recorder("/clock", Clock).connected().next(COUNT)
        times = [message.clock.to_nsec() for message in messages]
        self.assertEqual({later - earlier for earlier, later in zip(times, times[1:])}, {STEP_NS})
        self.assertEqual(times[0] % STEP_NS, 0)


if __name__ == "__main__":
    rospy.init_node("check_clock_rate", disable_rostime=True)
    run_checks("clock_rate", ClockRate)
