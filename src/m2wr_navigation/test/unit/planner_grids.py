# SPDX-License-Identifier: BSD-3-Clause
"""Costmaps and planners that tests share."""
import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.inflation_kernels import cost_table, inflate
from m2wr_navigation.parameters import read

RESOLUTION = 0.05


def planner(name, clock=None, **given):
    kind = registry.find(registry.PLANNERS, name)
    values, warnings = read(kind.PARAMETERS, given, "~" + name)
    assert not warnings and set(given) <= set(kind.PARAMETERS)
    return kind(values, clock)


def blocks(size, count, seed, largest=12):
    """A grid of so many cells a side with lethal rectangles."""
    rng, costs = np.random.default_rng(seed), np.zeros((size, size), np.uint8)
    for _ in range(count):
        row, column = rng.integers(4, size - 4, 2)
        high, wide = rng.integers(2, largest, 2)
        costs[row:row + high, column:column + wide] = 254
    costs[:3, :], costs[-3:, :] = 0, 0
    costs[:, :3], costs[:, -3:] = 0, 0
    return costs


def inflated(costs, radius=0.4, inscribed=0.1, scaling=5.0):
    cells = int(np.ceil(radius / RESOLUTION))
    table = cost_table(cells, RESOLUTION, inscribed, scaling)
    inflate(costs, table, cells, 0, costs.shape[0], 0, costs.shape[1], False)
    return costs


def grid(costs, origin=(0.0, 0.0)):
    return Costmap(np.ascontiguousarray(costs), RESOLUTION, np.array(origin, float), "map")


def pose(row, column, yaw=0.0, origin=(0.0, 0.0)):
    """The pose in the middle of a cell."""
    return np.array([origin[0] + (column + 0.5) * RESOLUTION, origin[1] + (row + 0.5) * RESOLUTION, yaw])


def costs_along(costmap, poses):
    """The costs of the cells that a path meets, sampled at tenths of a cell."""
    points = [poses[:1, :2]]
    for begin, end in zip(poses[:-1, :2], poses[1:, :2]):
        count = max(1, int(np.ceil(np.hypot(*(end - begin)) / (0.1 * RESOLUTION))))
        points.append(begin + (end - begin) * (np.arange(1, count + 1) / count)[:, None])
    cells = costmap.cells(np.concatenate(points))
    return costmap.costs[cells[:, 0], cells[:, 1]]
