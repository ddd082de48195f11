# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of a sphere, cylinder or box with a heightmap; libode's own lift wheels over steps without any effort.

The frame of the heightmap has z up, columns along x and rows against y, as :class:`m2wr_sim.model.types.Heightmap`.
A point of the ground is a contact with a ball or wheel if no other point near it is closer to the centre or axis; this
holds for faces, edges and corners alike.  A box and the ends of a cylinder have contacts where their edges are below
the ground, and where convex points of the ground are inside them.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable

import numpy as np

from m2wr_sim.physics.height_field_kernels import (
    SHIFT,
    add,
    cells_below,
    corner_of,
    greatest_in,
    ground_below,
    into,
    turn,
)
from m2wr_sim.physics.height_round_kernels import ROUND_WORK, round_contacts

try:
    from numba import njit
except ImportError:         # the engine without numba uses the same functions, slowly
    def njit(**_: Any) -> Callable[[Any], Any]:
        return lambda function: function

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

NO_SHAPE, SPHERE, CYLINDER, WHEEL, BOX, FIELD = range(6)
CONTACT = 7                 # numbers of a contact: position, normal from the ground into the shape, depth
MOST = 64                   # contacts of a pair
_ROOM = 19
WORK = _ROOM + ROUND_WORK   # numbers of working memory
_EDGE_POINTS, _RIM_POINTS = 16, 16
_CONVEX = 1e-9              # m, by which a convex point is above the middle of its neighbours


@njit(cache=True, nogil=True, error_model="numpy")
def _point(heights: Values, cell: Values, x: float, y: float, z: float, out: Values, count: int) -> int:
    """Write the contact of a point of a shape, if it is below the ground."""
    ground, along, upwards = ground_below(heights, cell, x, y)
    if ground > z:
        scale = 1.0 / math.sqrt(1.0 + along * along + upwards * upwards)
        count = add(out, count, (x, y, z), (-along * scale, -upwards * scale, scale), (ground - z) * scale)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _convex(heights: Values, row: int, column: int) -> bool:
    """Return whether a sample is above the middle of two opposite neighbours."""
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        if 0 <= row - down and row + down < heights.shape[0] and 0 <= column - right < heights.shape[1] \
                and 0 <= column + right < heights.shape[1] and heights[row, column] - _CONVEX > 0.5 * (
                    heights[row - down, column - right] + heights[row + down, column + right]):
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _peak(heights: Values, cell: Values, centre: Values, axes: Values, halves: Values, rounded: bool, row: int,
          column: int, out: Values, count: int) -> int:
    """Write the contact of a sample, if it is convex and inside a box, or a cylinder if ``rounded``."""
    x, y, z = corner_of(heights, cell, row, column)
    least, face, sign = math.inf, 0, 0.0
    for axis in range(3):
        along = (x - centre[0]) * axes[axis, 0] + (y - centre[1]) * axes[axis, 1] + (z - centre[2]) * axes[axis, 2]
        side = 1.0 if along > 0.0 else -1.0
        inside = halves[axis] - abs(along)
        if inside < 0.0:
            return count
        if inside < least and side * axes[axis, 2] < 0.3 and not (rounded and axis < 2):
            least, face, sign = inside, axis, -side
    if 0.0 < least < math.inf and _convex(heights, row, column):
        count = add(out, count, (x, y, z), (sign * axes[face, 0], sign * axes[face, 1], sign * axes[face, 2]), least)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _peaks(heights: Values, tops: Values, cell: Values, centre: Values, axes: Values, halves: Values, rounded: bool,
           window: NDArray[np.int64], out: Values, count: int) -> int:
    """Write the contacts of convex samples inside a box, or a cylinder if ``rounded``; the nearest face decides."""
    lowest, across, size = centre[2] - halves[3], ((heights.shape[1] - 2) >> SHIFT) + 1, 1 << SHIFT
    for row in range(window[0], window[1] + 2):
        block, column = (min(row, heights.shape[0] - 2) >> SHIFT) * across, window[2]
        while column <= window[3] + 1:
            end = min((column >> SHIFT << SHIFT) + size, window[3] + 2)
            if tops[block + (min(column, heights.shape[1] - 2) >> SHIFT)] >= lowest:
                for place in range(column, end):
                    if heights[row, place] >= lowest:
                        count = _peak(heights, cell, centre, axes, halves, rounded, row, place, out, count)
            column = end
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _box(heights: Values, tops: Values, cell: Values, centre: Values, axes: Values, halves: Values, greatest: float,
         window: NDArray[np.int64], out: Values) -> int:
    """Write the contacts of a box: its corners, points along its edges, convex points of the ground in it.

    ``greatest`` is a height that the ground below it does not exceed.
    """
    count = 0
    for corner in range(8):
        x, y, z = centre[0], centre[1], centre[2]
        for axis in range(3):
            side = halves[axis] * (1.0 if corner >> axis & 1 else -1.0)
            x, y, z = x + side * axes[axis, 0], y + side * axes[axis, 1], z + side * axes[axis, 2]
        count = _point(heights, cell, x, y, z, out, count)
    for axis in range(3):
        parts = min(max(int(2.0 * halves[axis] / min(cell[0], cell[1])), 1), _EDGE_POINTS)
        for edge in range(4):
            x, y, z = centre[0], centre[1], centre[2]
            for number in range(1, 3):
                other = (axis + number) % 3
                side = halves[other] * (1.0 if edge >> (number - 1) & 1 else -1.0)
                x, y, z = x + side * axes[other, 0], y + side * axes[other, 1], z + side * axes[other, 2]
            if z - halves[axis] * abs(axes[axis, 2]) > greatest:
                continue
            for part in range(1, parts):
                along = halves[axis] * (2.0 * part / parts - 1.0)
                count = _point(heights, cell, x + along * axes[axis, 0], y + along * axes[axis, 1],
                               z + along * axes[axis, 2], out, count)
    return _peaks(heights, tops, cell, centre, axes, halves, False, window, out, count)


@njit(cache=True, nogil=True, error_model="numpy")
def _upright(heights: Values, tops: Values, cell: Values, centre: Values, axes: Values, radius: float, half: float,
             halves: Values, window: NDArray[np.int64], out: Values) -> int:
    """Write the contacts of a cylinder with its ends up and down: points of its rims, convex points in it."""
    count = 0
    for number in range(_RIM_POINTS):
        angle = 2.0 * math.pi * number / _RIM_POINTS
        u, v = radius * math.cos(angle), radius * math.sin(angle)
        for end in (-half, half):
            count = _point(heights, cell, centre[0] + u * axes[0, 0] + v * axes[1, 0] + end * axes[2, 0],
                           centre[1] + u * axes[0, 1] + v * axes[1, 1] + end * axes[2, 1],
                           centre[2] + u * axes[0, 2] + v * axes[1, 2] + end * axes[2, 2], out, count)
    halves[0] = halves[1] = radius * math.sqrt(0.5)
    return _peaks(heights, tops, cell, centre, axes, halves, True, window, out, count)


@njit(cache=True, nogil=True, error_model="numpy")
def height_contacts(heights: Values, tops: Values, cell: Values, field: Values, kind: int, size: Values, pose: Values,
                    out: Values, work: Values, window: NDArray[np.int64]) -> int:
    """Find the contacts of a shape with a heightmap.

    Parameters
    ----------
    heights : (rows, columns) float64
    tops : (n,) float64
        From :func:`m2wr_sim.physics.height_field_kernels.tops_of`.
    cell : (2,) float64
        Size of a cell along x and y [m].
    field, pose : (7,) float64
        Pose in the world of the heightmap, with libode's axes, and of the shape: position, quaternion x y z w.
    kind : int
        SPHERE, CYLINDER, WHEEL or BOX.  The contacts of a wheel are in its middle where the ground is level across.
    size : (3,) float64
        Radius; radius and length; extents [m].
    out : (n, 7) float64
        Position, normal from the ground into the shape, depth of each contact, in the world.
    work : (WORK,) float64
        Working memory, so that none is allocated in a step.
    window : (WINDOW,) int64
        Working memory.

    Returns
    -------
    int
        Number of contacts.
    """
    centre, axes, reach, halves = work[:3], work[3:12].reshape(3, 3), work[12:15], work[15:_ROOM]
    into(field, pose, centre, axes)
    for axis in range(3):
        if kind == SPHERE:
            reach[axis] = size[0]
        elif kind == BOX:
            halves[axis] = 0.5 * size[axis]
            reach[axis] = 0.5 * (size[0] * abs(axes[0, axis]) + size[1] * abs(axes[1, axis])
                                 + size[2] * abs(axes[2, axis]))
        else:
            along = min(abs(axes[2, axis]), 1.0)
            reach[axis] = 0.5 * size[1] * along + size[0] * math.sqrt(1.0 - along * along)
    halves[3] = reach[2]
    if not cells_below(heights, cell, centre, reach, window):
        return 0
    greatest = greatest_in(heights, tops, window)
    if not greatest >= centre[2] - reach[2]:
        return 0
    if kind == BOX:
        count = _box(heights, tops, cell, centre, axes, halves, greatest, window, out)
    elif kind == SPHERE:
        count = round_contacts(heights, tops, cell, centre, axes, size[0], 0.0, False, greatest, reach, window, out,
                               work[_ROOM:])
    elif kind == CYLINDER and abs(axes[2, 2]) > 0.7:
        halves[2] = 0.5 * size[1]
        count = _upright(heights, tops, cell, centre, axes, size[0], 0.5 * size[1], halves, window, out)
    else:
        count = round_contacts(heights, tops, cell, centre, axes, size[0], 0.5 * size[1], kind == WHEEL, greatest,
                               reach, window, out, work[_ROOM:])
    for index in range(count):          # back to libode's axes, then to the world
        for first in (0, 3):
            x, y, z = turn(field, out[index, first], out[index, first + 2], -out[index, first + 1], 1.0)
            out[index, first], out[index, first + 1], out[index, first + 2] = x, y, z
        for axis in range(3):
            out[index, axis] += field[axis]
    return count
