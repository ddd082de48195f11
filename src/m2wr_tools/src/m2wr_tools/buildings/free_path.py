# SPDX-License-Identifier: BSD-3-Clause
"""Shortest free paths through a floor plan, on a grid, with as few corners as the clearance allows."""
from __future__ import annotations

from typing import TYPE_CHECKING, List

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray
    from m2wr_tools.buildings.floor_plan import FloorPlan

CELL = 0.15                 # of the grid [m]
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
    """

    def __init__(self, plan: FloorPlan, clearance: float = CLEARANCE) -> None:
        x0, y0, x1, y1 = plan.bounds
        self._origin = np.array([x0, y0])
        self._plan, self._clearance = plan, clearance
        self._shape = int(np.ceil((x1 - x0) / CELL)), int(np.ceil((y1 - y0) / CELL))
        cells = np.stack(np.meshgrid(np.arange(self._shape[0]), np.arange(self._shape[1]), indexing="ij"), axis=-1)
        centres = self._origin + (cells.reshape(-1, 2) + 0.5) * CELL
        self._free = plan.clearance(centres) >= clearance
        self._centres = centres
        self._graph = self._connect()

    def _connect(self) -> coo_matrix:
        numbers = np.arange(len(self._free)).reshape(self._shape)
        free = self._free.reshape(self._shape)
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
        distances = np.hypot(*(self._centres - point).T)
        distances[~self._free] = np.inf
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
        first, last = self._cell(start), self._cell(goal)
        distances, before = dijkstra(self._graph, directed=False, indices=first, return_predecessors=True)
        if not np.isfinite(distances[last]):
            raise NoPathError("no free path from (%.2f, %.2f) to (%.2f, %.2f)" % (*start, *goal))
        cells = [last]
        while cells[-1] != first:
            cells.append(int(before[cells[-1]]))
        return self._shortcut([self._centres[cell] for cell in reversed(cells)])

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
        return bool((self._plan.clearance(np.linspace(start, end, count)) >= self._clearance).all())
