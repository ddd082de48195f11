# SPDX-License-Identifier: BSD-3-Clause
"""Heightmaps for rays: least and greatest heights of square blocks, for :mod:`m2wr_sim.sensors.height_ray_kernels`."""
from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from m2wr_sim.sensors.height_ray_kernels import SHIFT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.model.types import Heightmap

    Floats = NDArray[np.float64]


class HeightBlocks(NamedTuple):
    """A heightmap as the kernel takes it.

    Attributes
    ----------
    middle : (3,) float64
        Centre of the bounding box, in the frame of the collision [m].
    radius : float
        Radius of the bounding sphere around ``middle`` [m].
    heights, blocks, levels, frame : arrays
        See :mod:`m2wr_sim.sensors.height_ray_kernels`.
    """

    middle: Floats
    radius: float
    heights: Floats
    blocks: Floats
    levels: NDArray[np.int64]
    frame: Floats


def build_blocks(heightmap: Heightmap) -> HeightBlocks:
    """Find the least and greatest heights of blocks of cells, of each size.

    Raises
    ------
    ValueError
        If there are fewer than 2 x 2 heights, or one is not finite.
    """
    heights = np.ascontiguousarray(heightmap.heights, dtype=np.float64)
    if heights.ndim != 2 or min(heights.shape) < 2 or not np.all(np.isfinite(heights)):
        raise ValueError("a heightmap of shape %s: expected at least 2 x 2 finite heights" % (heights.shape,))
    low, high = _reduced(heights, np.minimum), _reduced(heights, np.maximum)
    parts, levels, first = [], [], 0
    while True:
        parts.append(np.stack((low.ravel(), high.ravel()), axis=1))
        levels.append((first, low.shape[0], low.shape[1]))
        first += low.size
        if low.size == 1:
            break
        low, high = _halved(low, np.minimum), _halved(high, np.maximum)
    half = np.array((0.5 * heightmap.size[0], 0.5 * heightmap.size[1], 0.5 * (high[0, 0] - low[0, 0])))
    middle = np.array(heightmap.position, dtype=np.float64) + (0.0, 0.0, 0.5 * (high[0, 0] + low[0, 0]))
    rows, columns = heights.shape
    frame = np.array((-half[0], half[1], -0.5 * (high[0, 0] + low[0, 0]), (columns - 1) / heightmap.size[0],
                      (rows - 1) / heightmap.size[1], half[0], half[1], half[2]))
    return HeightBlocks(middle, float(np.sqrt(half @ half)), heights, np.concatenate(parts),
                        np.array(levels, np.int64), frame)


def _reduced(heights: Floats, better: Any) -> Floats:
    """Return the least or greatest height of blocks of 2 ** SHIFT cells a side; neighbours share samples."""
    for axis in (0, 1):
        starts = np.arange(0, heights.shape[axis] - 1, 1 << SHIFT)
        kept = better.reduceat(heights, starts, axis=axis)
        shared = np.take(heights, starts[1:], axis=axis)
        before = kept[:-1] if axis == 0 else kept[:, :-1]
        better(before, shared, out=before)
        heights = kept
    return heights


def _halved(values: Floats, better: Any) -> Floats:
    """Return the least or greatest value of blocks of 2 ** SHIFT values a side."""
    for axis in (0, 1):
        values = better.reduceat(values, np.arange(0, values.shape[axis], 1 << SHIFT), axis=axis)
    return values


_blocks: "weakref.WeakKeyDictionary[Any, HeightBlocks]" = weakref.WeakKeyDictionary()      # of heightmaps in use


def blocks_of(heightmap: Heightmap) -> HeightBlocks:
    """Return the blocks of a heightmap. They are made at the first use; other threads may call this.

    Raises
    ------
    ValueError
        If there are fewer than 2 x 2 heights, or one is not finite.
    """
    blocks = _blocks.get(heightmap)
    if blocks is None:
        blocks = _blocks[heightmap] = build_blocks(heightmap)
    return blocks


def triangles_of(blocks: HeightBlocks, low: Floats, high: Floats) -> Floats:
    """Return triangles of the cells that overlap a rectangle.

    Parameters
    ----------
    blocks : HeightBlocks
    low, high : (2,) float64
        Corners of the rectangle, x and y relative to ``middle`` [m].

    Returns
    -------
    (M, 9) float64
        First corner and two edges, relative to ``middle`` [m].
    """
    x0, y0, z0, per_x, per_y = blocks.frame[:5]
    rows, columns = blocks.heights.shape
    across, down = ((low[0] - x0) * per_x, (high[0] - x0) * per_x), ((y0 - high[1]) * per_y, (y0 - low[1]) * per_y)
    left, right = np.clip(np.floor(np.add(across, (0.0, 1.0))), 0, columns - 1).astype(int)
    top, bottom = np.clip(np.floor(np.add(down, (0.0, 1.0))), 0, rows - 1).astype(int)
    x, y = x0 + np.arange(left, right + 1) / per_x, y0 - np.arange(top, bottom + 1) / per_y
    points = np.stack(np.broadcast_arrays(x[None, :], y[:, None], blocks.heights[top:bottom + 1, left:right + 1] + z0),
                      axis=2)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    return np.concatenate([np.concatenate((one, two - one, three - one), axis=2).reshape(-1, 9)
                           for one, two, three in ((a, c, b), (b, c, d))])
