"""The published map: counts of hits and visits along one path, kept up as the path grows or changes."""
import math
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.occupancy_kernels import UNKNOWN, add_scan, read_out

PATCH = 32              # the grid's size is whole patches of that many cells
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
        columns = self._patches(math.ceil((xmax - xmin) / resolution))
        rows = self._patches(math.ceil((ymax - ymin) / resolution))
        self._origin = np.array([xmin, ymin], float)
        self._allocate(max(rows, PATCH), max(columns, PATCH))
        self._poses = np.zeros((0, 3))  # at which each scan has been counted
        self.beyond = False             # whether something did not fit
        self.traced = 0                 # scans added or taken out so far

    @staticmethod
    def _patches(cells):
        return cells // PATCH * PATCH

    def _allocate(self, rows, columns):
        self._hits = np.zeros((rows, columns), np.int32)
        self._visits = np.zeros((rows, columns), np.int32)
        self._grid = np.full((rows, columns), UNKNOWN, np.int8)
        self._clean()

    def _clean(self):
        self._dirty = np.array([2**31, -1, 2**31, -1], np.int64)

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
            shape, self._hits, self._visits, self._grid = self._hits.shape, None, None, None
            self._allocate(*shape)                  # not set to 0: pages that were never written stay without memory
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
        add_scan(pose, reading.rays, reading.ray_hits, self._origin, 1.0 / self._resolution, sign, self._hits,
                 self._visits, self._dirty)

    def _cover(self, pose, reading):
        """Grow the grid so that a scan fits, the way the original does."""
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x = pose[0] + c * reading.rays[0] - s * reading.rays[1]
        y = pose[1] + s * reading.rays[0] + c * reading.rays[1]
        low = np.array([min(pose[0], x.min(initial=pose[0])), min(pose[1], y.min(initial=pose[1]))])
        high = np.array([max(pose[0], x.max(initial=pose[0])), max(pose[1], y.max(initial=pose[1]))])
        size = np.array(self._hits.shape[::-1])
        end = self._origin + (size - 1) * self._resolution
        if (low >= self._origin).all() and (high <= end).all():
            return
        step = PATCH * self._resolution
        before = np.where(low < self._origin, np.ceil((self._origin - low + GROWTH) / step), 0).astype(int) * PATCH
        after = np.where(high > end, np.ceil((high + GROWTH - end) / step), 0).astype(int) * PATCH
        new = size + before + after
        if int(new[0]) * int(new[1]) > self._most_cells:
            self.beyond = True
            return
        hits, visits, grid = self._hits, self._visits, self._grid
        dirty = self._dirty
        self._origin = self._origin - before * self._resolution
        self._allocate(new[1], new[0])
        inside = np.s_[before[1]:before[1] + size[1], before[0]:before[0] + size[0]]
        self._hits[inside], self._visits[inside], self._grid[inside] = hits, visits, grid
        if dirty[1] >= 0:
            self._dirty = dirty + np.repeat(before, 2)

    def grid(self):
        """Return the map (Grid) of all that was counted."""
        if self._dirty[1] >= 0:
            read_out(self._hits, self._visits, self._threshold, *self._dirty.tolist(), self._grid)
            self._clean()
        return Grid(self._grid.copy(), self._resolution, self._origin.copy())

    @property
    def bounds(self):
        """Rows and columns of the grid."""
        return self._grid.shape

    # ---- saving

    def __getstate__(self):
        """Only the rectangle of the counts that holds any."""
        rows, columns = (np.flatnonzero(self._visits.any(axis=axis)) for axis in (1, 0))
        box = [0, 0, 0, 0] if not len(rows) else [rows[0], rows[-1] + 1, columns[0], columns[-1] + 1]
        state = dict(self.__dict__, box=[int(edge) for edge in box], shape=self._grid.shape)
        for name in ("_hits", "_visits", "_grid"):
            state[name] = state[name][box[0]:box[1], box[2]:box[3]].copy()
        return state

    def __setstate__(self, state):
        (top, bottom, left, right), shape = state.pop("box"), state.pop("shape")
        self.__dict__.update(state)
        self._allocate(*shape)
        for name in ("_hits", "_visits", "_grid"):
            getattr(self, name)[top:bottom, left:right] = state[name]
        self._dirty = state["_dirty"]
