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
from m2wr_navigation.planners.narrow_ways import with_narrow_ways

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Int8Array, Int32Array, Uint8Array

NEAR = 1.0                  # m: the search begins at the nearest passable cell, at most this far from the robot
RAYS = 180                  # of a simulated look: every second degree, as the laser of a small robot
CLOSE = 3.0                 # m: from so near the robot looks into corners
SLIT = 1.5                  # cells: what is nearer to an obstacle is no corner; a wall has gaps where no ray has hit it
WIDE = 128                  # cost above which a place is narrow; the robot looks from others where it can
IN_SIGHT = 1.0 / 3.0        # of a corner: so much has to be in sight from one place
LOOKS = 12                  # cells of a corner for which the lines of sight are drawn
_NOWHERE = np.zeros((0, 0), np.uint8)
_NOT_LETHAL = np.where(np.arange(256) < LETHAL, 1.0, np.inf).astype(np.float32)


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
        The reachable place beside the frontier that is nearest to its centre, or from which it is in sight [m].
    goal_cell : (int, int)
        Its row and column.
    size : float
        Number of cells times the resolution [m].
    nearest : float
        Straight distance from the robot to the nearest point [m].
    path : float
        Length of the path from the robot to the goal [m].
    beside : bool
        Whether the goal is beside it, and not a place from which it is in sight.
    """

    cells: IndexArray
    points: FloatArray
    centre: FloatArray
    goal: FloatArray
    goal_cell: Tuple[int, int]
    size: float
    nearest: float
    path: float
    beside: bool = True


@dataclass(frozen=True)
class View:
    """All frontiers of a map, as seen from a pose.

    Attributes
    ----------
    costmap : Costmap
        Inscribed where the robot cannot turn.
    passable : Costmap
        Inscribed where the robot cannot be.
    robot : (2,) float64
        [m]
    distance : (H, W) float32
        Length of the path from the robot to each cell where it can turn [m]; inf: not reachable.
    frontiers : list of Frontier
        Not smaller than the least size.
    small : int
        Number of smaller ones.
    reason : str
        Why there is nothing to search, one sentence; otherwise empty.
    """

    costmap: Costmap
    passable: Costmap
    robot: FloatArray
    distance: Float32Array
    frontiers: List[Frontier]
    small: int = 0
    reason: str = ""

    def distances_from(self, cell: Tuple[int, int]) -> Float32Array:
        """Return the length of the path from a passable cell to each cell where the robot can turn (H, W) [m]."""
        return distances_with_room(self.costmap, self.passable, cell)


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


def nearest_passable(costmap: Costmap, place: FloatArray) -> Optional[Tuple[int, int]]:
    """Return the nearest cell where the robot can be, at most NEAR away; None: there is none.

    Parameters
    ----------
    costmap : Costmap
    place : (2,) float64
        [m]
    """
    cell = costmap.cell(place[0], place[1])
    if cell is None:
        return None
    row, column = frontier_kernels.nearest_passable(costmap.costs, cell[0], cell[1], INSCRIBED - 1,
                                                    int(math.ceil(NEAR / costmap.resolution)))
    return None if row < 0 else (row, column)


def distances_with_room(room: Costmap, passable: Costmap, start: Tuple[int, int]) -> Float32Array:
    """Return the length of the path from a cell to each cell where the robot can turn (H, W) [m]; inf: none.

    As the planner does, a path keeps to places where the robot can turn if there is such a path, however long.

    Parameters
    ----------
    room : Costmap
        Inscribed where the robot cannot turn.
    passable : Costmap
        Inscribed where it cannot be.
    start : (row, column)
        Passable.
    """
    narrow = distances(passable, start)
    if room is passable:
        return narrow
    narrow[room.costs >= INSCRIBED] = np.inf
    first = np.unravel_index(int(np.argmin(narrow)), narrow.shape)
    wide = distances(room, (int(first[0]), int(first[1]))) + narrow[first]
    return np.where(np.isfinite(wide), wide, narrow)


def reachable_area(room: Costmap, passable: Costmap, place: FloatArray) -> float:
    """Return the area of the places where a robot can turn, and to which it can drive [m^2].

    Parameters
    ----------
    room : Costmap
        Inscribed where the robot cannot turn.
    passable : Costmap
        Inscribed where it cannot be.
    place : (2,) float64
        Where it is [m].
    """
    start = nearest_passable(passable, place)
    if start is None:
        return 0.0
    return float(np.count_nonzero(np.isfinite(distances(passable, start)) & (room.costs < INSCRIBED))) \
        * room.resolution ** 2


def look(costmap: Costmap, robot: FloatArray, least: float, radius: float = 0.0, corner: float = 0.0,
         known: Optional[Costmap] = None, clearance: float = 0.0) -> View:
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
    corner : float
        Size of the smallest frontier that the robot cannot be beside, but that is in sight of a place where it can be
        [m]; 0: such frontiers do not count.
    known : Costmap, optional
        The map without inflation, for corners: a costmap does not tell which of its inscribed cells were seen.
    clearance : float
        Distance from obstacles at which the robot can drive but not turn [m]; 0: it only drives where it can turn.

    Returns
    -------
    View
    """
    robot, costmap = np.asarray(robot, float)[:2], with_room(costmap, radius)
    passable = with_narrow_ways(costmap, clearance) if clearance > 0.0 else costmap
    nothing = np.full(costmap.shape, np.inf, np.float32)
    cell = costmap.cell(robot[0], robot[1])
    if cell is None:
        far = costmap.origin + costmap.resolution * np.array([costmap.columns, costmap.rows])
        return View(costmap, passable, robot, nothing, [], 0, "the robot at ({:.2f}, {:.2f}) is outside of the map, "
                    "which is x {:.2f} to {:.2f}, y {:.2f} to {:.2f} in {}".format(
                        robot[0], robot[1], costmap.origin[0], far[0], costmap.origin[1], far[1], costmap.frame))
    start = nearest_passable(passable, robot)
    if start is None:
        return View(costmap, passable, robot, nothing, [], 0, "there is no free cell within {:g} m of the robot at "
                    "({:.2f}, {:.2f})".format(NEAR, robot[0], robot[1]))
    distance = distances_with_room(costmap, passable, start)
    groups, count = frontier_kernels.frontier_groups(costmap.costs, distance)
    enough = [part for part in _parts(groups, count) if len(part) * costmap.resolution >= least]
    made = [_frontier(costmap, robot, distance, part, _beside(part, distance)) for part in enough]
    if corner > 0.0:
        made += _corners(costmap, costmap.costs if known is None else aligned(known, costmap), robot, distance, corner,
                         enough, start)
    found = [frontier for frontier in made if frontier is not None]
    return View(costmap, passable, robot, distance, found, count - len(enough))


def _parts(groups: Int32Array, count: int) -> List[IndexArray]:
    """Return the cells of each group."""
    if not count:
        return []
    cells = np.argwhere(groups)
    numbers = groups[cells[:, 0], cells[:, 1]]
    order = np.argsort(numbers, kind="stable")
    return np.split(cells[order], np.searchsorted(numbers[order], np.arange(2, count + 1)))


def aligned(known: Costmap, costmap: Costmap) -> Uint8Array:
    """Return the costs (H, W) of a map at the cells of another one; unknown where it has none.

    Parameters
    ----------
    known, costmap : Costmap
        The map, and the one with the cells; in one frame, not rotated.
    """
    centres = [costmap.origin[axis] + (np.arange(count) + 0.5) * costmap.resolution
               for axis, count in ((1, costmap.rows), (0, costmap.columns))]
    rows, columns = (np.floor((centre - known.origin[axis]) / known.resolution).astype(int)
                     for centre, axis in zip(centres, (1, 0)))
    inside = np.outer((rows >= 0) & (rows < known.rows), (columns >= 0) & (columns < known.columns))
    found = known.costs[np.ix_(np.clip(rows, 0, known.rows - 1), np.clip(columns, 0, known.columns - 1))]
    return np.where(inside, found, np.uint8(NO_INFORMATION))


def _corners(costmap: Costmap, seen: Uint8Array, robot: FloatArray, distance: Float32Array, least: float,
             pursued: List[IndexArray], start: Tuple[int, int]) -> List[Optional[Frontier]]:
    """Return the frontiers at known free space that is too narrow for the robot, but that it can look into.

    Those at the ends of wide frontiers are left: they are seen with these. Some are not narrow: beams without an end
    have cleared their cells in the costmap, and they are only unknown in the map. The robot drives into these.
    """
    near = np.empty(costmap.shape, np.float32)
    distance_transform(seen == LETHAL, SLIT + 1.0, near)
    costs = np.where(near <= SLIT, np.uint8(LETHAL), seen)
    free, _ = wave_kernels.connected(costs, _NOT_LETHAL, start)
    other, count = frontier_kernels.frontier_groups(costs, np.where(free == 1, np.float32(0), np.float32(np.inf)))
    taken = {number for part in pursued for number in other[part[:, 0], part[:, 1]].tolist()}
    reach = CLOSE / costmap.resolution
    around, made = int(math.ceil(reach)) + 1, []
    for part in _parts(other, count):
        if len(part) * costmap.resolution < least or other[tuple(part[0])] in taken:
            continue
        if 2 * np.count_nonzero(np.isfinite(distance[part[:, 0], part[:, 1]])) > len(part):
            made.append(_frontier(costmap, robot, distance, part, _inside(costs, distance, part)))
            continue
        low = np.maximum(part.min(axis=0) - around, 0)
        high = part.max(axis=0) + around + 1
        window = slice(low[0], high[0]), slice(low[1], high[1])
        some = part[::max(1, len(part) // LOOKS)] - low
        counts = frontier_kernels.sight_counts(np.ascontiguousarray(costs[window]), some, reach, RAYS)
        counts[~np.isfinite(distance[window])] = 0
        wide = costmap.costs[window] < WIDE
        if (counts * wide).any():
            counts[~wide] = 0
        if counts.max() >= IN_SIGHT * len(some):
            made.append(_frontier(costmap, robot, distance, part, np.argwhere(2 * counts > counts.max()) + low, True))
    return made


def _inside(costs: Uint8Array, distance: Float32Array, part: IndexArray) -> IndexArray:
    """Return the unknown cells (N, 2) that the robot can reach among those that a frontier goes round, its own too."""
    low, high = part.min(axis=0), part.max(axis=0) + 1
    window = slice(low[0], high[0]), slice(low[1], high[1])
    return np.argwhere((costs[window] == NO_INFORMATION) & np.isfinite(distance[window])) + low


def _beside(cells: IndexArray, distance: Float32Array) -> IndexArray:
    """Return the reachable neighbours (N, 2) of cells."""
    beside = (cells[:, None] + np.array([(0, 1), (0, -1), (1, 0), (-1, 0)])).reshape(-1, 2)
    beside = beside[((beside >= 0) & (beside < np.array(distance.shape))).all(axis=1)]
    return beside[np.isfinite(distance[beside[:, 0], beside[:, 1]])]


def _frontier(costmap: Costmap, robot: FloatArray, distance: Float32Array, cells: IndexArray, views: IndexArray,
              by_path: bool = False) -> Optional[Frontier]:
    """Return a frontier that is looked at from one of some cells: the nearest to it, or that with the shortest path."""
    if not len(views):
        return None
    points = (cells[:, ::-1] + 0.5) * costmap.resolution + costmap.origin
    centre = points.mean(axis=0)
    places = (views[:, ::-1] + 0.5) * costmap.resolution + costmap.origin
    best = int(np.argmin(distance[views[:, 0], views[:, 1]] if by_path else np.square(places - centre).sum(axis=1)))
    row, column = int(views[best, 0]), int(views[best, 1])
    return Frontier(cells, points, centre, places[best], (row, column), len(cells) * costmap.resolution,
                    float(np.sqrt(np.square(points - robot).sum(axis=1).min())), float(distance[row, column]),
                    not by_path)


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
