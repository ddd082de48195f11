# SPDX-License-Identifier: BSD-3-Clause
"""Mazes: a spanning tree of square cells by a random walk that turns back, with some walls opened."""
from __future__ import annotations

import math
from typing import Any, List, Mapping, Optional, Set, Tuple

import numpy as np

from m2wr_navigation.compare.scenes import MARGIN, WALL, Box, Ends, world_text
from m2wr_navigation.parameters import Parameter

PARAMETERS = {
    "cells": Parameter(6, "", 2, 30, "cells along each side"),
    "width": Parameter(1.8, "m", 0.3, 10.0, "of a cell"),
    "opened": Parameter(0.1, "", 0.0, 1.0, "share of the walls that are left out, so that there are loops"),
}
_Cell = Tuple[int, int]


def passages(cells: int, random: np.random.Generator) -> Set[Tuple[_Cell, _Cell]]:
    """Return the pairs of neighbours without a wall between them; exactly one way connects any two cells.

    Parameters
    ----------
    cells : int
        Along each side.
    random : numpy.random.Generator
    """
    way, known = [(0, 0)], {(0, 0)}
    found: Set[Tuple[_Cell, _Cell]] = set()
    while way:
        x, y = way[-1]
        free = [(i, j) for i, j in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1))
                if 0 <= i < cells and 0 <= j < cells and (i, j) not in known]
        if not free:
            way.pop()
            continue
        cell = free[int(random.integers(len(free)))]
        found.add(((x, y), cell))
        found.add((cell, (x, y)))
        known.add(cell)
        way.append(cell)
    return found


def attempt(random: np.random.Generator, values: Mapping[str, Any], radius: float) -> Optional[Tuple[str, Ends]]:
    """Return a world in SDF with start and goal in opposite corners; None if the robot is too wide for it.

    Parameters
    ----------
    random : numpy.random.Generator
    values : mapping of str to object
        Of PARAMETERS.
    radius : float
        Of the disc in which the robot turns [m].
    """
    cells, width = values["cells"], values["width"]
    if width - WALL < 2.0 * (radius + 0.5 * MARGIN):
        return None
    ways = passages(cells, random)
    side = cells * width
    walls: List[Box] = [(0.5 * side, 0.0, side, WALL), (0.5 * side, side, side, WALL),
                        (0.0, 0.5 * side, WALL, side), (side, 0.5 * side, WALL, side)]
    for x in range(cells):
        for y in range(cells):
            for i, j in ((x + 1, y), (x, y + 1)):
                if i < cells and j < cells and ((x, y), (i, j)) not in ways and random.random() >= values["opened"]:
                    walls.append((i * width, (y + 0.5) * width, WALL, width + WALL) if j == y else
                                 ((x + 0.5) * width, j * width, width + WALL, WALL))
    first, last = 0.5 * width, side - 0.5 * width
    yaw = 0.0 if ((0, 0), (1, 0)) in ways else 0.5 * math.pi
    return world_text(walls, []), ((first, first, round(yaw, 3)), (last, last))
