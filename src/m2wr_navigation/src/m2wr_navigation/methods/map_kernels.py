# SPDX-License-Identifier: BSD-3-Clause
"""Grids of a local map."""
from __future__ import annotations

from typing import TYPE_CHECKING, Tuple

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, Uint8Array


@kernel
def shade(distance: Float32Array, limit: float, out: Uint8Array) -> None:
    """Write 255 where the distance is 0, and 0 where it is ``limit`` or more, for blocks of 2 x 2 cells.

    Parameters
    ----------
    distance : (2 H, 2 W) float32
        [m]
    limit : float
        [m]
    out : (H, W) uint8
        Written: of the mean of the distances of each block.
    """
    scale = 0.25 * 255.0 / limit
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            r, c = 2 * row, 2 * column
            around = distance[r, c] + distance[r, c + 1] + distance[r + 1, c] + distance[r + 1, c + 1]
            out[row, column] = 255 - int(min(scale * around, 255.0))


@kernel
def border_target(shades: Uint8Array, row: float, column: float) -> Tuple[int, int]:
    """Return the cell of a place, or for a place outside the free cell of the border that is nearest to it.

    Parameters
    ----------
    shades : (H, W) uint8
        0: far from all obstacles.
    row, column : float
        Of the place, in cells; the first cell reaches from 0 to 1.
    """
    rows, columns = shades.shape
    if 0.0 <= row < rows and 0.0 <= column < columns:
        return int(row), int(column)
    best, least = (0, 0), 1e18
    for r in range(rows):
        for c in range(0, columns, 1 if r == 0 or r == rows - 1 else columns - 1):
            apart = (r + 0.5 - row) ** 2 + (c + 0.5 - column) ** 2
            apart += 1e12 if shades[r, c] else 0.0
            if apart < least:
                best, least = (r, c), apart
    return best
