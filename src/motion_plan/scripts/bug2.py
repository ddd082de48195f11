#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2: drive to the goal by switching go_to_point and wall_follower."""
import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from motion_plan.ros_bug2 import bug2

if __name__ == '__main__':
    bug2()
