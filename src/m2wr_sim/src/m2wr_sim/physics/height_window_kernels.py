# SPDX-License-Identifier: BSD-3-Clause
"""Which cells of a heightmap may have contacts with a ball or wheel, and whether they are one plane."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Tuple

import numpy as np

from m2wr_sim.physics.height_field_kernels import cells_below, greatest_in

try:
    from numba import njit
except ImportError:         # the engine without numba uses the same functions, slowly
    def njit(**_: Any) -> Callable[[Any], Any]:
        return lambda function: function

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]
    #: Of a wheel: x and y of the level direction across its axis, of the way down in its plane, of its axis; how steep
    #: that way is; half the extent of a cell along the first two; greatest distance along the axis.
    Slants = Tuple[float, float, float, float, float, float, float, float, float, float]

MOST_LISTED = 1024          # cells; of more, all of the window are looked at
WINDOW = 5 + MOST_LISTED    # numbers of a window and its list, of which the last one is overwritten
COLUMN = (1 << 32) - 1      # the bits of the column in the list
STEEPEST = 0.7              # sine of the axis of a wheel with the vertical, below which it lies on its side
_ROUNDS = 3                 # of narrowing; each one halves the window at least
_DOUBT = 1e-9               # m, by which a cell must be too far away
_SAME_PLANE = 1e-12         # m


@njit(cache=True, nogil=True, error_model="numpy")
def slants_of(cell: Values, frame: Values, radius: float, half: float) -> Slants:
    """Return what :func:`tighten` needs of a wheel; zeros for a ball, or a wheel that lies on its side.

    Parameters
    ----------
    cell : (2,) float64
        Size of a cell along x and y [m].
    frame : (3, 3) float64
        Axes of the shape in the frame of the heightmap, one a row; a wheel is along the last.
    radius, half : float
        Radius, and half the width: 0 for a ball [m].
    """
    x, y, z = frame[2, 0], frame[2, 1], frame[2, 2]
    level = math.sqrt(x * x + y * y)
    if half == 0.0 or level < STEEPEST:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    x, y = x / level, y / level
    across, along = 0.5 * (abs(y) * cell[0] + abs(x) * cell[1]), 0.5 * (abs(x) * cell[0] + abs(y) * cell[1])
    return (-y, x, z * x, z * y, x, y, level, across, along,
            radius * abs(z) / level + half + along + _DOUBT)


@njit(cache=True, nogil=True, error_model="numpy")
def _strip(slope: float, offset: float, per_row: float, limit: float) -> Tuple[float, float, float]:
    """Return where ``|slope * column + offset + per_row * row|`` is within a limit: columns of row 0, and per row."""
    if abs(slope) < 1e-9 * limit:
        return -math.inf, math.inf, 0.0
    middle, half = -offset / slope, limit / abs(slope)
    return middle - half, middle + half, -per_row / slope


@njit(cache=True, nogil=True, error_model="numpy")
def _list_wheel(heights: Values, cell: Values, centre: Values, slants: Slants, lean: float, radius: float,
                across: float, window: NDArray[np.int64]) -> int:
    """List the cells that do not clear a wheel, row by row; ``lean``: what its axis takes off their distance."""
    wide, high = cell[0], cell[1]
    x, y = -0.5 * wide * (heights.shape[1] - 2) - centre[0], 0.5 * high * (heights.shape[0] - 2) - centre[1]
    down, down_column, down_row = slants[2] * x + slants[3] * y + slants[6] * centre[2] - lean, slants[2] * wide, \
        -slants[3] * high
    side, side_column, side_row = slants[0] * x + slants[1] * y, slants[0] * wide, -slants[1] * high
    one, two, turn_one = _strip(side_column, side, side_row, across + slants[7] + _DOUBT)
    three, four, turn_two = _strip(slants[4] * wide, slants[4] * x + slants[5] * y, -slants[5] * high, slants[9])
    limit, steep, margin = (radius + _DOUBT) * (radius + _DOUBT), slants[6], slants[7]
    first, last, count = window[2], window[3], 0
    for row in range(window[0], window[1] + 1):
        least = max(float(first), max(one + turn_one * row, three + turn_two * row) - _DOUBT)
        greatest = min(float(last), min(two + turn_one * row, four + turn_two * row) + _DOUBT)
        if not least <= greatest:
            continue
        begin, end = int(math.ceil(least)), int(math.floor(greatest))
        if end < begin:
            continue
        if count + end - begin >= MOST_LISTED:
            return MOST_LISTED + 1
        below, beside = down + down_row * row, side + side_row * row
        upper, lower = np.uint64(row), np.uint64(row + 1)       # unsigned: numba then adds no sizes to them
        before = max(heights[upper, np.uint64(begin)], heights[lower, np.uint64(begin)])
        for column in range(begin, end + 1):    # without branches: ground is irregular, they would be mispredicted
            after = max(heights[upper, np.uint64(column + 1)], heights[lower, np.uint64(column + 1)])
            top, before = max(before, after), after
            depth = max(below + down_column * column - steep * top, 0.0)
            away = max(abs(beside + side_column * column) - margin, 0.0)
            window[np.uint64(4 + count)] = row << 32 | column
            count += int(depth * depth + away * away <= limit)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _list_ball(heights: Values, cell: Values, centre: Values, radius: float, window: NDArray[np.int64]) -> int:
    """List the cells that do not clear a ball, row by row."""
    wide, middle_z, count, first, last = cell[0], centre[2], 0, window[2], window[3]
    left = -0.5 * wide * (heights.shape[1] - 2) - centre[0]
    for row in range(window[0], window[1] + 1):
        if count + last - first >= MOST_LISTED:
            return MOST_LISTED + 1
        y = max(abs(cell[1] * (0.5 * (heights.shape[0] - 2) - row) - centre[1]) - 0.5 * cell[1], 0.0)
        limit = (radius + _DOUBT) * (radius + _DOUBT) - y * y
        upper, lower = np.uint64(row), np.uint64(row + 1)
        before = max(heights[upper, np.uint64(first)], heights[lower, np.uint64(first)])
        for column in range(first, last + 1):
            after = max(heights[upper, np.uint64(column + 1)], heights[lower, np.uint64(column + 1)])
            top, before = max(before, after), after
            x, z = max(abs(left + wide * column) - 0.5 * wide, 0.0), max(middle_z - top, 0.0)
            window[np.uint64(4 + count)] = row << 32 | column
            count += int(x * x + z * z <= limit)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def tighten(heights: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float, across: float,
            window: NDArray[np.int64]) -> int:
    """Reduce the window to the cells that do not clear a ball or wheel, and list these; return how many.

    A cell clears it if all points of the cell are certainly farther than the radius from the centre or axis.

    Parameters
    ----------
    heights, cell, centre, frame, radius, half
        As for :func:`narrow`.
    across : float
        How far from the axis of a wheel they are at most, along the level: from :func:`narrow` [m].
    window : (WINDOW,) int64
        First and last row and column, then the list: row * 2^32 + column of each.

    Returns
    -------
    int
        More than ``MOST_LISTED`` if there may be more, or if the wheel lies on its side: then nothing is changed but
        the list.
    """
    if half > 0.0:
        slants = slants_of(cell, frame, radius, half)
        if slants[6] == 0.0:
            return MOST_LISTED + 1
        count = _list_wheel(heights, cell, centre, slants, abs(frame[2, 2]) * slants[8], radius, across, window)
    else:
        count = _list_ball(heights, cell, centre, radius, window)
    if 0 < count <= MOST_LISTED:
        window[0], window[1] = window[4] >> 32, window[3 + count] >> 32
        left, right = window[3], window[2]
        for index in range(count):
            left, right = min(left, window[4 + index] & COLUMN), max(right, window[4 + index] & COLUMN)
        window[2], window[3] = left, right
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def narrow(heights: Values, tops: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float,
           greatest: float, reach: Values, window: NDArray[np.int64]) -> float:
    """Narrow the window to where a ball or wheel may have contacts; return how far across these are, -1 if nowhere.

    Parameters
    ----------
    heights : (rows, columns) float64
        [m]
    tops : (n,) float64
        From :func:`m2wr_sim.physics.height_field_kernels.tops_of`.
    cell, frame, radius, half
        As for :func:`slants_of`.
    centre : (3,) float64
        Of the shape, in the frame of the heightmap [m].
    greatest : float
        A height that no sample of the window exceeds [m].
    reach : (3,) float64
        Half extents of the box around the shape [m]; changed.
    window : (4 or more,) int64
        First and last row and column of the cells below it; changed.

    Returns
    -------
    float
        Distance from the axis of a wheel, along the level, or from the centre of a ball [m].
    """
    level = math.sqrt(frame[2, 0] * frame[2, 0] + frame[2, 1] * frame[2, 1])    # sine of the axis with the vertical
    if half > 0.0 and level < STEEPEST:
        return math.inf
    across, size = radius, (window[1] - window[0] + 1) * (window[3] - window[2] + 1)
    for number in range(_ROUNDS):
        low = centre[2] - (greatest_in(heights, tops, window) if number > 0 else greatest)
        if half > 0.0:
            low = (low - half * abs(frame[2, 2])) / level       # along the steepest direction in the plane of the wheel
        if low >= radius:
            return -1.0
        if low <= 0.0:
            break
        across = math.sqrt(radius * radius - low * low)
        if half > 0.0:
            down = radius * abs(frame[2, 2]) / level + half
            for axis in range(2):
                reach[axis] = (across * abs(frame[2, 1 - axis]) + down * abs(frame[2, axis])) / level
        else:
            reach[0] = reach[1] = across
        if not cells_below(heights, cell, centre, reach, window):
            return -1.0
        before, size = size, (window[1] - window[0] + 1) * (window[3] - window[2] + 1)
        if 2 * size > before:
            break
    return across


@njit(cache=True, nogil=True, error_model="numpy")
def is_plane(heights: Values, window: NDArray[np.int64]) -> bool:
    """Return whether all samples of the cells of a window are in one plane.

    Parameters
    ----------
    heights : (rows, columns) float64
        [m]
    window : (4,) int64
        First and last row and column of the cells.
    """
    corner = heights[window[0], window[2]]
    right, down = heights[window[0], window[2] + 1] - corner, heights[window[0] + 1, window[2]] - corner
    for row in range(window[0], window[1] + 2):
        start = corner + down * (row - window[0])
        for column in range(window[2], window[3] + 2):
            if abs(heights[row, column] - start - right * (column - window[2])) > _SAME_PLANE:
                return False
    return True
