#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Behaviour: follow the wall on the right; switched by /wall_follower_switch."""
import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from motion_plan.ros_nodes import wall_follower

if __name__ == '__main__':
    wall_follower()
