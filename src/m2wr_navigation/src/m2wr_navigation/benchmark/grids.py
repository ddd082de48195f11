# SPDX-License-Identifier: BSD-3-Clause
"""Costmaps on which the benchmark plans; the same for a seed."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.inflation_kernels import cost_table, inflate

if TYPE_CHECKING:
    from m2wr_navigation.planners.planner import Cell
    from m2wr_node.array_types import Uint8Array

RESOLUTION = 0.05           # m
RADIUS = 11                 # cells: 0.55 m, the default of costmap_2d
INSCRIBED_RADIUS = 0.2      # m
SCALING = 3.0               # 1/m
CELLS_PER_BLOCK = 8000      # 2000 blocks on 4000 x 4000 cells
ROOMS = 8                   # rooms along a side
DOOR = 24                   # cells: 1.2 m


def blocks(size: int, random: np.random.Generator) -> Uint8Array:
    """Return a grid (size, size) with rectangles of 4 to 40 cells a side.

    Parameters
    ----------
    size : int
    random : numpy.random.Generator
    """
    costs = np.zeros((size, size), np.uint8)
    for _ in range(size * size // CELLS_PER_BLOCK):
        (row, column), (high, wide) = random.integers(30, size - 60, 2), random.integers(4, 40, 2)
        costs[row:row + high, column:column + wide] = LETHAL
    return costs


def rooms(size: int, random: np.random.Generator) -> Uint8Array:
    """Return a grid (size, size) of 8 x 8 rooms with a door in each wall between two.

    Parameters
    ----------
    size : int
    random : numpy.random.Generator
    """
    costs, side = np.zeros((size, size), np.uint8), size // ROOMS
    for wall in range(side, ROOMS * side, side):
        costs[wall - 1:wall + 1], costs[:, wall - 1:wall + 1] = LETHAL, LETHAL
    for wall in range(side, ROOMS * side, side):
        for room in range(0, ROOMS * side, side):
            across, along = random.integers(5, side - DOOR - 5, 2) + room
            costs[wall - 1:wall + 1, across:across + DOOR] = 0
            costs[along:along + DOOR, wall - 1:wall + 1] = 0
    return costs


def inflated(costs: Uint8Array) -> Costmap:
    """Return a costmap of a grid (H, W), inflated."""
    table = cost_table(RADIUS, RESOLUTION, INSCRIBED_RADIUS, SCALING)
    inflate(costs, table, RADIUS, 0, costs.shape[0], 0, costs.shape[1], False)
    return Costmap(costs, RESOLUTION, np.zeros(2))


def scenes(size: int, seed: int) -> Dict[str, Tuple[Costmap, Cell, Cell]]:
    """Return costmaps of size x size cells with a start and a goal in opposite corners, by name.

    Parameters
    ----------
    size : int
    seed : int
    """
    random = np.random.default_rng(seed)
    ends = (20, 20), (size - 20, size - 25)
    return {name: (inflated(costs), *ends) for name, costs in (
        ("open", np.zeros((size, size), np.uint8)), ("blocks", blocks(size, random)),
        ("rooms", rooms(size, random)))}
