#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Drive without a goal and turn away from obstacles."""
import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from motion_plan.ros_nodes import obstacle_avoidance

if __name__ == '__main__':
    obstacle_avoidance()
