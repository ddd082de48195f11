#!/usr/bin/env python3
"""Drive along the way points of the parameter ~way_points."""
from motion_plan.ros_tour import tour

if __name__ == '__main__':
    tour()
