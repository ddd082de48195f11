#!/usr/bin/env python3
"""Bug 2: to the goal by way of go_to_point and wall_follower."""
from motion_plan.ros_bug2 import bug2

if __name__ == '__main__':
    bug2()
