# SPDX-License-Identifier: BSD-3-Clause
"""Small grids from drawings: ``#`` lethal, ``.`` free, ``?`` unknown, ``i`` inscribed."""
import numpy as np

from m2wr_navigation.costmap.costmap import Costmap

VALUES = {"#": 254, ".": 0, "?": 255, "i": 253}


def grid(text, resolution=0.5):
    """Return the Costmap of a drawing; its first line is the greatest y, its corner is (0, 0)."""
    lines = text.split()
    costs = np.array([[VALUES[letter] for letter in line] for line in lines[::-1]], np.uint8)
    return Costmap(costs, resolution, np.zeros(2), "map")


class World:
    """A true grid that is seen bit by bit: all within a radius of the robot that no wall hides."""

    def __init__(self, text, reach=3.0, resolution=0.5):
        self.truth, self.reach = grid(text, resolution), reach
        self.known = Costmap(np.full_like(self.truth.costs, 255), resolution, np.zeros(2), "map")

    def see(self, x, y):
        """Take what is visible from a place into the known map."""
        from m2wr_exploration.frontier_kernels import visible
        row, column = self.truth.cell(x, y)
        marks = np.zeros(self.truth.shape, np.uint8)
        visible(self.truth.costs, row, column, self.reach / self.truth.resolution, 360, marks, True)
        self.known.costs[marks == 1] = self.truth.costs[marks == 1]
