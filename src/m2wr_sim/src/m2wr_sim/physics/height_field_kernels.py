# SPDX-License-Identifier: BSD-3-Clause
"""The ground of a heightmap: its frame, its heights at places, and which of its cells are near a shape."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Tuple

import numpy as np

try:
    from numba import njit
except ImportError:         # the engine without numba uses the same functions, slowly
    def njit(**_: Any) -> Callable[[Any], Any]:
        return lambda function: function

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

SHIFT = 3                   # blocks of the first level of the greatest heights are 2 ** SHIFT cells a side
FEW_CELLS = 40              # up to so many, looking at the samples themselves takes no longer


@njit(cache=True, nogil=True, error_model="numpy")
def tops_size(rows: int, columns: int) -> int:
    """Return how many numbers :func:`tops_of` gives for a heightmap.

    Parameters
    ----------
    rows, columns : int
        Its samples.

    Returns
    -------
    int
    """
    down, across = ((rows - 2) >> SHIFT) + 1, ((columns - 2) >> SHIFT) + 1
    size = down * across
    while down * across > 1:
        down, across = (down + 1) >> 1, (across + 1) >> 1
        size += down * across
    return size


@njit(cache=True, nogil=True, error_model="numpy")
def tops_of(heights: Values) -> Values:
    """Return the greatest heights of blocks of cells, level after level.

    The blocks of the first level are 8 x 8 cells, those of each further one twice as large a side; the last is one.

    Parameters
    ----------
    heights : (rows, columns) float64

    Returns
    -------
    (n,) float64
        Each level row by row.
    """
    rows, columns = heights.shape[0] - 1, heights.shape[1] - 1
    tops = np.full(tops_size(rows + 1, columns + 1), -math.inf)
    down, across = ((rows - 1) >> SHIFT) + 1, ((columns - 1) >> SHIFT) + 1
    for row in range(down):
        for i in range(row << SHIFT, min(rows, (row + 1) << SHIFT) + 1):
            for column in range(across):
                greatest = tops[row * across + column]
                for j in range(column << SHIFT, min(columns, (column + 1) << SHIFT) + 1):
                    greatest = max(greatest, heights[i, j])
                tops[row * across + column] = greatest
    below, at = 0, down * across
    while down * across > 1:
        wide, narrow = across, (across + 1) >> 1
        for row in range(down):
            for column in range(wide):
                place = at + (row >> 1) * narrow + (column >> 1)
                tops[place] = max(tops[place], tops[below + row * wide + column])
        down, across, below = (down + 1) >> 1, narrow, at
        at += down * across
    return tops


@njit(cache=True, nogil=True, error_model="numpy")
def greatest_in(heights: Values, tops: Values, window: NDArray[np.int64]) -> float:
    """Return a height that no sample of some cells exceeds [m]; for few cells it is the greatest of them.

    Parameters
    ----------
    heights : (rows, columns) float64
        [m]
    tops : (n,) float64
        From :func:`tops_of` [m].
    window : (4,) int64
        First and last row and column of the cells.
    """
    greatest = -math.inf
    if (window[1] - window[0] + 1) * (window[3] - window[2] + 1) <= FEW_CELLS:
        for row in range(window[0], window[1] + 2):
            for column in range(window[2], window[3] + 2):
                greatest = max(greatest, heights[row, column])
        return greatest
    shift, at = SHIFT, 0
    down, across = ((heights.shape[0] - 2) >> SHIFT) + 1, ((heights.shape[1] - 2) >> SHIFT) + 1
    while (window[1] >> shift) - (window[0] >> shift) > 2 or (window[3] >> shift) - (window[2] >> shift) > 2:
        at += down * across
        down, across, shift = (down + 1) >> 1, (across + 1) >> 1, shift + 1
    for row in range(window[0] >> shift, (window[1] >> shift) + 1):
        for column in range(window[2] >> shift, (window[3] >> shift) + 1):
            greatest = max(greatest, tops[at + row * across + column])
    return greatest


@njit(cache=True, nogil=True, error_model="numpy")
def turn(pose: Values, x: float, y: float, z: float, sign: float) -> Tuple[float, float, float]:
    """Rotate a vector by the quaternion of a pose, or back.

    Parameters
    ----------
    pose : (7,) float64
        Position, which is not used, and quaternion x, y, z, w.
    x, y, z : float
    sign : float
        1, or -1 to rotate back.

    Returns
    -------
    (float, float, float)
    """
    qx, qy, qz, w = sign * pose[3], sign * pose[4], sign * pose[5], pose[6]
    tx, ty, tz = 2.0 * (qy * z - qz * y), 2.0 * (qz * x - qx * z), 2.0 * (qx * y - qy * x)
    return x + w * tx + qy * tz - qz * ty, y + w * ty + qz * tx - qx * tz, z + w * tz + qx * ty - qy * tx


@njit(cache=True, nogil=True, error_model="numpy")
def into(field: Values, pose: Values, centre: Values, axes: Values) -> None:
    """Write centre and axes, one a row, of a shape in the frame of a heightmap.

    libode's heightmaps have y up and z against the y of the frame used here.

    Parameters
    ----------
    field, pose : (7,) float64
        Of the heightmap and of the shape in the world: position [m], quaternion x, y, z, w.
    centre : (3,) float64
        Written [m].
    axes : (3, 3) float64
        Written.
    """
    x, y, z = turn(field, pose[0] - field[0], pose[1] - field[1], pose[2] - field[2], -1.0)
    centre[0], centre[1], centre[2] = x, -z, y
    for axis in range(3):
        ux, uy, uz = turn(pose, 1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0, 1.0)
        x, y, z = turn(field, ux, uy, uz, -1.0)
        axes[axis, 0], axes[axis, 1], axes[axis, 2] = x, -z, y


@njit(cache=True, nogil=True, error_model="numpy")
def add(out: Values, count: int, position: Tuple[float, float, float], normal: Tuple[float, float, float],
        depth: float) -> int:
    """Write a contact, if there is room; return the number of contacts.

    Parameters
    ----------
    out : (n, 7) float64
        Position, normal, depth of each contact.
    count : int
        How many there are.
    position, normal : (float, float, float)
    depth : float
        [m]

    Returns
    -------
    int
    """
    if count < out.shape[0]:
        for axis in range(3):
            out[count, axis], out[count, 3 + axis] = position[axis], normal[axis]
        out[count, 6] = depth
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def corner_of(heights: Values, cell: Values, row: int, column: int) -> Tuple[float, float, float]:
    """Return the place of a sample in the frame of the heightmap [m].

    Parameters
    ----------
    heights : (rows, columns) float64
        [m]
    cell : (2,) float64
        Size of a cell along x and y [m].
    row, column : int
        Of the sample.
    """
    return (cell[0] * (column - 0.5 * (heights.shape[1] - 1)), cell[1] * (0.5 * (heights.shape[0] - 1) - row),
            heights[row, column])


@njit(cache=True, nogil=True, error_model="numpy")
def ground_below(heights: Values, cell: Values, x: float, y: float) -> Tuple[float, float, float]:
    """Return height [m] and slopes along x and y of the ground at a place; a height of nan outside.

    Parameters
    ----------
    heights : (rows, columns) float64
        [m]
    cell : (2,) float64
        Size of a cell along x and y [m].
    x, y : float
        In the frame of the heightmap [m].
    """
    across, down = x / cell[0] + 0.5 * (heights.shape[1] - 1), 0.5 * (heights.shape[0] - 1) - y / cell[1]
    if not (0.0 <= across <= heights.shape[1] - 1 and 0.0 <= down <= heights.shape[0] - 1):
        return math.nan, 0.0, 0.0
    column, row = min(int(across), heights.shape[1] - 2), min(int(down), heights.shape[0] - 2)
    right, up = across - column, 1.0 - (down - row)
    low, high = heights[row + 1, column], heights[row, column + 1]
    middle = heights[row + 1, column + 1] if right >= up else heights[row, column]
    if right >= up:
        along, upwards = middle - low, high - middle
    else:
        along, upwards = high - middle, middle - low
    return low + along * right + upwards * up, along / cell[0], upwards / cell[1]


@njit(cache=True, nogil=True, error_model="numpy")
def cells_below(heights: Values, cell: Values, centre: Values, reach: Values, window: NDArray[np.int64]) -> bool:
    """Write first and last row and column of the cells below a box; return whether there is any.

    Parameters
    ----------
    heights : (rows, columns) float64
        [m]
    cell : (2,) float64
        Size of a cell along x and y [m].
    centre, reach : (3,) float64
        Of the box, in the frame of the heightmap: middle and half extents [m].
    window : (4,) int64
        Written.

    Returns
    -------
    bool
    """
    rows, columns = heights.shape[0] - 1, heights.shape[1] - 1
    left, right = (centre[0] - reach[0]) / cell[0] + 0.5 * columns, (centre[0] + reach[0]) / cell[0] + 0.5 * columns
    top, bottom = 0.5 * rows - (centre[1] + reach[1]) / cell[1], 0.5 * rows - (centre[1] - reach[1]) / cell[1]
    if not (right >= 0.0 and left <= columns and bottom >= 0.0 and top <= rows):
        return False
    window[0], window[1] = min(int(max(top, 0.0)), rows - 1), min(int(min(bottom, rows)), rows - 1)
    window[2], window[3] = min(int(max(left, 0.0)), columns - 1), min(int(min(right, columns)), columns - 1)
    return True
