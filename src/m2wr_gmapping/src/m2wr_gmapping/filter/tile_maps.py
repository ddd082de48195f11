# SPDX-License-Identifier: BSD-3-Clause
"""Maps of the particles: copy-on-write tiles in flat storage, in blocks that are shared in the same way."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, Optional, Sequence, Tuple

import numpy as np

from m2wr_gmapping.filter import tile_kernels as kernels

if TYPE_CHECKING:
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray, Int32Array, Uint8Array

CELLS_A_SIDE = 1 << kernels.CELL_TO_BLOCK     # of a block
TILES_A_SIDE = 1 << kernels.BLOCK_SHIFT     # of a block
SPARE = 1                   # blocks on each side of a new table, and beyond a side that it outgrows
FIRST_BLOCKS, FIRST_TILES = 64, 1024
MOST_CELLS = 10**8          # of the map of one particle, as of the published map
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
        Greatest number of cells in the table of one particle; points outside are left out.

    Attributes
    ----------
    table, blocks, mean, hits, frame
        Arrays of ``tile_kernels``.
    beyond : int
        Number of scans that did not fit within the limit.
    """

    def __init__(self, count: int, resolution: float, frozen: int = 64, limit: int = MOST_CELLS) -> None:
        self.resolution, self._frozen, self._limit = resolution, frozen, limit // CELLS_A_SIDE**2
        self.table = np.full((count, 0, 0), -1, np.int32)
        self._corner: Optional[Tuple[int, int]] = None                         # column, row of the table's first block
        self.frame = np.array([0.0, 0.0, 1.0 / resolution])
        self.blocks = np.empty((FIRST_BLOCKS, TILES_A_SIDE, TILES_A_SIDE), np.int32)
        self.mean = np.empty((FIRST_TILES, kernels.CELLS, 2), np.uint8)
        self.hits = np.empty((FIRST_TILES, kernels.CELLS), np.uint8)
        self.beyond = 0
        self._count_holders()

    @property
    def layout(self) -> Tuple[Int32Array, Uint8Array, Uint8Array, FloatArray]:
        """The arrays that all maps share, in the order of the kernels: blocks, mean, hits, frame."""
        return self.blocks, self.mean, self.hits, self.frame

    @property
    def used(self) -> int:
        """Number of tiles that the particles hold."""
        return len(self.mean) - int(self._counters[kernels.TILES])

    def private_tiles(self, particle: int) -> int:
        """Return how many tiles the particles hold beyond those of one particle."""
        held = self.table[particle]
        return self.used - int(np.count_nonzero(self.blocks[held[held >= 0]] >= 0))

    def no_tiles(self) -> BoolArray:
        """Return False for every tile of a table, (8 H, 8 W) bool."""
        _, rows, columns = self.table.shape
        return np.zeros((rows * TILES_A_SIDE, columns * TILES_A_SIDE), bool)

    def _count_holders(self) -> None:
        """Count the holders of all blocks and tiles, and list the unused ones."""
        blocks, tiles = len(self.blocks), len(self.mean)
        self._block_holders, self._free_blocks = np.zeros(blocks, np.int32), np.empty(blocks, np.int32)
        self._holders, self._free = np.zeros(tiles, np.int32), np.empty(tiles, np.int32)
        self._counters = np.empty(2, np.int64)
        kernels.count_holders(self.table, self.blocks, self._block_holders, self._free_blocks, self._holders,
                              self._free, self._counters)

    def _add_storage(self) -> None:
        """Add blocks or tiles, whichever are used up."""
        for height, least, arrays in ((self._counters[kernels.BLOCKS], FIRST_BLOCKS, (self.blocks,)),
                                      (self._counters[kernels.TILES], FIRST_TILES, (self.mean, self.hits))):
            if height > 0:
                continue
            for array in arrays:
                new = len(array) + max(len(array) // 8, least)
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
        x, y, end_x, end_y = needed = self._places(low, high)
        first, last = (x - SPARE, y - SPARE), (end_x + SPARE, end_y + SPARE)
        if self._corner is not None:
            if self._covers(needed):
                return True
            old_x, old_y = self._corner
            rows, columns = self.table.shape[1:]
            first = (old_x if x > old_x else min(first[0] - SPARE, old_x),
                     old_y if y > old_y else min(first[1] - SPARE, old_y))
            last = (old_x + columns if end_x < old_x + columns else max(last[0] + SPARE, old_x + columns),
                    old_y + rows if end_y < old_y + rows else max(last[1] + SPARE, old_y + rows))
        if (last[0] - first[0]) * (last[1] - first[1]) > self._limit:
            self.beyond += 1
            return False
        table = np.full((len(self.table), last[1] - first[1], last[0] - first[0]), -1, np.int32)
        if self._corner is not None:
            at_x, at_y = old_x - first[0], old_y - first[1]
            table[:, at_y:at_y + rows, at_x:at_x + columns] = self.table
        self.table, self._corner = table, first
        self._place()
        return True

    def _places(self, low: Sequence[float], high: Sequence[float]) -> Tuple[int, int, int, int]:
        """Return first column and row of the blocks of a box, and those after the last ones."""
        size = CELLS_A_SIDE * self.resolution
        return (math.floor(low[0] / size), math.floor(low[1] / size),
                math.floor(high[0] / size) + 1, math.floor(high[1] / size) + 1)

    def _covers(self, places: Tuple[int, int, int, int]) -> bool:
        """Return whether the table spans blocks, as of ``_places``, with one to spare on each side."""
        assert self._corner is not None
        x, y, end_x, end_y = places
        (old_x, old_y), (rows, columns) = self._corner, self.table.shape[1:]
        return x > old_x and y > old_y and end_x < old_x + columns and end_y < old_y + rows

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
        fits, count = self.cover(*kernels.bounds(poses, points)), len(poses)
        parts = np.tile([0, points.shape[1]], (count, 1))
        self._register(np.arange(first, first + count), poses, points, parts)
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
            counts, poses = np.array([readings[k].points.shape[1] for k in part]), path[part]
            ends = np.cumsum(counts)
            points = np.concatenate([readings[k].points for k in part], axis=1)
            parts = np.stack([ends - counts, ends], -1)
            corners = np.empty((len(part), 2, 2))
            kernels.bounds_of_scans(poses, points, parts, corners)
            low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
            if self._corner is None or not self._covers(self._places(low, high)):
                for box in corners:             # a scan that exceeds the limit leaves the others their place
                    self.cover(*box)
            self._register(np.zeros(len(part), np.int64), poses, points, parts)

    def _register(self, particles: IndexArray, poses: FloatArray, points: FloatArray, parts: IndexArray) -> None:
        """Call ``register_scans`` until all points are registered."""
        progress = np.zeros(2, np.int64)
        while not kernels.register_scans(particles, poses, points, parts, progress, self.table, self.blocks, self.mean,
                                         self.hits, self._block_holders, self._free_blocks, self._holders, self._free,
                                         self._counters, self.frame, self._frozen):
            self._add_storage()

    def resample(self, ancestors: IndexArray) -> None:
        """Let particles (M,) share the maps of their ancestors."""
        self.table = self.table[ancestors]
        self._count_holders()

    def release(self) -> None:
        """Release the memory of all maps; no scan can be registered any more."""
        self.table = np.full((len(self.table), 0, 0), -1, np.int32)
        self.blocks = np.empty((0, TILES_A_SIDE, TILES_A_SIDE), np.int32)
        self.mean, self.hits = np.empty((0, kernels.CELLS, 2), np.uint8), np.empty((0, kernels.CELLS), np.uint8)
        self._count_holders()

    def clear(self) -> None:
        """Clear all maps."""
        self.table[:] = -1
        self._count_holders()

    # ---- saving

    def compact(self) -> Dict[str, object]:
        """Return the attributes that are stored, with the blocks and tiles in use only and in a new numbering."""
        blocks, block_number = _renumbered(self._block_holders)
        tiles, tile_number = _renumbered(self._holders)
        return dict(table=block_number[self.table], blocks=tile_number[self.blocks[blocks]], mean=self.mean[tiles],
                    hits=self.hits[tiles], beyond=self.beyond, _corner=self._corner)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore what ``compact`` returned; raises ValueError if the table does not fit its limit or corner."""
        self.__dict__.update(stored)            # the arrays must own their memory for resizing
        _, rows, columns = self.table.shape
        empty = not rows * columns
        if rows * columns > self._limit or (self._corner is None) != empty or empty != (not rows and not columns):
            raise ValueError("a table of {} x {} blocks; expected at most {}, and a corner if any".format(
                rows, columns, self._limit))
        if self._corner is not None:
            self._place()
        self._count_holders()


def _renumbered(holders: Int32Array) -> Tuple[IndexArray, Int32Array]:
    """Return the numbers of what is held, and the new number of each; the last one is for -1, and -1."""
    kept = np.flatnonzero(holders)
    number = np.full(len(holders) + 1, -1, np.int32)
    number[kept] = np.arange(len(kept))
    return kept, number
