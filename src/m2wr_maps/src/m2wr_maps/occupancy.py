# SPDX-License-Identifier: BSD-3-Clause
"""Occupancy grid of one path, updated as the path grows or changes."""
from __future__ import annotations

import copy
import math
from typing import TYPE_CHECKING, Any, Dict, Optional, Protocol, Sequence, Tuple

import numpy as np

from m2wr_maps.occupancy_kernels import CELLS, HITS, OCCUPIED, SIDE, UNKNOWN, VISITS, add_scan, read_out
from m2wr_maps.saved_map import SavedMap

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import BoolArray, CountArray, Float32Array, FloatArray, Int8Array

PATCH = SIDE            # width of a patch [cells]; the grid consists of whole patches
FIRST_BLOCKS = 64
STRIP = 16              # rows of patches that are drawn at a time [patches]
SURE_VISITS = 3         # visits of a saved cell; few, so that changes are mapped
GROWTH = 10.0           # a crossed side moves this far beyond the end point [m]


class Scan(Protocol):
    """What is counted of a scan."""

    @property
    def rays(self) -> Float32Array:
        """Ends (2, S) of the beams that clear space [m, laser frame]."""

    @property
    def ray_hits(self) -> BoolArray:
        """Whether each of them (S,) marks its end as occupied."""


class Occupancy:
    """Hit and visit counts along one path; only changed scans are traced again.

    Counts are stored for the patches that beams have crossed, so memory depends on the observed area, not on the
    extent.

    Parameters
    ----------
    limits : (4,) float
        xmin, ymin, xmax, ymax [m]: the initial extent. It grows with the scans and never shrinks.
    resolution : float
    threshold : float
        A cell is occupied if hits / visits is greater.
    most_cells : int, optional
        Greatest size of the grid; beams that leave it are cut.
    ground : SavedMap, optional
        Its cells have initial counts.
    """

    def __init__(self, limits: Sequence[float], resolution: float, threshold: float,
                 most_cells: int = 100000000, ground: Optional[SavedMap] = None) -> None:
        self.ground = ground
        self._resolution, self._threshold, self._most_cells = resolution, threshold, most_cells
        xmin, ymin, xmax, ymax = limits
        columns, rows = (max(1, math.ceil(span / resolution) // PATCH) for span in (xmax - xmin, ymax - ymin))
        # a fixed cell centre, so that counts are added and removed at the same cells
        self._anchor = np.array([xmin, ymin], float)
        self._shift = np.zeros(2, np.int64)             # its column and row
        self._table = np.full((rows, columns), -1, np.int32)
        self._used = np.zeros(2, np.int64)              # blocks, greatest number of visits
        self._counts: CountArray = np.empty((FIRST_BLOCKS, CELLS, 2), np.uint16)
        self._poses = np.zeros((0, 3))  # poses at which the scans were counted
        self.beyond = False             # whether a scan did not fit
        self.traced = 0                 # number of scans added or removed so far
        self._empty()

    @classmethod
    def on(cls, ground: SavedMap, threshold: float) -> Occupancy:
        """Return a grid that begins with a saved map, and with its extent.

        Parameters
        ----------
        ground : SavedMap
        threshold : float
            See the class.
        """
        rows, columns = ground.data.shape
        x, y = ground.origin
        # whole patches, and a thousandth of a cell more, so that rounding does not remove one
        reach = ground.resolution * (PATCH * np.ceil(np.array([columns, rows]) / PATCH) + 1e-3)
        return cls((x, y, x + reach[0], y + reach[1]), ground.resolution, threshold, ground=ground)

    def _empty(self) -> None:
        """Set all counts to those of the saved map, or to zero; the extent stays."""
        self._table[:], self._used[:] = -1, 0
        if self.ground is not None:
            self._write(self.ground.data)

    def _write(self, data: Int8Array) -> None:
        """Set the empty counts to those of the saved map."""
        whole = np.pad(data, [(0, -cells % PATCH) for cells in data.shape], constant_values=UNKNOWN)
        height, width = whole.shape[0] // PATCH, whole.shape[1] // PATCH
        patches = whole.reshape(height, PATCH, width, PATCH).swapaxes(1, 2).reshape(height, width, CELLS)
        rows, columns = np.nonzero((patches != UNKNOWN).any(axis=2))
        known, count = patches[rows, columns], len(rows)
        if count > len(self._counts):
            self._more_blocks(count)
        column, row = self._shift // PATCH          # first patch of the saved map
        self._table[row + rows, column + columns] = np.arange(count)
        self._used[0] = count
        self._counts[:count, :, HITS] = SURE_VISITS * (known == OCCUPIED)
        self._counts[:count, :, VISITS] = SURE_VISITS * (known != UNKNOWN)

    def _more_blocks(self, least: int = 1) -> None:
        old = len(self._counts)
        # in place, without a second copy
        self._counts.resize((old + max(old // 4, FIRST_BLOCKS, least), CELLS, 2), refcheck=False)

    def use_large_counts(self) -> None:
        """Use counts of four bytes instead of two; few maps need them. Each beam adds one to its first cell."""
        self._counts = self._counts.astype(np.uint32)

    def update(self, path: ArrayLike, readings: Sequence[Scan], same: ArrayLike = 0.0) -> None:
        """Update the counts to a path and its readings.

        Scans with an unchanged pose are not traced again, nor those with a change that counts as none.
        ``readings`` may only grow between calls.

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the laser in ``map`` [m, m, rad].
        readings : sequence of K Scan
            Scans of the path's nodes.
        same : (3,) float, optional
            Greatest change of a pose that counts as none [m, m, rad].
        """
        nodes = np.asarray(path, float)
        known = min(len(self._poses), len(nodes))
        kept = (np.abs(nodes[:known] - self._poses[:known]) <= same).all(axis=1)
        changed = np.flatnonzero(~kept)
        if 2 * len(changed) > known:            # faster to start from an empty map
            self._empty()
            changed, known = np.zeros(0, int), 0
        for k in changed:
            self._count(self._poses[k], readings[k], -1)
        for k in list(changed) + list(range(known, len(nodes))):
            self._cover(nodes[k], readings[k])
            self._count(nodes[k], readings[k], 1)
        poses = nodes.copy()
        poses[:known][kept[:known]] = self._poses[:known][kept[:known]]
        self._poses = poses

    def _count(self, pose: FloatArray, reading: Scan, sign: int) -> None:
        self.traced += 1
        done = 0
        while True:
            limit = int(np.iinfo(self._counts.dtype).max)
            done = add_scan(pose, reading.rays, reading.ray_hits, done, self._anchor, 1.0 / self._resolution,
                            self._shift, sign, limit, self._table, self._counts, self._used)
            if self._used[1] >= limit:
                self.use_large_counts()
            elif done < reading.rays.shape[1]:
                self._more_blocks()
            if done >= reading.rays.shape[1]:
                return

    def _cover(self, pose: FloatArray, reading: Scan) -> None:
        """Grow the grid so that a scan fits, in the same steps as gmapping."""
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x = pose[0] + c * reading.rays[0] - s * reading.rays[1]
        y = pose[1] + s * reading.rays[0] + c * reading.rays[1]
        low = np.array([min(pose[0], x.min(initial=pose[0])), min(pose[1], y.min(initial=pose[1]))])
        high = np.array([max(pose[0], x.max(initial=pose[0])), max(pose[1], y.max(initial=pose[1]))])
        origin, size = self._origin, np.array(self._table.shape[::-1])
        end = origin + (size * PATCH - 1) * self._resolution
        margin = 0.5 * self._resolution             # half a cell around the centres
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

    def _fits(self, low: FloatArray, high: FloatArray) -> bool:
        """Whether the grid may grow to these corners; computed in floats, which do not overflow."""
        rows, columns = self.bounds
        spans = np.maximum(high + GROWTH, self._origin + self._resolution * np.array([columns, rows])) \
            - np.minimum(low - GROWTH, self._origin)
        with np.errstate(over="ignore"):
            return bool((spans / self._resolution + PATCH).prod() <= self._most_cells)

    def grid(self) -> SavedMap:
        """Return the map of all counts."""
        data = np.full(self.bounds, UNKNOWN, np.int8)
        read_out(self._threshold, self._table, self._counts, data)
        return SavedMap(data, self._resolution, self._origin)

    def draw(self, path: ArrayLike, readings: Sequence[Scan]) -> SavedMap:
        """Return the map of a path as ``update`` and ``grid`` would, without keeping counts.

        It is drawn strip by strip, so little memory is needed besides the map itself. On a saved map counts are kept.

        Parameters
        ----------
        path, readings
            As for ``update``.
        """
        if self.ground is not None:
            self.update(path, readings)
            return self.grid()
        nodes = np.asarray(path, float)
        for pose, reading in zip(nodes, readings):
            self._cover(pose, reading)
        data = np.full(self.bounds, UNKNOWN, np.int8)
        for first in range(0, len(self._table), STRIP):
            strip = self._strip(first)
            for pose, reading in zip(nodes, readings):
                strip._count(pose, reading, 1)
            read_out(self._threshold, strip._table, strip._counts, data[first * PATCH:(first + STRIP) * PATCH])
        return SavedMap(data, self._resolution, self._origin)

    def _strip(self, first: int) -> Occupancy:
        """Return empty counts of the rows of patches from ``first`` on, at the same cells."""
        strip = copy.copy(self)
        strip._table = np.full_like(self._table[first:first + STRIP], -1)
        strip._shift = self._shift - [0, first * PATCH]
        strip._counts, strip._used = np.empty((FIRST_BLOCKS, CELLS, 2), np.uint16), np.zeros(2, np.int64)
        return strip

    @property
    def _origin(self) -> FloatArray:
        return self._anchor - self._shift * self._resolution

    @property
    def bounds(self) -> Tuple[int, int]:
        """Rows and columns of the grid."""
        return self._table.shape[0] * PATCH, self._table.shape[1] * PATCH

    # ---- saving

    def compact(self) -> Dict[str, object]:
        """Return the attributes that are stored, with the blocks in use only."""
        return dict(vars(self), _counts=self._counts[:self._used[0]].astype(np.int32))

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore what ``compact`` returned; raises ValueError if the grid is too large."""
        if stored["_table"].size * CELLS > max(self._most_cells, self._table.size * CELLS) or not stored["_table"].size:
            raise ValueError("a grid of {} x {} patches; expected some, with at most {} cells".format(
                *stored["_table"].shape, self._most_cells))
        self.__dict__.update(stored)
        self._used = np.array([len(self._counts), self._counts[..., VISITS].max(initial=0)])
        is_small = self._used[1] < np.iinfo(np.uint16).max      # copies own their memory: resizable
        self._counts = self._counts.astype(np.uint16) if is_small else self._counts.astype(np.uint32)
