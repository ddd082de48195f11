# SPDX-License-Identifier: BSD-3-Clause
"""What tests of controllers that roll out samples share: a small robot, a local costmap, plans."""
import numpy as np

from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.parameters import read

BOX = np.array([[0.2, 0.15], [-0.2, 0.15], [-0.2, -0.15], [0.2, -0.15]])
PERIOD = 0.1


def made(kind, **values):
    """A controller with some values of its parameters."""
    converted, warnings = read(kind.PARAMETERS, values, "~")
    assert not warnings
    return kind(converted)


def free():
    """A free local costmap of 6 x 6 m around the origin."""
    return Costmap.filled((120, 120), 0.05, (-3.0, -3.0), 0, "odom")


def block(costmap, x0, y0, x1, y1):
    """Fill a box with obstacles."""
    low, high = costmap.cell(x0, y0), costmap.cell(x1, y1)
    costmap.costs[low[0]:high[0], low[1]:high[1]] = 254


def straight(end, start=(0.0, 0.0)):
    """A straight plan of 60 poses with the heading of its end."""
    line = np.linspace(start, end[:2], 60)
    return np.column_stack([line, np.full(60, end[2])])


def situation(costmap, plan, pose=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0)):
    """What the controller sees."""
    return Situation(0.0, PERIOD, np.array(pose, float), np.array(velocity, float), plan, costmap, BOX)
