# SPDX-License-Identifier: BSD-3-Clause
"""Distances to obstacles on a grid."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Float32Array, Uint8Array


@kernel
def distance_transform(occupied: BoolArray, limit: float, out: Float32Array) -> None:
    """Compute the Euclidean distance of each cell's centre to that of the nearest occupied cell.

    Parameters
    ----------
    occupied : (H, W) bool
    limit : float
        Greatest distance that is told apart [cells]; cells farther away get it.
    out : (H, W) float32
        Written [cells].

    Notes
    -----
    Exact, linear in the number of cells: P. Felzenszwalb, D. Huttenlocher, Distance Transforms of Sampled Functions,
    Theory of Computing 8, 2012. The columns are done by two sweeps, the rows by the lower envelope of parabolas.
    """
    height, width = occupied.shape
    far = limit + 1.0
    for y in range(height):
        for x in range(width):
            above = out[y - 1, x] + 1.0 if y else far
            out[y, x] = 0.0 if occupied[y, x] else min(above, far)
    for y in range(height - 2, -1, -1):
        for x in range(width):
            out[y, x] = min(out[y, x], out[y + 1, x] + 1.0)
    vertex = np.empty(width, np.int64)              # columns whose parabolas form the envelope
    heights = np.empty(width)
    start = np.empty(width + 1)                     # where each of them begins to be the lowest
    for y in range(height):
        count = 0
        for x in range(width):
            here = float(out[y, x])
            if here >= far:
                continue
            raised = here * here + x * x
            begin = -math.inf
            while count:
                before = vertex[count - 1]
                begin = (raised - heights[count - 1]) / (2.0 * (x - before))
                if begin > start[count - 1]:
                    break
                count -= 1
            if not count:
                begin = -math.inf
            vertex[count], heights[count], start[count] = x, raised, begin
            count += 1
        if not count:
            for x in range(width):
                out[y, x] = limit
            continue
        start[count] = math.inf
        at = 0
        for x in range(width):
            while start[at + 1] < x:
                at += 1
            offset = vertex[at]
            squared = heights[at] - offset * offset + (x - offset) * (x - offset)
            out[y, x] = min(math.sqrt(max(0.0, squared)), limit)


@kernel
def visible_surface(occupied: BoolArray, free: BoolArray, right: bool, up: bool, out: BoolArray) -> int:
    """Find the occupied cells in which beams of one quarter of all directions end.

    Parameters
    ----------
    occupied, free : (H, W) bool
    right, up : bool
        Whether the beams lead towards greater x, and greater y.
    out : (H, W) bool
        Written: occupied cells with a free neighbour at one of the two sides from which such beams come.

    Returns
    -------
    int
        Number of these cells.
    """
    height, width = occupied.shape
    count = 0
    for y in range(height):
        before_y = y - 1 if up else y + 1
        for x in range(width):
            before_x = x - 1 if right else x + 1
            seen = occupied[y, x] and ((0 <= before_x < width and free[y, before_x])
                                       or (0 <= before_y < height and free[before_y, x]))
            out[y, x] = seen
            count += seen
    return count


@kernel
def quantise(distance: Float32Array, step: float, out: Uint8Array) -> None:
    """Round distances to whole steps.

    Parameters
    ----------
    distance : (H, W) float32
        [cells]
    step : float
        [cells]
    out : (H, W) uint8
        Written: 0 to 255 steps.
    """
    for y in range(distance.shape[0]):
        for x in range(distance.shape[1]):
            out[y, x] = min(255, int(distance[y, x] / step + 0.5))
