#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Drive along the way points of the parameter ~way_points."""
import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from motion_plan.ros_tour import tour

if __name__ == '__main__':
    tour()
