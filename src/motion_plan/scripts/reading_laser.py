#!/usr/bin/env python3
"""Log the least range of the five laser sectors."""
from motion_plan.ros_nodes import reading_laser

if __name__ == '__main__':
    reading_laser()
