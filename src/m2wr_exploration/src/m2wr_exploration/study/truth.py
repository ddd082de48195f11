# SPDX-License-Identifier: BSD-3-Clause
"""Which area of a world a robot can reach, and how much of it is known."""
from __future__ import annotations

from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_exploration.frontiers import aligned
from m2wr_navigation.costmap.cost_layout import INSCRIBED, LETHAL, NO_INFORMATION
from m2wr_navigation.localization.field_kernels import distance_transform
from m2wr_navigation.planners.wave_kernels import connected

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import BoolArray, FloatArray


def passable_from(truth: Costmap, cell: Tuple[int, int]) -> BoolArray:
    """Return the cells (H, W) to which the centre of a robot can get from one of them.

    Parameters
    ----------
    truth : Costmap
        Inscribed where the robot cannot be.
    cell : (row, column)
    """
    table = np.where(np.arange(256) < INSCRIBED, 1.0, np.inf).astype(np.float32)
    found: BoolArray = connected(truth.costs, table, cell)[0] == 1
    return found


def reachable_area(truth: Costmap, start: FloatArray, radius: float) -> BoolArray:
    """Return the free cells (H, W) that the body of a robot can cover.

    Parameters
    ----------
    truth : Costmap
        Of the true world; inscribed where the robot cannot be.
    start : (2,) float
        [m]
    radius : float
        Of the body [m], as in the costmap.

    Raises
    ------
    ValueError
        If the robot cannot be at its start.
    """
    cell = truth.cell(float(start[0]), float(start[1]))
    if cell is None or truth.costs[cell] >= INSCRIBED:
        raise ValueError("the robot cannot start at ({:.2f}, {:.2f})".format(float(start[0]), float(start[1])))
    away = np.empty(truth.shape, np.float32)
    distance_transform(passable_from(truth, cell), float(sum(truth.shape)), away)
    covered: BoolArray = (away * truth.resolution <= radius) & (truth.costs != LETHAL)
    return covered


def explored_share(truth: Costmap, wanted: BoolArray, known: Costmap) -> Tuple[float, float]:
    """Return the share of the wanted cells that is known, and their area [m^2].

    Parameters
    ----------
    truth : Costmap
    wanted : (H, W) bool
        Of the true world.
    known : Costmap
        The robot's map, in the frame of the world, not rotated.
    """
    count, seen = int(np.count_nonzero(wanted)), wanted & (aligned(known, truth) != NO_INFORMATION)
    return float(np.count_nonzero(seen)) / max(1, count), count * truth.resolution ** 2


def wall_shares(truth: Costmap, known: Costmap) -> Tuple[float, float]:
    """Return how well the walls of a map agree with the true ones.

    Parameters
    ----------
    truth : Costmap
        Of the true world.
    known : Costmap
        The robot's map, in the frame of the world, not rotated.

    Returns
    -------
    right : float
        Share of the occupied cells that are within one cell of a true obstacle; 1 if there are none.
    drawn : float
        Share of the cells at the border of true obstacles beside known free ones that have an occupied cell within one
        cell; 1 if there are none.
    """
    seen, walls = aligned(known, truth), truth.costs == LETHAL
    occupied, free = seen == LETHAL, seen < LETHAL
    border = walls & _beside(~walls) & _beside(free)
    return _share(occupied & _beside(walls), occupied), _share(border & _beside(occupied), border)


def _beside(mask: BoolArray) -> BoolArray:
    """Return a mask (H, W) with the eight neighbours of its cells."""
    away = np.empty(mask.shape, np.float32)
    distance_transform(mask, 3.0, away)
    near: BoolArray = away < 1.5
    return near


def _share(part: BoolArray, whole: BoolArray) -> float:
    count = int(np.count_nonzero(whole))
    return float(np.count_nonzero(part)) / count if count else 1.0
