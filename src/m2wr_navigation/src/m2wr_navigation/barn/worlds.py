# SPDX-License-Identifier: BSD-3-Clause
"""Fields of BARN as worlds: cylinders in SDF that Gazebo loads, start, goal and optimal time."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, Tuple

import numpy as np

from m2wr_navigation.barn.fields import SIDE
from m2wr_navigation.compare.scenes import Scene, world_text

if TYPE_CHECKING:
    from m2wr_navigation.barn.fields import Field
    from m2wr_node.array_types import BoolArray

    Point = Tuple[float, float]

CELL = 0.15                 # m: side of a cell, diameter of a cylinder
PEN = 5.0                   # m: length of the pen in which the robot starts
START, GOAL = (-2.0, 3.0, 1.57), (-2.0, 13.0)           # [m, m, rad], [m, m]
OPTIMAL_SPEED = 2.0         # m/s: of the optimal time


def place_of(row: float, column: float) -> Point:
    """Return x, y of the middle of a cell [m].

    Parameters
    ----------
    row, column : float
    """
    return -0.075 - 30 * CELL + CELL * row, 5.075 + CELL * column


def cylinders_of(full: BoolArray, scale: float = 1.0) -> List[Tuple[float, float, float]]:
    """Return x, y and radius of the cylinders [m]: of full cells that are not enclosed by full ones, and of the pen.

    Parameters
    ----------
    full : (SIDE, SIDE) bool
    scale : float
        Of all lengths, over those of the benchmark.
    """
    wide = np.pad(full, 1)
    cells = [(row, column) for row, column in np.argwhere(full).tolist()
             if not wide[row:row + 3, column:column + 3].all()]
    length = int(math.ceil(PEN / CELL))
    cells += [(row, -column) for row in (0, SIDE - 1) for column in range(1, length + 1)]
    cells += [(row, -length) for row in range(1, SIDE - 1)]
    places = ((*place_of(row, column), 0.5 * CELL) for row, column in cells)
    return [(scale * x, scale * y, scale * radius) for x, y, radius in places]


def scene_of(field: Field) -> Scene:
    """Return a field as a scene.

    Parameters
    ----------
    field : Field
    """
    name = "{} f {:.2f} s {}".format(field.number, field.fill, field.rounds)
    return Scene(name, world_text([], cylinders_of(field.full)), START, GOAL)


def reference_length(field: Field) -> float:
    """Return the length from the start along the reference path to the goal [m].

    Parameters
    ----------
    field : Field
    """
    points = np.array([START[:2], *(place_of(*cell) for cell in field.path), GOAL])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def optimal_time(field: Field) -> float:
    """Return the time for the reference length at OPTIMAL_SPEED [s].

    Parameters
    ----------
    field : Field
    """
    return reference_length(field) / OPTIMAL_SPEED
