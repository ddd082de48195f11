# SPDX-License-Identifier: BSD-3-Clause
"""The cheapest way over an elevation map, and the command that follows it."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, Mapping, Tuple

import numpy as np

from m2wr_elevation.elevation_kernels import cheapest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_elevation.elevation_map import MapSettings

    Values = NDArray[np.float64]

# Costs of a cell, in ways over level ground: at the limit of slope, of step, of roughness; unknown; beyond a limit.
SLOPE_COST, STEP_COST, ROUGH_COST, UNKNOWN_COST, FORBIDDEN_COST = 6.0, 6.0, 3.0, 2.0, 60.0
SPEED = 0.3             # m/s
_AHEAD = 0.5            # m of way to the point that is steered to
_TURN = 2.0             # rad/s for each radian
_FASTEST_TURN = 1.0     # rad/s
_BACK, _WAIT = 2.5, 2.0         # s: for which a robot that gets nowhere drives backwards; without a move until it does
_MOVED, _TURNED = 0.05, 0.1     # m, rad: that is a move


def cost_of(layers: Mapping[str, Values], settings: MapSettings) -> Values:
    """Return the cost of each cell, for each cell of way; level ground costs 1.

    Slope costs energy and makes wheels slip, more the nearer it is to the limit; so do steps.  Forbidden cells cost
    much, but a robot that stands on one still finds its way off.  Where slip is expected, wheels turn 1 / (1 - slip)
    times as far for the same way, and so much greater is the cost.

    Parameters
    ----------
    layers : mapping of str to (n, n) float64
        Of :meth:`m2wr_elevation.elevation_map.ElevationMap.layers`; ``slip`` of
        :meth:`m2wr_elevation.slip.SlipMap.layer` may be there, too.
    settings : MapSettings
    """
    slope, step = layers["slope"] / settings.most_slope, layers["step"] / settings.most_step
    rough = layers["roughness"] / settings.most_roughness
    cost = 1.0 + SLOPE_COST * slope ** 2 + STEP_COST * step ** 2 + ROUGH_COST * rough ** 2
    cost = np.where(layers["traversability"] <= 0.0, FORBIDDEN_COST, cost)
    cost = np.where(np.isnan(cost), UNKNOWN_COST, cost)
    return cost / (1.0 - layers["slip"]) if "slip" in layers else cost


def route(cost: Values, start: Tuple[int, int], goal: Tuple[int, int]) -> List[Tuple[int, int]]:
    """Return the cells (row, column) of the cheapest way, start and goal included; empty where there is none.

    Parameters
    ----------
    cost : (rows, columns) float64
        Of a cell, above 0.
    start, goal : (int, int)
        Row and column.

    Raises
    ------
    ValueError
        If start or goal is outside.
    """
    rows, columns = cost.shape
    for name, (row, column) in (("start", start), ("goal", goal)):
        if not (0 <= row < rows and 0 <= column < columns):
            raise ValueError("the {} is cell ({}, {}) of a map of {} x {}".format(name, row, column, rows, columns))
    reached = np.empty(cost.shape)
    cheapest(np.ascontiguousarray(cost, float), goal, reached)
    if not math.isfinite(reached[start]):
        return []
    way = [start]
    while way[-1] != goal:
        row, column = way[-1]
        around = [(i, j) for i in range(max(0, row - 1), min(rows, row + 2))
                  for j in range(max(0, column - 1), min(columns, column + 2)) if (i, j) != (row, column)]
        way.append(min(around, key=lambda at: reached[at] + 0.5 * math.hypot(at[0] - row, at[1] - column)
                       * (cost[at] + cost[row, column])))
    return way


def follow(way: Values, x: float, y: float, yaw: float) -> Tuple[float, float]:
    """Return velocity [m/s] and yaw rate [rad/s] towards a point ahead on a way.

    Parameters
    ----------
    way : (n, 2) float64
        Points from the robot on [m].
    x, y, yaw : float
        Pose of the robot [m, rad].
    """
    away = np.hypot(way[:, 0] - x, way[:, 1] - y)
    nearest = int(np.argmin(away))
    far = np.flatnonzero(away[nearest:] > _AHEAD)
    point = way[nearest + int(far[0])] if len(far) else way[-1]
    turn = math.remainder(math.atan2(point[1] - y, point[0] - x) - yaw, 2.0 * math.pi)
    rate = max(-_FASTEST_TURN, min(_FASTEST_TURN, _TURN * turn))
    return SPEED * max(0.0, math.cos(turn)) if abs(turn) < 1.2 else 0.0, rate


class BackOff:
    """Says when a robot that gets nowhere drives backwards a while, to where its wheels did not slip."""

    def __init__(self) -> None:
        self._anchor, self._since, self._began = (math.inf, math.inf, 0.0), 0.0, -math.inf

    def due(self, now: float, x: float, y: float, yaw: float, spins: bool) -> bool:
        """Return whether the robot is to drive backwards now.

        Parameters
        ----------
        now : float
            [s]
        x, y, yaw : float
            Pose of the robot [m, rad].
        spins : bool
            Whether its wheels turn in vain.
        """
        if now - self._began < _BACK:
            return True
        away, turned = math.hypot(x - self._anchor[0], y - self._anchor[1]), yaw - self._anchor[2]
        if not away < _MOVED or abs(math.remainder(turned, 2.0 * math.pi)) > _TURNED:
            self._anchor, self._since = (x, y, yaw), now
        # once for each time: wheels that spin backwards, too, do not help
        stands = now - self._since > _WAIT
        if (spins or stands) and now - self._began > 2.0 * _BACK:
            self._began, self._since = now, now
            return True
        return False
