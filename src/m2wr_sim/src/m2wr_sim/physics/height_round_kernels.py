# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of a ball, or of the curved side of a cylinder, with a heightmap.

A point of the ground is a contact if no other point near it is closer to the centre or axis; this holds for faces,
edges and corners alike.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Tuple

import numpy as np

from m2wr_sim.physics.height_field_kernels import add, corner_of, ground_below
from m2wr_sim.physics.height_window_kernels import COLUMN, MOST_LISTED, is_plane, narrow, tighten

try:
    from numba import njit
except ImportError:         # the engine without numba uses the same functions, slowly
    def njit(**_: Any) -> Callable[[Any], Any]:
        return lambda function: function

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]
    Point = Tuple[float, float, float]      # u, v, s of a place

_MOST_NEAR = 512            # triangles that may be in contact with a ball or wheel
_SAME_PLANE = 0.998         # as in contacts
_TIE = 1e-9                 # m, distances that differ by less are equal
_SIDE = 2e-3                # m, depth from which a wheel may be in contact with its side
# Of a triangle near a shape: distance; u and v of the nearest point; first and last s in contact, and their distances;
# row, column, which half of the cell; whether the ground leads no closer from there.  Its s, for a ball, is the first.
_N_DISTANCE, _N_U, _N_V, _N_FIRST, _N_LAST, _N_FIRST_DISTANCE, _N_LAST_DISTANCE, _N_ROW, _N_COLUMN, _N_HALF, _N_OPEN = \
    range(11)
_NEAR_WORDS = 11
_NEAR_ROOM, _POLYGON_ROOM = (_MOST_NEAR + 1) * _NEAR_WORDS, 48
ROUND_WORK = _NEAR_ROOM + _POLYGON_ROOM         # numbers of working memory


@njit(cache=True, nogil=True, error_model="numpy")
def _clip(polygon: Values, count: int, half: float, kept: Values) -> int:
    """Clip a polygon of rows u, v, s to -half <= s <= half, in place; return its number of corners."""
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        number, inside = 0, 0
        for index in range(count):
            inside += 1 if half - sign * polygon[index, 2] >= 0.0 else 0
        if inside == count:
            continue
        for index in range(count):
            after = index + 1 if index + 1 < count else 0
            one, two = half - sign * polygon[index, 2], half - sign * polygon[after, 2]
            if one >= 0.0:
                for axis in range(3):
                    kept[number, axis] = polygon[index, axis]
                number += 1
            if (one > 0.0 and two < 0.0) or (one < 0.0 and two > 0.0):
                share = one / (one - two)
                for axis in range(3):
                    kept[number, axis] = polygon[index, axis] + share * (polygon[after, axis] - polygon[index, axis])
                number += 1
        count = number
        for index in range(count):
            for axis in range(3):
                polygon[index, axis] = kept[index, axis]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _on_edge(one: Point, two: Point) -> Tuple[float, float, float, float]:
    """Return the squared distance from the axis of the point of an edge nearest to it, and u, v, s of this point."""
    du, dv = two[0] - one[0], two[1] - one[1]
    length = du * du + dv * dv
    share = 0.0
    if length > 0.0:
        share = min(max(-(one[0] * du + one[1] * dv) / length, 0.0), 1.0)
    u, v = one[0] + share * du, one[1] + share * dv
    return u * u + v * v, u, v, one[2] + share * (two[2] - one[2])


@njit(cache=True, nogil=True, error_model="numpy")
def _begin(nearest: Tuple[float, float, float, float], found: Values) -> None:
    """Write a row of near points, up to its distances, for the point nearest to the axis."""
    found[_N_U], found[_N_V], found[_N_FIRST], found[_N_LAST] = nearest[1], nearest[2], nearest[3], nearest[3]
    found[_N_DISTANCE] = found[_N_FIRST_DISTANCE] = found[_N_LAST_DISTANCE] = math.sqrt(nearest[0])


@njit(cache=True, nogil=True, error_model="numpy")
def _extend(point: Tuple[float, float, float, float], radius: float, found: Values) -> None:
    """Extend first and last s by a point that is in contact in about the same direction as the nearest one.

    So the contact of a wheel is in the middle even if it leans by less than its contact is deep.
    """
    square, u, v, s = point
    if square < radius * radius and (s < found[_N_FIRST] or s > found[_N_LAST]):
        distance = math.sqrt(square)
        if u * found[_N_U] + v * found[_N_V] > _SAME_PLANE * distance * found[_N_DISTANCE]:
            if s < found[_N_FIRST]:
                found[_N_FIRST], found[_N_FIRST_DISTANCE] = s, distance
            else:
                found[_N_LAST], found[_N_LAST_DISTANCE] = s, distance


@njit(cache=True, nogil=True, error_model="numpy")
def _triangle_to_axis(one: Point, two: Point, three: Point, radius: float, found: Values) -> None:
    """Write a row of near points, up to its distances, for a triangle."""
    first, second, third = _on_edge(one, two), _on_edge(two, three), _on_edge(three, one)
    nearest = second if second[0] < first[0] else first
    nearest = third if third[0] < nearest[0] else nearest
    _begin(nearest, found)
    if nearest[0] < radius * radius:
        _extend(first, radius, found)
        _extend(second, radius, found)
        _extend(third, radius, found)


@njit(cache=True, nogil=True, error_model="numpy")
def _polygon_to_axis(polygon: Values, count: int, radius: float, found: Values) -> None:
    """Write a row of near points, up to its distances, for a polygon of rows u, v, s."""
    nearest = (math.inf, 0.0, 0.0, 0.0)
    for again in range(2):
        for index in range(count):
            after = index + 1 if index + 1 < count else 0
            point = _on_edge((polygon[index, 0], polygon[index, 1], polygon[index, 2]),
                             (polygon[after, 0], polygon[after, 1], polygon[after, 2]))
            if again == 1:
                _extend(point, radius, found)
            elif point[0] < nearest[0]:
                nearest = point
        if again == 0:
            _begin(nearest, found)
            if nearest[0] >= radius * radius:
                break


@njit(cache=True, nogil=True, error_model="numpy")
def _nearest_to_point(polygon: Values, found: Values) -> None:
    """Write the point of a triangle nearest to the origin, after Ericson: Real-Time Collision Detection, 5.1.5."""
    abx, aby, abz = polygon[1, 0] - polygon[0, 0], polygon[1, 1] - polygon[0, 1], polygon[1, 2] - polygon[0, 2]
    acx, acy, acz = polygon[2, 0] - polygon[0, 0], polygon[2, 1] - polygon[0, 1], polygon[2, 2] - polygon[0, 2]
    d1 = -(abx * polygon[0, 0] + aby * polygon[0, 1] + abz * polygon[0, 2])
    d2 = -(acx * polygon[0, 0] + acy * polygon[0, 1] + acz * polygon[0, 2])
    d3 = -(abx * polygon[1, 0] + aby * polygon[1, 1] + abz * polygon[1, 2])
    d4 = -(acx * polygon[1, 0] + acy * polygon[1, 1] + acz * polygon[1, 2])
    d5 = -(abx * polygon[2, 0] + aby * polygon[2, 1] + abz * polygon[2, 2])
    d6 = -(acx * polygon[2, 0] + acy * polygon[2, 1] + acz * polygon[2, 2])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    first = second = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        first = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        first = d1 / (d1 - d3)
    elif d6 >= 0.0 and d5 <= d6:
        second = 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        second = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        second = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        first = 1.0 - second
    else:
        first, second = vb / (va + vb + vc), vc / (va + vb + vc)
    u, v = polygon[0, 0] + first * abx + second * acx, polygon[0, 1] + first * aby + second * acy
    s = polygon[0, 2] + first * abz + second * acz
    found[_N_DISTANCE], found[_N_U], found[_N_V] = math.sqrt(u * u + v * v + s * s), u, v
    found[_N_FIRST] = found[_N_LAST] = s
    found[_N_FIRST_DISTANCE] = found[_N_LAST_DISTANCE] = found[_N_DISTANCE]


@njit(cache=True, nogil=True, error_model="numpy")
def _apart(one: Point, two: Point, three: Point, radius: float, solid: float) -> bool:
    """Return whether a plane across the direction of a triangle's middle shows that it is farther than ``radius``.

    ``solid`` is 1 for a ball, 0 for a wheel.
    """
    u, v = one[0] + two[0] + three[0], one[1] + two[1] + three[1]
    s = solid * (one[2] + two[2] + three[2])
    least = min(u * one[0] + v * one[1] + s * one[2], u * two[0] + v * two[1] + s * two[2],
                u * three[0] + v * three[1] + s * three[2])
    return (least > 0.0) & (least * least > radius * radius * (u * u + v * v + s * s))


@njit(cache=True, nogil=True, error_model="numpy")
def _corner(frame: Values, x: float, y: float, z: float) -> Point:
    """Return u, v, s of a place relative to the centre."""
    return (x * frame[0, 0] + y * frame[0, 1] + z * frame[0, 2], x * frame[1, 0] + y * frame[1, 1] + z * frame[1, 2],
            x * frame[2, 0] + y * frame[2, 1] + z * frame[2, 2])


@njit(cache=True, nogil=True, error_model="numpy")
def _near_triangle(one: Point, two: Point, three: Point, radius: float, half: float, polygon: Values,
                   found: Values) -> bool:
    """Write the nearest point of a triangle; return whether it is closer than ``radius``."""
    first, last = min(one[2], two[2], three[2]), max(one[2], two[2], three[2])
    if half > 0.0 and (first > half or last < -half):
        return False
    if _apart(one, two, three, radius, 0.0 if half > 0.0 else 1.0):
        return False
    if half > 0.0 and first >= -half and last <= half:
        _triangle_to_axis(one, two, three, radius, found)
    else:
        for axis in range(3):
            polygon[0, axis], polygon[1, axis], polygon[2, axis] = one[axis], two[axis], three[axis]
        if half > 0.0:
            _polygon_to_axis(polygon, _clip(polygon, 3, half, polygon[8:]), radius, found)
        else:
            _nearest_to_point(polygon, found)
    return found[_N_DISTANCE] < radius


@njit(cache=True, nogil=True, error_model="numpy")
def _is_far(heights: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float, row: int,
            column: int) -> bool:
    """Return whether the ball around a cell is farther than ``radius``, or beyond an end of a wheel."""
    one, two = heights[row, column], heights[row, column + 1]
    three, four = heights[row + 1, column], heights[row + 1, column + 1]
    low, high = min(min(one, two), min(three, four)), max(max(one, two), max(three, four))
    x, y, _ = corner_of(heights, cell, row, column)
    x, y, z = x + 0.5 * cell[0] - centre[0], y - 0.5 * cell[1] - centre[1], 0.5 * (low + high) - centre[2]
    bound = 0.5 * math.sqrt(cell[0] * cell[0] + cell[1] * cell[1] + (high - low) * (high - low))
    s = x * frame[2, 0] + y * frame[2, 1] + z * frame[2, 2]
    away = x * x + y * y + z * z - (s * s if half > 0.0 else 0.0)
    return (away > (radius + bound) * (radius + bound)) | ((half > 0.0) & (abs(s) > half + bound))


@njit(cache=True, nogil=True, error_model="numpy")
def _near_in_cell(heights: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float, row: int,
                  column: int, near: Values, count: int, polygon: Values) -> int:
    """Write the triangles of a cell closer than ``radius`` after ``count`` others; return the number of all."""
    x = cell[0] * (column - 0.5 * (heights.shape[1] - 1)) - centre[0]
    y = cell[1] * (0.5 * (heights.shape[0] - 1) - row) - centre[1]
    zero, one = heights[row, column] - centre[2], heights[row, column + 1] - centre[2]
    two, three = heights[row + 1, column] - centre[2], heights[row + 1, column + 1] - centre[2]
    right, down = _corner(frame, x + cell[0], y, one), _corner(frame, x, y - cell[1], two)
    for part in range(2):       # the diagonal is from the corner below to the one on the right
        third = _corner(frame, x + part * cell[0], y - part * cell[1], three if part else zero)
        if count < _MOST_NEAR and _near_triangle(down, right, third, radius, half, polygon, near[count]):
            near[count, _N_ROW], near[count, _N_COLUMN], near[count, _N_HALF] = row, column, part
            near[count, _N_OPEN] = 1.0
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _near_triangles(heights: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float,
                    window: NDArray[np.int64], listed: int, near: Values, work: Values) -> int:
    """Write the triangles closer than ``radius``, with their nearest points; return their number.

    ``frame`` has the directions u, v, s; s is the axis.  ``half`` is half the width, 0 for a ball.  ``listed`` cells
    are looked at, or all of the window if these are more than its list has room for.
    """
    polygon, count = work[_NEAR_ROOM:_NEAR_ROOM + _POLYGON_ROOM].reshape(16, 3), 0
    if listed <= MOST_LISTED:
        for index in range(listed):
            place = window[4 + index]
            count = _near_in_cell(heights, cell, centre, frame, radius, half, place >> 32, place & COLUMN, near, count,
                                  polygon)
        return count
    for row in range(window[0], window[1] + 1):
        for column in range(window[2], window[3] + 1):
            if _is_far(heights, cell, centre, frame, radius, half, row, column):
                continue
            count = _near_in_cell(heights, cell, centre, frame, radius, half, row, column, near, count, polygon)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _put(heights: Values, cell: Values, centre: Values, frame: Values, row: int, column: int, out: Values,
         number: int) -> None:
    """Write the place of a sample as u, v, s."""
    x, y, z = corner_of(heights, cell, row, column)
    for axis in range(3):
        out[number, axis] = ((x - centre[0]) * frame[axis, 0] + (y - centre[1]) * frame[axis, 1]
                             + (z - centre[2]) * frame[axis, 2])


@njit(cache=True, nogil=True, error_model="numpy")
def _near_plane(heights: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float,
                window: NDArray[np.int64], found: Values, work: Values) -> int:
    """Write the nearest point of a window whose samples are in one plane, as if it were one face; return how many.

    It is that of all its triangles together; -1 if these are needed one by one.
    """
    top, left = window[0], window[2]
    if half == 0.0:
        x, y, z = corner_of(heights, cell, top, left)
        along, upwards = (heights[top, left + 1] - z) / cell[0], (z - heights[top + 1, left]) / cell[1]
        scale = 1.0 / math.sqrt(1.0 + along * along + upwards * upwards)
        distance = (centre[2] - z - along * (centre[0] - x) - upwards * (centre[1] - y)) * scale
        dx, dy, dz = along * scale * distance, upwards * scale * distance, -scale * distance
        right, down = (centre[0] + dx - x) / cell[0], (y - centre[1] - dy) / cell[1]
        if not (0.0 <= right <= window[3] + 1 - left and 0.0 <= down <= window[1] + 1 - top):
            return -1
        found[_N_DISTANCE], found[_N_U] = distance, dx * frame[0, 0] + dy * frame[0, 1] + dz * frame[0, 2]
        found[_N_V] = dx * frame[1, 0] + dy * frame[1, 1] + dz * frame[1, 2]
        found[_N_FIRST] = found[_N_LAST] = dx * frame[2, 0] + dy * frame[2, 1] + dz * frame[2, 2]
        found[_N_FIRST_DISTANCE] = found[_N_LAST_DISTANCE] = distance
    else:
        polygon = work[_NEAR_ROOM:ROUND_WORK].reshape(16, 3)
        for corner in range(4):
            _put(heights, cell, centre, frame, top if corner < 2 else window[1] + 1,
                 left if corner % 3 == 0 else window[3] + 1, polygon, corner)
        sides = _clip(polygon, 4, half, polygon[8:])
        if sides == 0:
            return 0
        _polygon_to_axis(polygon, sides, radius, found)
        if radius - found[_N_DISTANCE] > _SIDE:
            return -1
    found[_N_OPEN] = 1.0
    return 1 if found[_N_DISTANCE] < radius else 0


@njit(cache=True, nogil=True, error_model="numpy")
def _is_closest(heights: Values, cell: Values, centre: Values, frame: Values, near: Values, count: int,
                index: int) -> bool:
    """Return whether the ground leads no closer from a nearest point: it is in no triangle that comes closer."""
    u, v, s = near[index, _N_U], near[index, _N_V], 0.5 * (near[index, _N_FIRST] + near[index, _N_LAST])
    x = centre[0] + u * frame[0, 0] + v * frame[1, 0] + s * frame[2, 0]
    y = centre[1] + u * frame[0, 1] + v * frame[1, 1] + s * frame[2, 1]
    across, down = x / cell[0] + 0.5 * (heights.shape[1] - 1), 0.5 * (heights.shape[0] - 1) - y / cell[1]
    for other in range(count):
        if near[other, _N_DISTANCE] < near[index, _N_DISTANCE] - _TIE:
            right, up = across - near[other, _N_COLUMN], 1.0 - (down - near[other, _N_ROW])
            if -1e-7 <= right <= 1.0 + 1e-7 and -1e-7 <= up <= 1.0 + 1e-7 \
                    and (up >= right - 1e-7 if near[other, _N_HALF] == 0.0 else right >= up - 1e-7):
                return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _sunk(heights: Values, cell: Values, centre: Values, radius: float, out: Values) -> int:
    """Write the contact of a ball or wheel whose centre is below the ground; return 1, or 0 if it is above."""
    ground, along, upwards = ground_below(heights, cell, centre[0], centre[1])
    if not ground > centre[2]:
        return 0
    scale = 1.0 / math.sqrt(1.0 + along * along + upwards * upwards)
    return add(out, 0, (centre[0], centre[1], ground), (-along * scale, -upwards * scale, scale),
               radius + (ground - centre[2]) * scale)


@njit(cache=True, nogil=True, error_model="numpy")
def round_contacts(heights: Values, tops: Values, cell: Values, centre: Values, frame: Values, radius: float,
                   half: float, wheel: bool, greatest: float, reach: Values, window: NDArray[np.int64],
                   out: Values, work: Values) -> int:
    """Write the contacts of a ball, or of the curved side of a cylinder; return their number.

    Parameters
    ----------
    heights, tops, cell
        As for :func:`m2wr_sim.physics.height_kernels.height_contacts`.
    centre : (3,) float64
        Of the shape, in the frame of the heightmap [m].
    frame : (3, 3) float64
        Its axes, one a row; a cylinder is along the last.
    radius, half : float
        Radius, and half the width: 0 for a ball [m].
    wheel : bool
        Whether the contacts are in the middle where the ground is level across.
    greatest : float
        A height that the ground below it does not exceed [m].
    reach : (3,) float64
        Half extents of the box around the shape [m]; changed.
    window : (WINDOW,) int64
        First and last row and column of the cells below it; changed, and the others written.
    out : (n, 7) float64
        Written, in the frame of the heightmap.
    work : (ROUND_WORK,) float64
        Working memory, so that none is allocated in a step.

    Returns
    -------
    int
    """
    if _sunk(heights, cell, centre, radius, out):
        return 1
    across = narrow(heights, tops, cell, centre, frame, radius, half, greatest, reach, window)
    if across < 0.0:
        return 0
    near = work[:_NEAR_ROOM].reshape(_MOST_NEAR + 1, _NEAR_WORDS)
    found, listed, plane = -1, MOST_LISTED + 1, is_plane(heights, window)
    if not plane:
        listed = tighten(heights, cell, centre, frame, radius, half, across, window)
        if listed == 0:
            return 0
        plane = is_plane(heights, window)
    if plane:
        found = _near_plane(heights, cell, centre, frame, radius, half, window, near[0], work)
    if found < 0:
        found = _near_triangles(heights, cell, centre, frame, radius, half, window, listed, near, work)
    solid = 0.0 if half > 0.0 else 1.0
    count = 0
    while count < out.shape[0] - 1:
        best = -1
        for index in range(found):
            if near[index, _N_OPEN] > 0.0 and (best < 0 or near[index, _N_DISTANCE] < near[best, _N_DISTANCE]):
                best = index
        if best < 0 or near[best, _N_DISTANCE] < _TIE:
            break
        if found > 1 and not _is_closest(heights, cell, centre, frame, near, found, best):
            near[best, _N_OPEN] = 0.0
            continue
        distance, u, v, w = near[best, _N_DISTANCE], near[best, _N_U], near[best, _N_V], solid * near[best, _N_FIRST]
        depth, side, first, last = radius - distance, 0.0, best, best
        if half > 0.0 and depth > _SIDE:
            depth, side = _from_the_side(near, found, radius, half)
        limit = distance + 0.5 * (radius - distance) if side != 0.0 else math.inf
        for index in range(found):          # others on the same face
            same = u * near[index, _N_U] + v * near[index, _N_V] + w * near[index, _N_FIRST]
            if same > _SAME_PLANE * distance * near[index, _N_DISTANCE] and near[index, _N_DISTANCE] <= limit:
                near[index, _N_OPEN] = 0.0
                first = index if near[index, _N_FIRST] < near[first, _N_FIRST] else first
                last = index if near[index, _N_LAST] > near[last, _N_LAST] else last
        normal = (-(u * frame[0, 0] + v * frame[1, 0] + w * frame[2, 0]) / distance,
                  -(u * frame[0, 1] + v * frame[1, 1] + w * frame[2, 1]) / distance,
                  -(u * frame[0, 2] + v * frame[1, 2] + w * frame[2, 2]) / distance)
        if side != 0.0:
            normal = (side * frame[2, 0], side * frame[2, 1], side * frame[2, 2])
        one, two = near[first, _N_FIRST], near[last, _N_LAST]
        if half == 0.0:
            one = two = w
        elif wheel or side != 0.0:
            one = two = 0.5 * (one + two)
        for s in (one, two):
            deep = depth
            if one != two:
                deep = radius - (near[first, _N_FIRST_DISTANCE] if s == one else near[last, _N_LAST_DISTANCE])
            count = add(out, count, (centre[0] + u * frame[0, 0] + v * frame[1, 0] + s * frame[2, 0],
                                     centre[1] + u * frame[0, 1] + v * frame[1, 1] + s * frame[2, 1],
                                     centre[2] + u * frame[0, 2] + v * frame[1, 2] + s * frame[2, 2]), normal, deep)
            if one == two:
                break
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _from_the_side(near: Values, found: int, radius: float, half: float) -> Tuple[float, float]:
    """Return the depth of what reaches deepest into a wheel, and from which side it comes: -1, 1, or 0 from below.

    It comes from a side if it reaches less far into the wheel from there; the sign is that of the normal on the axis.
    """
    depth = 0.0
    for index in range(found):
        depth = max(depth, radius - near[index, _N_DISTANCE] if near[index, _N_OPEN] > 0.0 else 0.0)
    least, greatest = math.inf, -math.inf
    for index in range(found):
        if radius - near[index, _N_DISTANCE] > 0.5 * depth:
            least, greatest = min(least, near[index, _N_FIRST]), max(greatest, near[index, _N_LAST])
    away, sign = (half - least, -1.0) if half - least < greatest + half else (greatest + half, 1.0)
    return (away, sign) if away < depth else (depth, 0.0)
