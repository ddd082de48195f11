#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Behaviour: follow the wall on the right (the same as wall_follower.py)."""
import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from motion_plan.ros_nodes import wall_follower

if __name__ == '__main__':
    wall_follower()
