# SPDX-License-Identifier: BSD-3-Clause
"""Shortest free paths through a floor plan, on a grid, with as few corners as the clearance allows."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict, List

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray
    from m2wr_tools.buildings.floor_plan import FloorPlan

CELL = 0.15                 # of the grid [m]
TILE = 40                   # cells along each side of a part of the plan that is looked at alone
CLEARANCE = 0.45            # m2wr's farthest point from its centre of rotation, with its caster: 0.45 m


class NoPathError(RuntimeError):
    """Two places are not connected by free space."""


class FreeSpace:
    """The cells of a floor plan where a disc fits.

    Parameters
    ----------
    plan : FloorPlan
    clearance : float
        Radius of the disc [m].

    Attributes
    ----------
    centres : (C, 2) float64
        Of the cells [m].
    free : (C,) bool
        In which of them the disc fits.
    """

    def __init__(self, plan: FloorPlan, clearance: float = CLEARANCE) -> None:
        x0, y0, x1, y1 = plan.bounds
        self._origin = np.array([x0, y0])
        self._plan, self._clearance = plan, clearance
        self._shape = int(np.ceil((x1 - x0) / CELL)), int(np.ceil((y1 - y0) / CELL))
        cells = np.stack(np.meshgrid(np.arange(self._shape[0]), np.arange(self._shape[1]), indexing="ij"), axis=-1)
        self.centres = self._origin + (cells.reshape(-1, 2) + 0.5) * CELL
        self.free = self._where_free()
        self._graph = self._connect()
        self._trees: Dict[int, IndexArray] = {}     # cell of a goal -> next cell on the way to it (C,), or below 0

    def _where_free(self) -> BoolArray:
        """Return in which cells (C,) the disc fits; tile by tile, against the parts near the tile only."""
        free = np.empty(self._shape, bool)
        centres = self.centres.reshape(*self._shape, 2)
        for column in range(0, self._shape[0], TILE):
            for line in range(0, self._shape[1], TILE):
                tile = np.s_[column:column + TILE, line:line + TILE]
                free[tile] = self._fits(centres[tile].reshape(-1, 2)).reshape(free[tile].shape)
        return free.ravel()

    def _fits(self, points: FloatArray) -> BoolArray:
        """Return at which of some points (K, 2) the disc fits."""
        near = self._plan.near(points.min(axis=0), points.max(axis=0), self._clearance)
        return np.asarray(near.clearance(points) >= self._clearance)

    def _connect(self) -> coo_matrix:
        numbers = np.arange(len(self.free)).reshape(self._shape)
        free = self.free.reshape(self._shape)
        starts, ends, costs = [], [], []
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            one = numbers[:-dx or None, max(0, -dy):numbers.shape[1] - max(0, dy)]
            other = numbers[dx:, max(0, dy):numbers.shape[1] + min(0, dy)]
            both = free.ravel()[one] & free.ravel()[other]
            starts.append(one[both])
            ends.append(other[both])
            costs.append(np.full(int(both.sum()), CELL * np.hypot(dx, dy)))
        return coo_matrix((np.concatenate(costs), (np.concatenate(starts), np.concatenate(ends))),
                          shape=(numbers.size, numbers.size)).tocsr()

    def _cell(self, point: FloatArray) -> int:
        """Return the free cell nearest to a point."""
        distances = np.hypot(*(self.centres - point).T)
        distances[~self.free] = np.inf
        return int(np.argmin(distances))

    def path(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        """Return a free path between the free cells nearest to two points.

        Parameters
        ----------
        start, goal : (2,) float64
            [m]

        Returns
        -------
        (K, 2) float64
            Its corners, from the start on [m].

        Raises
        ------
        NoPathError
        """
        cell, last = self._cell(start), self._cell(goal)
        if last not in self._trees:
            self._trees[last] = dijkstra(self._graph, directed=False, indices=last, return_predecessors=True)[1]
        following, points = self._trees[last], [self.centres[cell]]
        while cell != last:
            cell = int(following[cell])
            if cell < 0:
                raise NoPathError("no free path from (%.2f, %.2f) to (%.2f, %.2f)" % (*start, *goal))
            points.append(self.centres[cell])
        return self._shortcut(points)

    def _shortcut(self, points: List[FloatArray]) -> FloatArray:
        """Leave out corners while the straight line stays free."""
        kept, at = [points[0]], 0
        while at < len(points) - 1:
            step = len(points) - 1 - at
            while step > 1 and not self._is_free(points[at], points[at + step]):
                step = max(1, step // 2)
            at += step
            kept.append(points[at])
        return np.array(kept)

    def _is_free(self, start: FloatArray, end: FloatArray) -> bool:
        count = int(np.ceil(np.hypot(*(end - start)) / (0.5 * CELL))) + 1
        return bool(self._fits(np.linspace(start, end, count)).all())
