#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Behaviour: drive to the point (des_pos_x, des_pos_y); switched by /go_to_point_switch."""
import m2wr_node.interrupts  # noqa: F401 (first: Ctrl-C ends the imports without a traceback)
from motion_plan.ros_nodes import go_to_point

if __name__ == '__main__':
    go_to_point()
