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
TOGETHER = 64               # scans of a path that are registered by one call


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
        self.resolution, self._frozen, self._limit = resolution, frozen, limit
        self.table = np.full((count, 0, 0), -1, np.int32)
        self._corner: Optional[Tuple[int, int]] = None                         # column, row of the table's first tile
        self.frame = np.array([0.0, 0.0, 1.0 / resolution])
        self.mean = np.empty((FIRST_TILES, kernels.CELLS, 2), np.uint8)
        self.hits = np.empty((FIRST_TILES, kernels.CELLS), np.uint8)
        self.beyond = 0
        self._count_holders()

    def _count_holders(self) -> None:
        """Count the particles that hold each tile, and list the unused tiles."""
        tiles = len(self.mean)
        self._holders, self._free = np.zeros(tiles, np.int32), np.empty(tiles, np.int32)
        self._counters = np.array([kernels.count_holders(self.table, self._holders, self._free)])

    def _more_tiles(self) -> None:
        old = len(self.mean)
        new = old + max(old // 8, FIRST_TILES)
        for array in (self.mean, self.hits):
            array.resize((new,) + array.shape[1:], refcheck=False)      # in place, without a second copy
        self._count_holders()

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
        x, y, end_x, end_y = tiles = self._tiles(low, high)
        first, last = (x - MARGIN, y - MARGIN), (end_x + MARGIN, end_y + MARGIN)
        if self._corner is not None:
            if self._covers(tiles):
                return True
            old_x, old_y = self._corner
            rows, columns = self.table.shape[1:]
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

    def _tiles(self, low: Sequence[float], high: Sequence[float]) -> Tuple[int, int, int, int]:
        """Return first column and row of the tiles of a box, and those after the last ones."""
        size = CELLS_A_SIDE * self.resolution
        return (math.floor(low[0] / size), math.floor(low[1] / size),
                math.floor(high[0] / size) + 1, math.floor(high[1] / size) + 1)

    def _covers(self, tiles: Tuple[int, int, int, int]) -> bool:
        """Return whether the table spans tiles, as of ``_tiles``, with a margin."""
        assert self._corner is not None
        x, y, end_x, end_y = tiles
        (old_x, old_y), (rows, columns) = self._corner, self.table.shape[1:]
        return x > old_x and y > old_y and end_x < old_x + columns and end_y < old_y + rows

    def _grow(self, shape: Tuple[int, int], y: int, x: int) -> None:
        """Grow the table to (rows, columns) in place, so that it is not in memory twice; the old one begins at y, x."""
        rows, columns = self.table.shape[1:]
        self.table.resize((len(self.table), *shape), refcheck=False)
        before, size = self.table.reshape(-1), rows * columns
        for particle in reversed(range(len(self.table))):       # a table moves behind all earlier ones
            old = before[particle * size:(particle + 1) * size].reshape(rows, columns).copy()
            self.table[particle] = -1
            self.table[particle, y:y + rows, x:x + columns] = old

    def _place(self) -> None:
        """Set the frame; cell centres are at multiples of the resolution, as in the published map."""
        self.frame[:2] = np.array(self._corner) * (CELLS_A_SIDE * self.resolution) - 0.5 * self.resolution

    def register(self, poses: FloatArray, points: FloatArray, first: int = 0) -> bool:
        """Register end points of one scan in the maps of some particles.

        Parameters
        ----------
        poses : (N, 3) float64
            Poses of the laser in ``map``, one for each particle [m, m, rad].
        points : (2, B) float64
            End points [m, laser frame].
        first : int
            The first of these particles.

        Returns
        -------
        bool
            False if not all fit within the limit.
        """
        if not points.shape[1]:
            return True
        fits, progress = self.cover(*kernels.bounds(poses, points)), np.zeros(2, np.int64)
        while not kernels.register_scans(first, poses, points, progress, self.table, self.mean, self.hits,
                                         self._holders, self._free, self._counters, self.frame, self._frozen):
            self._more_tiles()
        return fits

    def register_path(self, path: FloatArray, readings: Sequence[ScanReading]) -> None:
        """Register the end points of readings along a path in the map of the first particle.

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the readings in ``map`` [m, m, rad].
        readings : sequence of K ScanReading
            Scans of the path's nodes.
        """
        used = [k for k, reading in enumerate(readings) if reading.points.shape[1]]
        for first in range(0, len(used), TOGETHER):
            part = used[first:first + TOGETHER]
            ends, poses = np.cumsum([readings[k].points.shape[1] for k in part]), path[part]
            points = np.concatenate([readings[k].points for k in part], axis=1)
            corners, progress = np.empty((len(part), 2, 2)), np.zeros(2, np.int64)
            kernels.bounds_of_scans(poses, points, ends, corners)
            low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
            if self._corner is None or not self._covers(self._tiles(low, high)):
                for box in corners:             # a scan that exceeds the limit leaves the others their place
                    self.cover(*box)
            while not kernels.register_path(poses, points, ends, progress, self.table, self.mean, self.hits,
                                            self._holders, self._free, self._counters, self.frame, self._frozen):
                self._more_tiles()

    def resample(self, ancestors: IndexArray) -> None:
        """Let particles (M,) share the maps of their ancestors."""
        if len(ancestors) == len(self.table) and (ancestors[ancestors] == ancestors).all():
            for particle in np.flatnonzero(ancestors != np.arange(len(ancestors))):
                self.table[particle] = self.table[ancestors[particle]]
        else:                           # the tables are in memory twice
            self.table = self.table[ancestors]
        self._count_holders()

    def release(self) -> None:
        """Release the memory of all maps; no scan can be registered any more."""
        self.table = np.full((len(self.table), 0, 0), -1, np.int32)
        self.mean, self.hits = np.empty((0, kernels.CELLS, 2), np.uint8), np.empty((0, kernels.CELLS), np.uint8)
        self._count_holders()

    def clear(self) -> None:
        """Clear all maps."""
        self.table[:] = -1
        self._count_holders()

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
        _, rows, columns = self.table.shape
        empty = not rows * columns
        if rows * columns > self._limit or (self._corner is None) != empty or empty != (not rows and not columns):
            raise ValueError("a table of {} x {} tiles; expected at most {}, and a corner if any".format(
                rows, columns, self._limit))
        if self._corner is not None:
            self._place()
        self._count_holders()
