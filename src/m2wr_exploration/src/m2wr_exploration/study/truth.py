# SPDX-License-Identifier: BSD-3-Clause
"""Which area of a world a robot can reach, and how much of it is known."""
from __future__ import annotations

from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import INSCRIBED, LETHAL, NO_INFORMATION
from m2wr_navigation.localization.field_kernels import distance_transform
from m2wr_navigation.planners.wave_kernels import connected

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import BoolArray, FloatArray
    from m2wr_navigation.costmap.costmap import Costmap


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
    table = np.where(np.arange(256) < INSCRIBED, 1.0, np.inf).astype(np.float32)
    found, _ = connected(truth.costs, table, cell)
    away = np.empty(truth.shape, np.float32)
    distance_transform(found == 1, float(sum(truth.shape)), away)
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
    rows, columns = np.nonzero(wanted)
    centres = (np.stack([columns, rows], -1) + 0.5) * truth.resolution + truth.origin
    cells = known.cells(centres)
    inside = known.inside(cells)
    costs = known.costs[cells[inside, 0], cells[inside, 1]]
    area = len(rows) * truth.resolution ** 2
    return float(np.count_nonzero(costs != NO_INFORMATION)) / max(1, len(rows)), area
