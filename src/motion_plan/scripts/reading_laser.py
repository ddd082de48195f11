#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Log the least range of the five laser sectors."""
import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from motion_plan.ros_nodes import reading_laser

if __name__ == '__main__':
    reading_laser()
