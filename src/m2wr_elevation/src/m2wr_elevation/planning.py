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


def cost_of(layers: Mapping[str, Values], settings: MapSettings) -> Values:
    """Return the cost of each cell, for each cell of way; level ground costs 1.

    Slope costs energy and makes wheels slip, more the nearer it is to the limit; so do steps.  Forbidden cells cost
    much, but a robot that stands on one still finds its way off.

    Parameters
    ----------
    layers : mapping of str to (n, n) float64
        Of :meth:`m2wr_elevation.elevation_map.ElevationMap.layers`.
    settings : MapSettings
    """
    slope, step = layers["slope"] / settings.most_slope, layers["step"] / settings.most_step
    rough = layers["roughness"] / settings.most_roughness
    cost = 1.0 + SLOPE_COST * slope ** 2 + STEP_COST * step ** 2 + ROUGH_COST * rough ** 2
    cost = np.where(layers["traversability"] <= 0.0, FORBIDDEN_COST, cost)
    return np.where(np.isnan(cost), UNKNOWN_COST, cost)


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
