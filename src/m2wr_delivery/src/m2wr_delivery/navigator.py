# SPDX-License-Identifier: BSD-3-Clause
"""Ways over the elevation map of a field: inside its borders, around other robots and places to get stuck."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np
from scipy.ndimage import binary_dilation

from m2wr_elevation.planning import FORBIDDEN_COST, cost_of, route

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_delivery.parcels import Point
    from m2wr_elevation.elevation_map import MapSettings

    Values = NDArray[np.float64]

MARGIN = 0.6                # m from the border of the field that a robot keeps away
ROBOT = 0.7                 # m: radius about another robot that a way leads around
TRAP = 0.35                 # m: radius about a place where the robot got stuck
BESIDE, BESIDE_COST = 0.25, 10.0        # m from forbidden ground, and the cost there: a robot is not a point
GOAL = 0.3                  # m: a goal may be as near to forbidden ground as this
MOST_TRAPS = 100


class Way(NamedTuple):
    """The cheapest way.

    Attributes
    ----------
    points : (n, 2) float64
        Up to the goal, or to where it would enter ground that is not traversable [m].
    length : float
        Up to the goal [m].
    blocked : bool
        Whether it would enter such ground.  Where the robot stands on some, it may leave it.
    """

    points: Values
    length: float
    blocked: bool


class Navigator:
    """Plans over one elevation map that does not move.

    Parameters
    ----------
    settings : MapSettings
        Of the map.
    half : float
        Half the side of the field [m].
    """

    def __init__(self, settings: MapSettings, half: float) -> None:
        self._settings = settings
        side = int(round(settings.size / settings.cell))
        ticks = (np.arange(side) - side // 2 + 0.5) * settings.cell
        self._ticks = ticks
        out = np.abs(ticks) > half - MARGIN
        self._outside = out[:, None] | out[None, :]
        self._traps: List[Point] = []
        self._cost = np.ones((side, side))

    def see(self, layers: Mapping[str, Values]) -> None:
        """Take the layers of the map, see :meth:`m2wr_elevation.elevation_map.ElevationMap.layers`."""
        cost = np.where(self._outside, FORBIDDEN_COST, cost_of(layers, self._settings))
        for x, y in self._traps:
            cost[self._disc(x, y, TRAP)] = FORBIDDEN_COST
        forbidden = cost >= FORBIDDEN_COST
        beside = grown(forbidden, int(round(BESIDE / self._settings.cell)))
        self._cost = np.where(beside & ~forbidden, np.maximum(cost, BESIDE_COST), cost)

    def avoid(self, x: float, y: float) -> None:
        """Keep away from a place where the robot got stuck.

        Parameters
        ----------
        x, y : float
            [m]
        """
        self._traps = self._traps[-MOST_TRAPS + 1:] + [(x, y)]

    def plan(self, here: Point, goal: Point, others: Sequence[Point] = ()) -> Way:
        """Return the cheapest way.

        Parameters
        ----------
        here, goal : (float, float)
            [m]
        others : sequence of (float, float)
            Places of other robots [m].
        """
        cost = self._cost
        if others:
            cost = cost.copy()
            for x, y in others:
                cost[self._disc(x, y, ROBOT)] = FORBIDDEN_COST
        cells = np.array(route(cost, self._cell(here), self._cell(goal)))
        points = np.column_stack((self._ticks[cells[:, 1]], self._ticks[cells[:, 0]]))
        length = float(np.hypot(*np.diff(points, axis=0).T).sum()) if len(points) > 1 else 0.0
        forbidden = self._cost[cells[:, 0], cells[:, 1]] >= FORBIDDEN_COST
        forbidden &= np.hypot(points[:, 0] - goal[0], points[:, 1] - goal[1]) > GOAL
        out = int(np.argmin(forbidden)) if forbidden.any() else 0       # first cell that the robot may stand on
        entered = np.flatnonzero(forbidden[out:])
        if not len(entered):
            return Way(points, length, False)
        return Way(points[:max(1, out + int(entered[0]))], length, True)

    def _disc(self, x: float, y: float, radius: float) -> NDArray[np.bool_]:
        return np.asarray((self._ticks[None, :] - x) ** 2 + (self._ticks[:, None] - y) ** 2 < radius ** 2)

    def _cell(self, place: Point) -> Tuple[int, int]:
        cell, side = self._settings.cell, len(self._ticks)
        column, row = (min(max(math.floor(value / cell) + side // 2, 0), side - 1) for value in place)
        return row, column


def grown(cells: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    """Return cells and all that are at most so many rows and columns away.

    Parameters
    ----------
    cells : (rows, columns) bool
    by : int
        Number of cells.
    """
    return np.asarray(binary_dilation(cells, np.ones((2 * by + 1, 2 * by + 1), bool)))
