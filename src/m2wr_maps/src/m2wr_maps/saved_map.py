# SPDX-License-Identifier: BSD-3-Clause
"""An occupancy grid: free, occupied and unknown cells, and where they are."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int8Array


@dataclass(frozen=True)
class SavedMap:
    """An occupancy grid, read from files or to be written.

    Attributes
    ----------
    data : (H, W) int8
        -1 unknown, 0 free, 100 occupied; row 0 is the lowest y.
    resolution : float
        Cell size [m].
    origin : (2,) float
        Centre of cell (0, 0) in ``map`` [m].
    name : str
        For messages.
    """

    data: Int8Array
    resolution: float
    origin: FloatArray
    name: str = ""

    def walls(self) -> FloatArray:
        """Return the centres (2, M) of the occupied cells in ``map`` [m]."""
        rows, columns = np.nonzero(self.data == 100)
        return np.stack([self.origin[0] + self.resolution * columns, self.origin[1] + self.resolution * rows])
