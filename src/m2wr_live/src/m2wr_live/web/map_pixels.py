# SPDX-License-Identifier: BSD-3-Clause
"""Maps and costmaps as pictures."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import Int8Array, Uint8Array

MOST_PIXELS = 1024          # of a map along each side; larger ones are thinned out
OCCUPIED = 65               # least value of an occupied cell, as map_server has it
INSCRIBED, LETHAL = 99, 100     # values of costmap_2d: the robot's circle, or an obstacle, is in the cell
_FREE, _WALL, _UNKNOWN = (250, 250, 245, 200), (30, 30, 30, 235), (0, 0, 0, 0)
# as rviz draws costmaps: from blue to red, then cyan and magenta
_FIRST, _LAST, _INSCRIBED, _LETHAL = (40, 60, 255, 60), (255, 0, 40, 170), (0, 200, 220, 180), (220, 0, 220, 200)


def _thinned(cells: Int8Array) -> Int8Array:
    """Return cells (rows, columns), the greatest of each block where there are too many: a wall stays visible."""
    step = max(1, -(-max(cells.shape) // MOST_PIXELS))
    if step == 1:
        return cells
    rows, columns = (side // step * step for side in cells.shape)
    thinned: Int8Array = cells[:rows, :columns].reshape(rows // step, step, columns // step, step).max(axis=(1, 3))
    return thinned


def map_pixels(cells: Int8Array) -> Uint8Array:
    """Return the picture of a map (rows, columns, 4) uint8, its first row at the map's largest y.

    Parameters
    ----------
    cells : (rows, columns) int8
        0 to 100; negative: unknown.
    """
    cells = _thinned(cells)
    pixels = np.empty(cells.shape + (4,), dtype=np.uint8)
    pixels[:] = _FREE
    pixels[cells >= OCCUPIED] = _WALL
    pixels[cells < 0] = _UNKNOWN
    flipped: Uint8Array = pixels[::-1]
    return flipped


def costmap_pixels(cells: Int8Array) -> Uint8Array:
    """Return the picture of a costmap (rows, columns, 4) uint8; free and unknown cells are transparent.

    Parameters
    ----------
    cells : (rows, columns) int8
        Costs from 0 to 100; negative: unknown.
    """
    cells = _thinned(cells)
    share = np.linspace(0.0, 1.0, INSCRIBED - 1)[:, None]
    table = np.zeros((256, 4), dtype=np.uint8)
    table[1:INSCRIBED] = (1.0 - share) * np.array(_FIRST) + share * np.array(_LAST)
    table[INSCRIBED], table[LETHAL] = _INSCRIBED, _LETHAL
    flipped: Uint8Array = table[cells.view(np.uint8)][::-1]
    return flipped


def pixels_of(topic: str, cells: Int8Array) -> Uint8Array:
    """Return the picture of a map, or of a costmap where the topic's name says so.

    Parameters
    ----------
    topic : str
    cells : (rows, columns) int8
    """
    return costmap_pixels(cells) if "costmap" in topic else map_pixels(cells)
