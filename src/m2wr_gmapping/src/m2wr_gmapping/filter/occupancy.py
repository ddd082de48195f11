# SPDX-License-Identifier: BSD-3-Clause
"""The published map: counts of hits and visits along one path, kept up as the path grows or changes."""
import math
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.filter.occupancy_kernels import CELLS, SIDE, UNKNOWN, add_scan, read_out

PATCH = SIDE            # the grid's size is whole patches of that many cells, and counts are kept by the patch
FIRST_BLOCKS = 64
GROWTH = 10.0           # a side that is crossed moves that far beyond what crossed it [m]
SAME_CELLS, SAME_TURN = 0.3, 0.002      # poses that differ by no more need not be traced anew [cells, rad]


@dataclass(frozen=True)
class Grid:
    """An occupancy grid.

    Attributes
    ----------
    data : (H, W) int8
        -1 unknown, 0 free, 100 occupied; row 0 is the lowest y. Belongs to the reader.
    resolution : float
        Cell size [m].
    origin : (2,) float64
        Centre of cell (0, 0) in ``map`` [m].
    """

    data: np.ndarray
    resolution: float
    origin: np.ndarray


class Occupancy:
    """Counts along one path; only what has changed since the last map is traced again.

    Counts are kept for those patches that beams have crossed, so memory goes with what was seen, not with the extent.

    Parameters
    ----------
    limits : tuple of float
        xmin, ymin, xmax, ymax [m]: the first extent. It grows where scans need it and never shrinks.
    resolution : float
    threshold : float
        A cell is occupied where hits / visits is greater.
    most_cells : int, optional
        The grid does not grow beyond this; beams that leave it are cut off.
    """

    def __init__(self, limits, resolution, threshold, most_cells=100000000):
        self._resolution, self._threshold, self._most_cells = resolution, threshold, most_cells
        xmin, ymin, xmax, ymax = limits
        columns, rows = (max(1, math.ceil(span / resolution) // PATCH) for span in (xmax - xmin, ymax - ymin))
        self._anchor = np.array([xmin, ymin], float)    # a cell's centre that stays: counted and taken out are the same
        self._shift = np.zeros(2, np.int64)             # its column and row
        self._table = np.full((rows, columns), -1, np.int32)
        self._used = np.zeros(1, np.int64)
        self._blocks = dict(hits=np.empty((FIRST_BLOCKS, CELLS), np.int32),
                            visits=np.empty((FIRST_BLOCKS, CELLS), np.int32),
                            values=np.empty((FIRST_BLOCKS, CELLS), np.int8), changed=np.zeros(FIRST_BLOCKS, bool))
        self._poses = np.zeros((0, 3))  # at which each scan has been counted
        self.beyond = False             # whether something did not fit
        self.traced = 0                 # scans added or taken out so far
        self._empty()

    def _empty(self):
        """Forget all counts; the extent stays."""
        self._table[:], self._used[0] = -1, 0
        self._blocks["changed"][:] = False

    def _more_blocks(self, least=1):
        old = len(self._blocks["changed"])
        new = old + max(old // 4, FIRST_BLOCKS, least)
        for array in self._blocks.values():
            array.resize((new,) + array.shape[1:], refcheck=False)      # in place: no second copy at the peak

    def update(self, path, readings, exact=False):
        """Bring the counts to a path (K, 3) with its readings.

        Scans whose pose is as before, or with ``exact`` off hardly another one, are left as they are: the lead passes
        between particles whose paths differ by millimetres. ``readings`` may only have grown since the last call.
        """
        path = np.asarray(path, float)
        known = min(len(self._poses), len(path))
        limit = 0.0 if exact else np.array([SAME_CELLS * self._resolution, SAME_CELLS * self._resolution, SAME_TURN])
        kept = (np.abs(path[:known] - self._poses[:known]) <= limit).all(axis=1)
        changed = np.flatnonzero(~kept)
        if 2 * len(changed) > known:            # cheaper from nothing
            self._empty()
            changed, known = np.zeros(0, int), 0
        for k in changed:
            self._count(self._poses[k], readings[k], -1)
        for k in list(changed) + list(range(known, len(path))):
            self._cover(path[k], readings[k])
            self._count(path[k], readings[k], 1)
        poses = path.copy()
        poses[:known][kept[:known]] = self._poses[:known][kept[:known]]
        self._poses = poses

    def _count(self, pose, reading, sign):
        self.traced += 1
        blocks, done = self._blocks, 0
        while True:
            done = add_scan(pose, reading.rays, reading.ray_hits, done, self._anchor, 1.0 / self._resolution,
                            self._shift, sign, self._table, blocks["hits"], blocks["visits"], blocks["values"],
                            blocks["changed"], self._used)
            if done >= reading.rays.shape[1]:
                return
            self._more_blocks()

    def _cover(self, pose, reading):
        """Grow the grid so that a scan fits, the way the original does."""
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x = pose[0] + c * reading.rays[0] - s * reading.rays[1]
        y = pose[1] + s * reading.rays[0] + c * reading.rays[1]
        low = np.array([min(pose[0], x.min(initial=pose[0])), min(pose[1], y.min(initial=pose[1]))])
        high = np.array([max(pose[0], x.max(initial=pose[0])), max(pose[1], y.max(initial=pose[1]))])
        origin, size = self._origin, np.array(self._table.shape[::-1])
        end = origin + (size * PATCH - 1) * self._resolution
        margin = 0.5 * self._resolution             # cells reach that far around their centres
        if (low >= origin - margin).all() and (high < end + margin).all():
            return
        if not self._fits(low, high):
            self.beyond = True
            return
        cells_before = np.rint((origin - low + GROWTH) / self._resolution)
        cells = np.rint((high + GROWTH - origin) / self._resolution)
        before = np.where(low < origin, np.ceil(cells_before / PATCH), 0).astype(int)
        after = np.where(high > end, np.ceil(cells / PATCH) - size, 0).astype(int)
        new = size + before + after
        table = np.full((new[1], new[0]), -1, np.int32)
        table[before[1]:before[1] + size[1], before[0]:before[0] + size[0]] = self._table
        self._table, self._shift = table, self._shift + before * PATCH

    def _fits(self, low, high):
        """Whether a grid that reaches there as well may be made; in floats, which are not too small for any number."""
        rows, columns = self.bounds
        spans = np.maximum(high + GROWTH, self._origin + self._resolution * np.array([columns, rows])) \
            - np.minimum(low - GROWTH, self._origin)
        with np.errstate(over="ignore"):
            return bool((spans / self._resolution + PATCH).prod() <= self._most_cells)

    def grid(self):
        """Return the map (Grid) of all that was counted."""
        data = np.full(self.bounds, UNKNOWN, np.int8)
        blocks = self._blocks
        read_out(self._threshold, self._table, blocks["hits"], blocks["visits"], blocks["values"], blocks["changed"],
                 self._used, data)
        return Grid(data, self._resolution, self._origin)

    @property
    def _origin(self):
        return self._anchor - self._shift * self._resolution

    @property
    def bounds(self):
        """Rows and columns of the grid."""
        return self._table.shape[0] * PATCH, self._table.shape[1] * PATCH

    # ---- saving

    def compact(self):
        """Return what is stored: only the blocks that are in use."""
        count = int(self._used[0])
        return dict({name: array[:count] for name, array in self._blocks.items()}, _anchor=self._anchor,
                    _shift=self._shift, _table=self._table, _poses=self._poses, beyond=self.beyond, traced=self.traced)

    def restore(self, stored):
        """Take over what ``compact`` returned; raises ValueError where the grid is larger than it may be."""
        stored = dict(stored)
        if stored["_table"].size * CELLS > max(self._most_cells, self._table.size * CELLS) or not stored["_table"].size:
            raise ValueError("a grid of {} x {} patches; expected some, with at most {} cells".format(
                *stored["_table"].shape, self._most_cells))
        self._blocks = {name: stored.pop(name) for name in self._blocks}        # own their memory: resizable
        self._used = np.array([len(self._blocks["changed"])])
        self.__dict__.update(stored)
