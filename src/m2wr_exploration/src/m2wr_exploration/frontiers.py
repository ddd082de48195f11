# SPDX-License-Identifier: BSD-3-Clause
"""Frontiers: where the known, reachable area ends and the unknown begins."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, List, Optional, Tuple

import numpy as np

from m2wr_exploration import frontier_kernels
from m2wr_navigation.costmap.cost_layout import FREE, INSCRIBED, LETHAL, NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.localization.field_kernels import distance_transform
from m2wr_navigation.planners import wave_kernels

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import Float32Array, FloatArray, IndexArray, Int8Array, Uint8Array

NEAR = 1.0                  # m: the search begins at the nearest passable cell, at most this far from the robot
RAYS = 180                  # of a simulated look: every second degree, as the laser of a small robot
_NOWHERE = np.zeros((0, 0), np.uint8)


def costs_of_occupancy(occupancy: Int8Array) -> Uint8Array:
    """Return the costs of an OccupancyGrid, which is a map or a published costmap.

    A costmap publishes 253 (inscribed) as 99 and 254 (lethal) as 100; 1 to 98 are lesser costs.

    Parameters
    ----------
    occupancy : (H, W) int8
        -1 unknown, 0 free to 100 occupied; other values count as unknown.

    Returns
    -------
    (H, W) uint8
    """
    table = np.full(256, NO_INFORMATION, np.uint8)
    table[0], table[99], table[100] = FREE, INSCRIBED, LETHAL
    table[1:99] = 1 + 251 * np.arange(98) // 97
    found: Uint8Array = table[np.ascontiguousarray(occupancy).view(np.uint8)]
    return found


@dataclass(frozen=True, eq=False)
class Frontier:
    """A group of frontier cells.

    Attributes
    ----------
    cells : (N, 2) int64
        Row and column of its unknown cells.
    points : (N, 2) float64
        Their centres [m].
    centre : (2,) float64
        Mean of the points [m].
    goal : (2,) float64
        The reachable place beside the frontier that is nearest to its centre [m].
    goal_cell : (int, int)
        Its row and column.
    size : float
        Number of cells times the resolution [m].
    nearest : float
        Straight distance from the robot to the nearest point [m].
    path : float
        Length of the path from the robot to the goal [m].
    """

    cells: IndexArray
    points: FloatArray
    centre: FloatArray
    goal: FloatArray
    goal_cell: Tuple[int, int]
    size: float
    nearest: float
    path: float


@dataclass(frozen=True)
class View:
    """All frontiers of a map, as seen from a pose.

    Attributes
    ----------
    costmap : Costmap
    robot : (2,) float64
        [m]
    distance : (H, W) float32
        Length of the path from the robot to each cell [m]; inf: not reachable.
    frontiers : list of Frontier
        Not smaller than the least size.
    small : int
        Number of smaller ones.
    reason : str
        Why there is nothing to search, one sentence; otherwise empty.
    """

    costmap: Costmap
    robot: FloatArray
    distance: Float32Array
    frontiers: List[Frontier]
    small: int = 0
    reason: str = ""


def distances(costmap: Costmap, cell: Tuple[int, int]) -> Float32Array:
    """Return the length of the path from a cell to each cell (H, W) [m]; inf: none.

    Parameters
    ----------
    costmap : Costmap
        Inscribed, lethal and unknown cells are not crossed.
    cell : (row, column)
    """
    table = np.where(np.arange(256) < INSCRIBED, 1.0, np.inf).astype(np.float32)
    found = np.full(costmap.shape, np.inf, np.float32)
    wave_kernels.wave(costmap.costs, table, cell, (-1, -1), found, _NOWHERE, True)
    return found * np.float32(costmap.resolution)


def with_room(costmap: Costmap, radius: float) -> Costmap:
    """Return a costmap in which cells nearer to an obstacle than a radius are inscribed.

    Parameters
    ----------
    costmap : Costmap
    radius : float
        [m]; 0: the costmap itself.
    """
    if radius <= 0.0:
        return costmap
    away = np.empty(costmap.shape, np.float32)
    distance_transform(costmap.costs == LETHAL, radius / costmap.resolution + 2.0, away)
    costs = np.where((away * costmap.resolution < radius) & (costmap.costs < INSCRIBED), INSCRIBED, costmap.costs)
    return Costmap(costs.astype(np.uint8), costmap.resolution, costmap.origin, costmap.frame)


def look(costmap: Costmap, robot: FloatArray, least: float, radius: float = 0.0) -> View:
    """Find the frontiers that the robot can reach.

    Parameters
    ----------
    costmap : Costmap
    robot : (2,) float64
        In its frame [m].
    least : float
        Size of the smallest frontier [m].
    radius : float
        Of the disc in which the robot can turn [m]; 0: the costs alone say where it can be.

    Returns
    -------
    View
    """
    robot, costmap = np.asarray(robot, float)[:2], with_room(costmap, radius)
    nothing = np.full(costmap.shape, np.inf, np.float32)
    cell = costmap.cell(robot[0], robot[1])
    if cell is None:
        far = costmap.origin + costmap.resolution * np.array([costmap.columns, costmap.rows])
        return View(costmap, robot, nothing, [], 0, "the robot at ({:.2f}, {:.2f}) is outside of the map, which is x "
                    "{:.2f} to {:.2f}, y {:.2f} to {:.2f} in {}".format(
                        robot[0], robot[1], costmap.origin[0], far[0], costmap.origin[1], far[1], costmap.frame))
    start = frontier_kernels.nearest_passable(costmap.costs, cell[0], cell[1], INSCRIBED - 1,
                                              int(math.ceil(NEAR / costmap.resolution)))
    if start[0] < 0:
        return View(costmap, robot, nothing, [], 0, "there is no free cell within {:g} m of the robot at ({:.2f}, "
                    "{:.2f})".format(NEAR, robot[0], robot[1]))
    distance = distances(costmap, start)
    groups, count = frontier_kernels.frontier_groups(costmap.costs, distance)
    cells = np.argwhere(groups)
    numbers = groups[cells[:, 0], cells[:, 1]]
    order = np.argsort(numbers, kind="stable")
    parts = np.split(cells[order], np.searchsorted(numbers[order], np.arange(2, count + 1)))
    enough = [part for part in parts if len(part) * costmap.resolution >= least] if count else []
    made = [frontier for frontier in (_frontier(costmap, robot, distance, part) for part in enough) if frontier]
    return View(costmap, robot, distance, made, count - len(enough))


def _frontier(costmap: Costmap, robot: FloatArray, distance: Float32Array, cells: IndexArray) -> Optional[Frontier]:
    points = (cells[:, ::-1] + 0.5) * costmap.resolution + costmap.origin
    centre = points.mean(axis=0)
    beside = (cells[:, None] + np.array([(0, 1), (0, -1), (1, 0), (-1, 0)])).reshape(-1, 2)
    inside = ((beside >= 0) & (beside < np.array(costmap.shape))).all(axis=1)
    beside = beside[inside]
    beside = beside[np.isfinite(distance[beside[:, 0], beside[:, 1]])]
    if not len(beside):
        return None
    places = (beside[:, ::-1] + 0.5) * costmap.resolution + costmap.origin
    best = int(np.argmin(np.square(places - centre).sum(axis=1)))
    row, column = int(beside[best, 0]), int(beside[best, 1])
    return Frontier(cells, points, centre, places[best], (row, column), len(cells) * costmap.resolution,
                    float(np.sqrt(np.square(points - robot).sum(axis=1).min())), float(distance[row, column]))


def gain(costmap: Costmap, frontier: Frontier, reach: float, seen: Optional[Uint8Array] = None) -> float:
    """Return the unknown area that a laser at the goal of a frontier would see, if nothing were in it [m^2].

    Parameters
    ----------
    costmap : Costmap
    frontier : Frontier
    reach : float
        Range of the laser [m].
    seen : (H, W) uint8, optional
        Cells that count as seen already; changed.
    """
    marks = np.zeros(costmap.shape, np.uint8) if seen is None else seen
    new = frontier_kernels.visible(costmap.costs, frontier.goal_cell[0], frontier.goal_cell[1],
                                   reach / costmap.resolution, RAYS, marks, True)
    return new * costmap.resolution ** 2
