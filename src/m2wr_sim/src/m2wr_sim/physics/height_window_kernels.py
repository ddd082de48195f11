# SPDX-License-Identifier: BSD-3-Clause
"""Which cells of a heightmap may have contacts with a ball or wheel, and whether they are one plane."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Tuple

from m2wr_sim.physics.height_field_kernels import cells_below, greatest_in

try:
    from numba import njit
except ImportError:         # the engine without numba uses the same functions, slowly
    def njit(**_: Any) -> Callable[[Any], Any]:
        return lambda function: function

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Values = NDArray[np.float64]
    #: Of a wheel: x and y of the level direction across its axis, of the way down in its plane, of its axis; how steep
    #: that way is; half the extent of a cell along the first two; greatest distance along the axis.
    Slants = Tuple[float, float, float, float, float, float, float, float, float, float]

STEEPEST = 0.7              # sine of the axis of a wheel with the vertical, below which it lies on its side
_ROUNDS = 3                 # of narrowing; each one halves the window at least
_DOUBT = 1e-9               # m, by which a cell must be too far away
_SAME_PLANE = 1e-12         # m


@njit(cache=True, nogil=True, error_model="numpy")
def slants_of(cell: Values, frame: Values, radius: float, half: float) -> Slants:
    """Return what :func:`clears` needs of a wheel; zeros for a ball, or a wheel that lies on its side.

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
def clears(slants: Slants, cell: Values, frame: Values, x: float, y: float, top: float, radius: float,
           half: float) -> bool:
    """Return whether a cell is certainly not closer than the radius to the centre of a ball or the axis of a wheel.

    Parameters
    ----------
    slants : tuple
        From :func:`slants_of`.
    cell, frame, radius, half
        As there.
    x, y : float
        Middle of the cell relative to the centre, in the frame of the heightmap [m].
    top : float
        Its greatest height relative to the centre [m].
    """
    if half == 0.0:
        x, y, z = max(abs(x) - 0.5 * cell[0], 0.0), max(abs(y) - 0.5 * cell[1], 0.0), max(-top, 0.0)
        return x * x + y * y + z * z > (radius + _DOUBT) * (radius + _DOUBT)
    if slants[6] == 0.0:
        return False
    down = slants[2] * x + slants[3] * y - slants[6] * top - abs(frame[2, 2]) * slants[8]
    if down <= 0.0:
        return False
    across = max(abs(slants[0] * x + slants[1] * y) - slants[7], 0.0)
    return down * down + across * across > (radius + _DOUBT) * (radius + _DOUBT)


@njit(cache=True, nogil=True, error_model="numpy")
def _strip(least: float, greatest: float, slope: float, offset: float, limit: float) -> Tuple[float, float]:
    """Return the part of an interval of x in which ``slope * x + offset`` is within a limit."""
    if abs(slope) < 1e-9:
        return least, greatest
    one, two = (-limit - offset) / slope, (limit - offset) / slope
    return max(least, min(one, two)), min(greatest, max(one, two))


@njit(cache=True, nogil=True, error_model="numpy")
def _tighten(heights: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float, across: float,
             window: NDArray[np.int64]) -> bool:
    """Reduce the window to the cells that do not clear a ball or wheel; return whether there is any.

    ``across`` is how far from the axis of a wheel they are at most, along the level.
    """
    slants, middle, limit = slants_of(cell, frame, radius, half), 0.5 * (heights.shape[1] - 2), across
    top, bottom, left, right = window[1] + 1, -1, window[3] + 1, -1
    limit += slants[7] + _DOUBT
    for row in range(window[0], window[1] + 1):
        y = cell[1] * (0.5 * (heights.shape[0] - 2) - row) - centre[1]
        first, last = window[2], window[3]
        if slants[6] > 0.0:
            least, greatest = cell[0] * (first - middle) - centre[0], cell[0] * (last - middle) - centre[0]
            least, greatest = _strip(least, greatest, slants[0], slants[1] * y, limit)
            least, greatest = _strip(least, greatest, slants[4], slants[5] * y, slants[9])
            if greatest < least:
                continue
            first = max(first, int(math.floor((least + centre[0]) / cell[0] + middle)))
            last = min(last, int(math.ceil((greatest + centre[0]) / cell[0] + middle)))
        before = max(heights[row, first], heights[row + 1, first])
        for column in range(first, last + 1):
            after = max(heights[row, column + 1], heights[row + 1, column + 1])
            high, before = max(before, after), after
            if not clears(slants, cell, frame, cell[0] * (column - middle) - centre[0], y, high - centre[2], radius,
                          half):
                top, bottom, left, right = min(top, row), row, min(left, column), max(right, column)
    window[0], window[1], window[2], window[3] = top, bottom, left, right
    return bottom >= 0


@njit(cache=True, nogil=True, error_model="numpy")
def narrow(heights: Values, tops: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float,
           reach: Values, window: NDArray[np.int64]) -> bool:
    """Narrow the window to the cells that may have contacts with a ball or wheel; return whether there is any.

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
    reach : (3,) float64
        Half extents of the box around the shape [m]; changed.
    window : (4,) int64
        First and last row and column of the cells below it; changed.

    Returns
    -------
    bool
    """
    level = math.sqrt(frame[2, 0] * frame[2, 0] + frame[2, 1] * frame[2, 1])    # sine of the axis with the vertical
    if half > 0.0 and level < STEEPEST:
        return True
    across, size = radius, (window[1] - window[0] + 1) * (window[3] - window[2] + 1)
    for _ in range(_ROUNDS):
        low = centre[2] - greatest_in(heights, tops, window)
        if half > 0.0:
            low = (low - half * abs(frame[2, 2])) / level       # along the steepest direction in the plane of the wheel
        if low >= radius:
            return False
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
            return False
        before, size = size, (window[1] - window[0] + 1) * (window[3] - window[2] + 1)
        if 2 * size > before:
            break
    return _tighten(heights, cell, centre, frame, radius, half, across, window)


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
