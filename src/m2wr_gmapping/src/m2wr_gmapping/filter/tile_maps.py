# SPDX-License-Identifier: BSD-3-Clause
"""The particles' maps: copy-on-write tiles in flat storage, one index table a particle."""
import math

import numpy as np

from m2wr_gmapping.filter import tile_kernels as kernels

CELLS_A_SIDE = 1 << kernels.SHIFT
MARGIN = 2                  # tiles kept around what is used
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
        Hits after which a cell's mean is final; a cell seen that often costs nothing any more.
    limit : int, optional
        Most tiles that the table of one particle may span; points beyond are left out.

    Attributes
    ----------
    table, mean, hits, frame
        What the kernels of ``match_kernels`` read.
    beyond : int
        Scans that did not fit within the limit.
    """

    def __init__(self, count, resolution, frozen=64, limit=150000):
        self.count, self.resolution, self._frozen, self._limit = count, resolution, frozen, limit
        self.table = np.full((count, 0, 0), -1, np.int32)
        self._corner = None                         # column, row of the table's first tile on the lattice
        self.frame = np.array([0.0, 0.0, 1.0 / resolution])
        self._counters = np.zeros(1, np.int64)
        self.beyond = 0
        self._allocate(FIRST_TILES)

    def _allocate(self, tiles):
        cells = kernels.CELLS
        self.mean = np.empty((tiles, cells, 2), np.uint16)
        self.hits = np.empty((tiles, cells), np.uint8)
        self._holders = np.zeros(tiles, np.int32)
        self._free = np.arange(tiles - 1, -1, -1, dtype=np.int32)
        self._counters[0] = tiles

    def _more_tiles(self):
        old = len(self._holders)
        new = old + max(old // 8, FIRST_TILES)
        for name in ("mean", "hits"):
            array = getattr(self, name)
            array.resize((new,) + array.shape[1:], refcheck=False)      # in place: no second copy at the peak
        holders, free = np.zeros(new, np.int32), np.empty(new, np.int32)
        holders[:old] = self._holders
        unused = int(self._counters[0])
        free[:new - old] = np.arange(new - 1, old - 1, -1)
        free[new - old:new - old + unused] = self._free[:unused]
        self._holders, self._free = holders, free
        self._counters[0] = unused + new - old

    @property
    def tiles_in_use(self):
        """Number of tiles that some particle holds."""
        return len(self._holders) - int(self._counters[0])

    def cover(self, low, high):
        """Let the table span the box from ``low`` to ``high`` (2,) [m, map frame]; False where the limit forbids it."""
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
        table = np.full((self.count, last[1] - first[1], last[0] - first[0]), -1, np.int32)
        if self._corner is not None:
            x, y = old_x - first[0], old_y - first[1]
            table[:, y:y + rows, x:x + columns] = self.table
        self.table, self._corner = table, first
        self._place()
        return True

    def _place(self):
        """Set the frame: the lattice is the published map's, with cell centres at whole multiples of the resolution."""
        self.frame[:2] = np.array(self._corner) * (CELLS_A_SIDE * self.resolution) - 0.5 * self.resolution

    def register(self, particle, pose, points):
        """Register end points (2, B) of a scan taken at ``pose`` in one particle's map, where the table spans it."""
        done = 0
        while True:
            done = kernels.register_points(
                particle, pose, points, done, self.table, self.mean, self.hits, self._holders, self._free,
                self._counters, self.frame, self._frozen)
            if done >= points.shape[1]:
                return
            self._more_tiles()

    def register_path(self, particle, path, readings):
        """Register the ``points`` (2, B) of readings taken along a path (K, 3) in one particle's map."""
        for k, reading in enumerate(readings):
            points = reading.points
            if points.shape[1]:
                self.cover(*kernels.bounds(path[k:k + 1], points))
                self.register(particle, path[k], points)

    def register_all(self, poses, points):
        """Register end points (2, B) of one scan in the map of every particle, taken at its pose (N, 3).

        Returns False where not all fit within the limit.
        """
        if not points.shape[1]:
            return True
        fits, progress = self.cover(*kernels.bounds(poses, points)), np.zeros(2, np.int64)
        while not kernels.register_scans(poses, points, progress, self.table, self.mean, self.hits, self._holders,
                                         self._free, self._counters, self.frame, self._frozen):
            self._more_tiles()
        return fits

    def resample(self, ancestors):
        """Let each particle whose ancestor is another one share that one's map.

        Parameters
        ----------
        ancestors : (M,) int
            From now on there are M particles; one that is its own ancestor keeps its place.
        """
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

    def clear(self, particle):
        """Empty the map of one particle."""
        kernels.drop(particle, self.table, self._holders, self._free, self._counters)

    # ---- saving

    def compact(self):
        """Return what is stored: the tiles that somebody holds, numbered anew, for their numbers change nothing."""
        kept = np.flatnonzero(self._holders)
        number = np.full(len(self._holders) + 1, -1, np.int32)          # the last one is for places without a tile
        number[kept] = np.arange(len(kept))
        return dict(table=number[self.table], mean=self.mean[kept], hits=self.hits[kept], beyond=self.beyond,
                    _corner=self._corner)

    def restore(self, stored):
        """Take over what ``compact`` returned; raises ValueError where the table does not fit its limit or corner."""
        self.__dict__.update(stored)            # mean and hits own their memory, which _more_tiles resizes
        self.count, rows, columns = self.table.shape
        empty = not rows * columns
        if rows * columns > self._limit or (self._corner is None) != empty or empty != (not rows and not columns):
            raise ValueError("a table of {} x {} tiles; expected at most {}, and a corner if any".format(
                rows, columns, self._limit))
        if self._corner is not None:
            self._place()
        self._holders = np.bincount(self.table[self.table >= 0], minlength=len(self.mean)).astype(np.int32)
        self._free, self._counters = np.zeros(len(self._holders), np.int32), np.zeros(1, np.int64)
