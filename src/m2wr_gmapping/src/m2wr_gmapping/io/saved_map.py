# SPDX-License-Identifier: BSD-3-Clause
"""A saved map on which a new run starts."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping.filter.occupancy import PATCH, Occupancy
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.scan import ScanReading

if TYPE_CHECKING:
    from m2wr_maps.saved_map import SavedMap
    from m2wr_node.array_types import FloatArray

SURE_VISITS = 3         # visits of a saved cell; few, so that changes are mapped


class MapReading(ScanReading):
    """A saved map as a reading: its walls are end points, seen from the map's origin.

    It has no beams to match, and no rays that clear space.

    Parameters
    ----------
    points : (2, M) float64
        Centres of the occupied cells in ``map`` [m].
    """

    def __init__(self, points: FloatArray) -> None:
        self.points = points
        self._beams = np.empty((mk.BEAM_ROWS, 0))
        self.rays, self.ray_hits = np.empty((2, 0), np.float32), np.zeros(0, bool)


class SavedMapOccupancy(Occupancy):
    """The published map, with a saved map as initial counts.

    Parameters
    ----------
    saved : SavedMap
    threshold : float
        A cell is occupied where hits / visits is greater.
    """

    def __init__(self, saved: SavedMap, threshold: float) -> None:
        self._given = saved
        rows, columns = (math.ceil(cells / PATCH) * PATCH for cells in saved.data.shape)
        x, y = saved.origin
        # a thousandth of a cell more, so that rounding does not remove a patch
        reach = saved.resolution * np.array([columns + 1e-3, rows + 1e-3])
        super().__init__((x, y, x + reach[0], y + reach[1]), saved.resolution, threshold)

    @property
    def saved(self) -> SavedMap:
        """The saved map."""
        return self._given

    def _empty(self) -> None:
        super()._empty()
        saved = self._given
        height, width = (math.ceil(cells / PATCH) for cells in saved.data.shape)
        whole = np.full((height * PATCH, width * PATCH), -1, np.int8)
        whole[:saved.data.shape[0], :saved.data.shape[1]] = saved.data
        patches = whole.reshape(height, PATCH, width, PATCH).transpose(0, 2, 1, 3).reshape(height, width, -1)
        rows, columns = np.nonzero((patches >= 0).any(axis=2))
        known, count = patches[rows, columns], len(rows)
        if count > len(self._blocks["changed"]):
            self._more_blocks(count)
        column, row = self._shift // PATCH          # first patch of the saved map
        self._table[row + rows, column + columns] = np.arange(count)
        self._used[0], blocks = count, self._blocks
        blocks["visits"][:count] = SURE_VISITS * (known >= 0)
        blocks["hits"][:count] = SURE_VISITS * (known == 100)
        blocks["changed"][:count] = True
