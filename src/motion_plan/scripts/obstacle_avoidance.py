#!/usr/bin/env python3
"""Drive about and turn away from obstacles."""
from motion_plan.ros_nodes import obstacle_avoidance

if __name__ == '__main__':
    obstacle_avoidance()
