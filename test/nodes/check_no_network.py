#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""With ~enable_ros_network off: the clock runs, and there is no service and no state topic of the simulation."""
import os
import sys
import unittest

import rosgraph
import rospy
from rosgraph_msgs.msg import Clock

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, run_checks  # noqa: E402


class NoNetwork(unittest.TestCase):
    """The graph as a master sees it."""

    def test_only_clock_and_loggers(self):
        clock = Recorder("/clock", Clock).connected()
        first = clock.next(1)[0].clock
        clock.wait(lambda messages: messages[-1].clock.to_sec() > first.to_sec() + 0.5, "half a second")
        published, subscribed, services = [
            sorted(name for name, nodes in part if "/gazebo" in nodes)
            for part in rosgraph.Master(rospy.get_name()).getSystemState()]
        self.assertEqual([name for name in published if name != "/tf"], ["/clock", "/rosout"])
        self.assertEqual((subscribed, services), ([], ["/gazebo/get_loggers", "/gazebo/set_logger_level"]))


if __name__ == "__main__":
    rospy.init_node("check_no_network", disable_rostime=True)
    run_checks("no_network", NoNetwork)
