# SPDX-License-Identifier: BSD-3-Clause
"""Maps of the particles: copy-on-write tiles in flat storage, with an index table for each particle."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, Optional, Sequence, Tuple

import numpy as np

from m2wr_gmapping.filter import tile_kernels as kernels

if TYPE_CHECKING:
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import FloatArray, IndexArray

CELLS_A_SIDE = 1 << kernels.SHIFT
MARGIN = 2                  # margin of spare tiles around the used ones
FIRST_TILES = 1024
NEVER = 256


class TileMaps:
    """Maps of N particles.

    Parameters
    ----------
    count : int
        Particles.
    resolution : float
        Cell size [m].
    frozen : int, optional
        Hits after which the mean of a cell is final, which saves time.
    limit : int, optional
        Greatest number of tiles in the table of one particle; points outside are left out.

    Attributes
    ----------
    table, mean, hits, frame
        Arrays for ``match_kernels``.
    beyond : int
        Number of scans that did not fit within the limit.
    """

    def __init__(self, count: int, resolution: float, frozen: int = 64, limit: int = 150000) -> None:
        self.count, self.resolution, self._frozen, self._limit = count, resolution, frozen, limit
        self.table = np.full((count, 0, 0), -1, np.int32)
        self._corner: Optional[Tuple[int, int]] = None                         # column, row of the table's first tile
        self.frame = np.array([0.0, 0.0, 1.0 / resolution])
        self._counters = np.zeros(1, np.int64)
        self.beyond = 0
        self._allocate(FIRST_TILES)

    def _allocate(self, tiles: int) -> None:
        cells = kernels.CELLS
        self.mean = np.empty((tiles, cells, 2), np.uint8)
        self.hits = np.empty((tiles, cells), np.uint8)
        self._holders = np.zeros(tiles, np.int32)
        self._free = np.arange(tiles - 1, -1, -1, dtype=np.int32)
        self._counters[0] = tiles

    def _more_tiles(self) -> None:
        old = len(self._holders)
        new = old + max(old // 8, FIRST_TILES)
        for name in ("mean", "hits"):
            array = getattr(self, name)
            array.resize((new,) + array.shape[1:], refcheck=False)      # in place, without a second copy
        holders, free = np.zeros(new, np.int32), np.empty(new, np.int32)
        holders[:old] = self._holders
        unused = int(self._counters[0])
        free[:new - old] = np.arange(new - 1, old - 1, -1)
        free[new - old:new - old + unused] = self._free[:unused]
        self._holders, self._free = holders, free
        self._counters[0] = unused + new - old

    @property
    def tiles_in_use(self) -> int:
        """Number of tiles that particles hold."""
        return len(self._holders) - int(self._counters[0])

    def cover(self, low: Tuple[float, float], high: Tuple[float, float]) -> bool:
        """Let the table span a box.

        Parameters
        ----------
        low : (2,) float
            Corners of the box in ``map`` [m].
        high : (2,) float
            Corners of the box in ``map`` [m].

        Returns
        -------
        bool
            False if the limit is exceeded.
        """
        size = CELLS_A_SIDE * self.resolution
        x, y = math.floor(low[0] / size), math.floor(low[1] / size)
        end_x, end_y = math.floor(high[0] / size) + 1, math.floor(high[1] / size) + 1
        first, last = (x - MARGIN, y - MARGIN), (end_x + MARGIN, end_y + MARGIN)
        if self._corner is not None:
            old_x, old_y = self._corner
            rows, columns = self.table.shape[1:]
            if x > old_x and y > old_y and end_x < old_x + columns and end_y < old_y + rows:
                return True
            grow = 4 * MARGIN
            first = (old_x if x > old_x else min(first[0] - grow, old_x),
                     old_y if y > old_y else min(first[1] - grow, old_y))
            last = (old_x + columns if end_x < old_x + columns else max(last[0] + grow, old_x + columns),
                    old_y + rows if end_y < old_y + rows else max(last[1] + grow, old_y + rows))
        if (last[0] - first[0]) * (last[1] - first[1]) > self._limit:
            self.beyond += 1
            return False
        self._grow((last[1] - first[1], last[0] - first[0]), *(
            (0, 0) if self._corner is None else (old_y - first[1], old_x - first[0])))
        self._corner = first
        self._place()
        return True

    def _grow(self, shape: Tuple[int, int], y: int, x: int) -> None:
        """Grow the table to (rows, columns) in place, so that it is not in memory twice; the old one begins at y, x."""
        rows, columns = self.table.shape[1:]
        self.table.resize((self.count, *shape), refcheck=False)
        before, size = self.table.reshape(-1), rows * columns
        for particle in reversed(range(self.count)):        # a table moves to places that are behind all earlier ones
            old = before[particle * size:(particle + 1) * size].reshape(rows, columns).copy()
            self.table[particle] = -1
            self.table[particle, y:y + rows, x:x + columns] = old

    def _place(self) -> None:
        """Set the frame; cell centres are at multiples of the resolution, as in the published map."""
        self.frame[:2] = np.array(self._corner) * (CELLS_A_SIDE * self.resolution) - 0.5 * self.resolution

    def register(self, particle: int, pose: FloatArray, points: FloatArray) -> None:
        """Register end points in the map of one particle; the table must span them.

        Parameters
        ----------
        particle : int
            Index of the particle.
        pose : (3,) float64
            Pose of the laser in ``map`` [m, m, rad].
        points : (2, B) float64
            End points [m, laser frame].
        """
        done = 0
        while True:
            done = kernels.register_points(
                particle, pose, points, done, self.table, self.mean, self.hits, self._holders, self._free,
                self._counters, self.frame, self._frozen)
            if done >= points.shape[1]:
                return
            self._more_tiles()

    def register_path(self, particle: int, path: FloatArray, readings: Sequence[ScanReading]) -> None:
        """Register the end points of readings along a path in the map of one particle.

        Parameters
        ----------
        particle : int
            Index of the particle.
        path : (K, 3) float64
            Poses of the readings in ``map`` [m, m, rad].
        readings : sequence of K ScanReading
            Scans of the path's nodes.
        """
        for k, reading in enumerate(readings):
            points = reading.points
            if points.shape[1]:
                self.cover(*kernels.bounds(path[k:k + 1], points))
                self.register(particle, path[k], points)

    def register_all(self, poses: FloatArray, points: FloatArray) -> bool:
        """Register end points of one scan in the map of every particle.

        Parameters
        ----------
        poses : (N, 3) float64
            Poses x, y [m], theta [rad] in ``map``.
        points : (2, B) float64
            End points [m, laser frame].

        Returns
        -------
        bool
            False if not all fit within the limit.
        """
        if not points.shape[1]:
            return True
        fits, progress = self.cover(*kernels.bounds(poses, points)), np.zeros(2, np.int64)
        while not kernels.register_scans(poses, points, progress, self.table, self.mean, self.hits, self._holders,
                                         self._free, self._counters, self.frame, self._frozen):
            self._more_tiles()
        return fits

    def resample(self, ancestors: IndexArray) -> None:
        """Let each particle share the map of its ancestor, if that is another one."""
        before, after = self.count, len(ancestors)
        if after > before:
            more = np.full((after - before,) + self.table.shape[1:], -1, np.int32)
            self.table = np.concatenate([self.table, more])
        for particle, ancestor in enumerate(ancestors):
            if particle != ancestor:
                kernels.take_over(particle, ancestor, self.table, self._holders, self._free, self._counters)
        for particle in range(after, before):
            self.clear(particle)
        if after < before:
            self.table = self.table[:after].copy()
        self.count = after

    def clear(self, particle: int) -> None:
        """Clear the map of one particle."""
        kernels.drop(particle, self.table, self._holders, self._free, self._counters)

    # ---- saving

    def compact(self) -> Dict[str, object]:
        """Return the attributes that are stored, with the tiles in use only and in a new numbering."""
        kept = np.flatnonzero(self._holders)
        number = np.full(len(self._holders) + 1, -1, np.int32)          # the last entry is for places without a tile
        number[kept] = np.arange(len(kept))
        return dict(table=number[self.table], mean=self.mean[kept], hits=self.hits[kept], beyond=self.beyond,
                    _corner=self._corner)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore what ``compact`` returned; raises ValueError if the table does not fit its limit or corner."""
        self.__dict__.update(stored)            # the arrays must own their memory for resizing
        self.count, rows, columns = self.table.shape
        empty = not rows * columns
        if rows * columns > self._limit or (self._corner is None) != empty or empty != (not rows and not columns):
            raise ValueError("a table of {} x {} tiles; expected at most {}, and a corner if any".format(
                rows, columns, self._limit))
        if self._corner is not None:
            self._place()
        self._holders = np.bincount(self.table[self.table >= 0], minlength=len(self.mean)).astype(np.int32)
        self._free, self._counters = np.zeros(len(self._holders), np.int32), np.zeros(1, np.int64)
