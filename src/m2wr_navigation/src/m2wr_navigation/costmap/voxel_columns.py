# SPDX-License-Identifier: BSD-3-Clause
"""Cells of a VoxelGrid: one number a column, sixteen bits for what is known and sixteen for what is marked."""
from __future__ import annotations

from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

MOST_HEIGHTS = 16
MOST_COLUMNS = 4000000
Size = Tuple[int, int, int]


class VoxelError(ValueError):
    """A grid that cannot be read; the message says what was expected."""


def centres(columns: Sequence[int], size: Size, origin: Sequence[float],
            resolutions: Sequence[float]) -> Tuple[FloatArray, FloatArray]:
    """Return the centres of the marked and of the unknown cells.

    Parameters
    ----------
    columns : sequence of int
        One for each column, row by row: bit z says that cell z is not known to be free, bit 16 + z that it is marked.
    size : (int, int, int)
        Cells along x, y and z.
    origin : (3,) sequence of float
        Corner of the first cell [m].
    resolutions : (3,) sequence of float
        Sides of a cell [m].

    Returns
    -------
    marked, unknown : (N, 3) float64, (M, 3) float64
        [m]

    Raises
    ------
    VoxelError
        If the size does not fit the columns, or a number is not finite.
    """
    width, depth, height = size
    if len(columns) != width * depth or len(columns) > MOST_COLUMNS or not 1 <= height <= MOST_HEIGHTS:
        raise VoxelError("{} columns of {} cells for a size of {} x {}; expected as many as the size has, at most {}, "
                         "and 1 to {} cells".format(len(columns), height, width, depth, MOST_COLUMNS, MOST_HEIGHTS))
    corner, sides = np.asarray(origin, float), np.asarray(resolutions, float)
    if not (np.isfinite(corner).all() and np.isfinite(sides).all() and (sides > 0.0).all()):
        raise VoxelError("origin {}, resolutions {}; expected finite numbers, resolutions above 0".format(
            corner.tolist(), sides.tolist()))
    bits = np.asarray(columns, np.uint32).reshape(depth, width)[None]
    heights = np.arange(height, dtype=np.uint32)[:, None, None]
    known_full, marked = (bits >> heights) & 1 == 1, (bits >> (heights + np.uint32(16))) & 1 == 1
    found = []
    for cells in (known_full & marked, known_full ^ marked):
        z, y, x = np.nonzero(cells)
        found.append(corner + (np.stack([x, y, z], -1) + 0.5) * sides)
    return found[0], found[1]
