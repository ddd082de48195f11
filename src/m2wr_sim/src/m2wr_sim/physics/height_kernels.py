# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of a sphere, cylinder or box with a heightmap; libode's own lift wheels over steps without any effort.

The frame of the heightmap has z up, columns along x and rows against y, as :class:`m2wr_sim.model.types.Heightmap`.
A point of the ground is a contact with a ball or wheel if no other point near it is closer to the centre or axis; this
holds for faces, edges and corners alike.  A box and the ends of a cylinder have contacts where their edges are below
the ground, and where convex points of the ground are inside them.
"""
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

NO_SHAPE, SPHERE, CYLINDER, WHEEL, BOX, FIELD = range(6)
BLOCK = 8                   # cells a side of one entry of the table of greatest heights
CONTACT = 7                 # numbers of a contact: position, normal from the ground into the shape, depth
MOST = 64                   # contacts of a pair
_MOST_NEAR = 512            # triangles that may be in contact with a ball or wheel
_SAME_PLANE = 0.998         # as in contacts
_TIE = 1e-9                 # m, distances that differ by less are equal
_SIDE = 2e-3                # m, depth from which a wheel may be in contact with its side
_EDGE_POINTS, _RIM_POINTS = 16, 16
_CONVEX = 1e-9              # m, by which a convex point is above the middle of its neighbours
# Of a triangle near a shape: distance; u and v of the nearest point; first and last s in contact, and their distances;
# row, column, which half of the cell; whether the ground leads no closer from there.  Its s, for a ball, is the first.
_N_DISTANCE, _N_U, _N_V, _N_FIRST, _N_LAST, _N_FIRST_DISTANCE, _N_LAST_DISTANCE, _N_ROW, _N_COLUMN, _N_HALF, _N_OPEN = \
    range(11)
_NEAR_WORDS, _FOUND_WORDS = 11, 7


@njit(cache=True, nogil=True, error_model="numpy")
def tops_of(heights: Values) -> Values:
    """Return the greatest height of each block of BLOCK x BLOCK cells.

    Parameters
    ----------
    heights : (rows, columns) float64

    Returns
    -------
    (block rows, block columns) float64
    """
    rows, columns = heights.shape[0] - 1, heights.shape[1] - 1
    tops = np.full(((rows + BLOCK - 1) // BLOCK, (columns + BLOCK - 1) // BLOCK), -math.inf)
    for row in range(tops.shape[0]):
        for column in range(tops.shape[1]):
            for i in range(row * BLOCK, min(rows, (row + 1) * BLOCK) + 1):
                for j in range(column * BLOCK, min(columns, (column + 1) * BLOCK) + 1):
                    tops[row, column] = max(tops[row, column], heights[i, j])
    return tops


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(pose: Values, x: float, y: float, z: float, sign: float) -> Tuple[float, float, float]:
    """Rotate a vector by the quaternion of a pose, or back if ``sign`` is -1."""
    qx, qy, qz, w = sign * pose[3], sign * pose[4], sign * pose[5], pose[6]
    tx, ty, tz = 2.0 * (qy * z - qz * y), 2.0 * (qz * x - qx * z), 2.0 * (qx * y - qy * x)
    return x + w * tx + qy * tz - qz * ty, y + w * ty + qz * tx - qx * tz, z + w * tz + qx * ty - qy * tx


@njit(cache=True, nogil=True, error_model="numpy")
def _into(field: Values, pose: Values) -> Tuple[Values, Values]:
    """Return centre (3,) and axes (3, 3), one a row, of a shape in the frame of a heightmap.

    libode's heightmaps have y up and z against the y of the frame used here.
    """
    centre, axes = np.empty(3), np.empty((3, 3))
    x, y, z = _turn(field, pose[0] - field[0], pose[1] - field[1], pose[2] - field[2], -1.0)
    centre[0], centre[1], centre[2] = x, -z, y
    for axis in range(3):
        ux, uy, uz = _turn(pose, 1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0, 1.0)
        x, y, z = _turn(field, ux, uy, uz, -1.0)
        axes[axis, 0], axes[axis, 1], axes[axis, 2] = x, -z, y
    return centre, axes


@njit(cache=True, nogil=True, error_model="numpy")
def _add(out: Values, count: int, position: Tuple[float, float, float], normal: Tuple[float, float, float],
         depth: float) -> int:
    if count < out.shape[0]:
        for axis in range(3):
            out[count, axis], out[count, 3 + axis] = position[axis], normal[axis]
        out[count, 6] = depth
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _corner(heights: Values, cell: Values, row: int, column: int) -> Tuple[float, float, float]:
    """Return the place of a sample; ``cell`` holds the size of a cell along x and y [m]."""
    return (cell[0] * (column - 0.5 * (heights.shape[1] - 1)), cell[1] * (0.5 * (heights.shape[0] - 1) - row),
            heights[row, column])


@njit(cache=True, nogil=True, error_model="numpy")
def _below(heights: Values, cell: Values, x: float, y: float) -> Tuple[float, float, float]:
    """Return height and slopes along x and y of the ground at a place; nan outside."""
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
def _window(heights: Values, tops: Values, cell: Values, centre: Values, reach: Values,
            window: NDArray[np.int64]) -> bool:
    """Write first and last row and column of the cells below a box; return whether any reaches up to it."""
    rows, columns = heights.shape[0] - 1, heights.shape[1] - 1
    left, right = (centre[0] - reach[0]) / cell[0] + 0.5 * columns, (centre[0] + reach[0]) / cell[0] + 0.5 * columns
    top, bottom = 0.5 * rows - (centre[1] + reach[1]) / cell[1], 0.5 * rows - (centre[1] - reach[1]) / cell[1]
    if not (right >= 0.0 and left <= columns and bottom >= 0.0 and top <= rows):
        return False
    window[0], window[1] = max(0, int(math.floor(max(top, 0.0)))), min(rows - 1, int(min(bottom, rows)))
    window[2], window[3] = max(0, int(math.floor(max(left, 0.0)))), min(columns - 1, int(min(right, columns)))
    window[0], window[2] = min(window[0], rows - 1), min(window[2], columns - 1)
    lowest = centre[2] - reach[2]
    for row in range(window[0] // BLOCK, window[1] // BLOCK + 1):
        for column in range(window[2] // BLOCK, window[3] // BLOCK + 1):
            if tops[row, column] >= lowest:
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _narrow(heights: Values, tops: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float,
            reach: Values, window: NDArray[np.int64]) -> bool:
    """Narrow the window to what of a ball or wheel is below the greatest height in it; return whether there is any.

    ``frame`` and ``half`` as for :func:`_near_triangles`.
    """
    greatest = -math.inf
    for row in range(window[0], window[1] + 2):
        for column in range(window[2], window[3] + 2):
            greatest = max(greatest, heights[row, column])
    above = centre[2] - greatest
    if half == 0.0:
        if above >= radius:
            return False
        if above > 0.0:
            reach[0] = reach[1] = math.sqrt(radius * radius - above * above)
            return _window(heights, tops, cell, centre, reach, window)
        return True
    level = math.sqrt(frame[2, 0] * frame[2, 0] + frame[2, 1] * frame[2, 1])    # sine of the axis with the vertical
    if level < 0.7:
        return True
    low = (above - half * abs(frame[2, 2])) / level         # along the steepest direction in the plane of the wheel
    if low >= radius:
        return False
    if low > 0.0:
        across, down = math.sqrt(radius * radius - low * low) / level, radius * abs(frame[2, 2]) / level + half
        for axis in range(2):
            reach[axis] = across * abs(frame[2, 1 - axis]) + down * abs(frame[2, axis])
        return _window(heights, tops, cell, centre, reach, window)
    return True


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
def _nearest_to_axis(polygon: Values, count: int, radius: float, found: Values) -> None:
    """Write a row of near points, up to its distances, for a polygon.

    First and last s are those of all points nearest to the axis, of an edge each, that are in contact in about the same
    direction: the contact of a wheel is in the middle even if it leans by less than its contact is deep.
    """
    found[_N_DISTANCE] = math.inf
    for again in range(2):
        for index in range(count):
            after = index + 1 if index + 1 < count else 0
            du, dv = polygon[after, 0] - polygon[index, 0], polygon[after, 1] - polygon[index, 1]
            length = du * du + dv * dv
            share = 0.0
            if length > 0.0:
                share = min(max(-(polygon[index, 0] * du + polygon[index, 1] * dv) / length, 0.0), 1.0)
            u, v = polygon[index, 0] + share * du, polygon[index, 1] + share * dv
            s = polygon[index, 2] + share * (polygon[after, 2] - polygon[index, 2])
            distance = math.sqrt(u * u + v * v)
            if again == 0:
                if distance < found[_N_DISTANCE]:
                    found[_N_DISTANCE], found[_N_U], found[_N_V] = distance, u, v
                    found[_N_FIRST] = found[_N_LAST] = s
                    found[_N_FIRST_DISTANCE] = found[_N_LAST_DISTANCE] = distance
            elif distance < radius and (u * found[_N_U] + v * found[_N_V]
                                        > _SAME_PLANE * distance * found[_N_DISTANCE]):
                if s < found[_N_FIRST]:
                    found[_N_FIRST], found[_N_FIRST_DISTANCE] = s, distance
                if s > found[_N_LAST]:
                    found[_N_LAST], found[_N_LAST_DISTANCE] = s, distance
        if found[_N_DISTANCE] >= radius:
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
def _apart(polygon: Values, radius: float, half: float) -> bool:
    """Return whether a plane across the direction of a triangle's middle shows that it is farther than ``radius``."""
    solid = 0.0 if half > 0.0 else 1.0
    u, v = polygon[0, 0] + polygon[1, 0] + polygon[2, 0], polygon[0, 1] + polygon[1, 1] + polygon[2, 1]
    s = solid * (polygon[0, 2] + polygon[1, 2] + polygon[2, 2])
    limit = radius * math.sqrt(u * u + v * v + s * s)
    for corner in range(3):
        if u * polygon[corner, 0] + v * polygon[corner, 1] + s * polygon[corner, 2] <= limit:
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _near_triangles(heights: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float,
                    window: NDArray[np.int64], near: Values) -> int:
    """Write the triangles closer than ``radius``, with their nearest points; return their number.

    ``frame`` has the directions u, v, s; s is the axis.  ``half`` is half the width, 0 for a ball.
    """
    corners, polygon, found = np.empty((4, 3)), np.empty((8, 3)), np.empty(_FOUND_WORDS)
    kept = np.empty((8, 3))
    count, flat = 0, cell[0] * cell[0] + cell[1] * cell[1]
    for row in range(window[0], window[1] + 1):
        for column in range(window[2], window[3] + 1):
            low = high = heights[row, column]
            for number in range(1, 4):
                height = heights[row + number // 2, column + number % 2]
                low, high = min(low, height), max(high, height)
            x, y, _ = _corner(heights, cell, row, column)
            px, py = x + 0.5 * cell[0] - centre[0], y - 0.5 * cell[1] - centre[1]
            pz = 0.5 * (low + high) - centre[2]
            bound = 0.5 * math.sqrt(flat + (high - low) * (high - low))
            s = px * frame[2, 0] + py * frame[2, 1] + pz * frame[2, 2]
            away = px * px + py * py + pz * pz - (s * s if half > 0.0 else 0.0)
            if away > (radius + bound) * (radius + bound) or (half > 0.0 and abs(s) > half + bound):
                continue
            for number in range(4):
                x, y, z = _corner(heights, cell, row + number // 2, column + number % 2)
                for axis in range(3):
                    corners[number, axis] = ((x - centre[0]) * frame[axis, 0] + (y - centre[1]) * frame[axis, 1]
                                             + (z - centre[2]) * frame[axis, 2])
            for part in range(2):       # corners 0 1 / 2 3; the diagonal is from 2 to 1
                for axis in range(3):
                    polygon[0, axis], polygon[1, axis] = corners[2, axis], corners[1, axis]
                    polygon[2, axis] = corners[3 * part, axis]
                if _apart(polygon, radius, half):
                    continue
                if half > 0.0:
                    sides = _clip(polygon, 3, half, kept)
                    if sides == 0:
                        continue
                    _nearest_to_axis(polygon, sides, radius, found)
                else:
                    _nearest_to_point(polygon, found)
                if found[_N_DISTANCE] < radius and count < near.shape[0]:
                    for word in range(_FOUND_WORDS):
                        near[count, word] = found[word]
                    near[count, _N_ROW], near[count, _N_COLUMN], near[count, _N_HALF] = row, column, part
                    count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _mark_closest(heights: Values, cell: Values, centre: Values, frame: Values, near: Values, count: int) -> None:
    """Mark the nearest points from which the ground leads no closer: they are in no triangle that comes closer."""
    for index in range(count):
        u, v, s = near[index, _N_U], near[index, _N_V], 0.5 * (near[index, _N_FIRST] + near[index, _N_LAST])
        x = centre[0] + u * frame[0, 0] + v * frame[1, 0] + s * frame[2, 0]
        y = centre[1] + u * frame[0, 1] + v * frame[1, 1] + s * frame[2, 1]
        across, down = x / cell[0] + 0.5 * (heights.shape[1] - 1), 0.5 * (heights.shape[0] - 1) - y / cell[1]
        near[index, _N_OPEN] = 1.0
        for other in range(count):
            if near[other, _N_DISTANCE] < near[index, _N_DISTANCE] - _TIE:
                right, up = across - near[other, _N_COLUMN], 1.0 - (down - near[other, _N_ROW])
                if -1e-7 <= right <= 1.0 + 1e-7 and -1e-7 <= up <= 1.0 + 1e-7 \
                        and (up >= right - 1e-7 if near[other, _N_HALF] == 0.0 else right >= up - 1e-7):
                    near[index, _N_OPEN] = 0.0
                    break


@njit(cache=True, nogil=True, error_model="numpy")
def _sunk(heights: Values, cell: Values, centre: Values, radius: float, out: Values) -> int:
    """Write the contact of a ball or wheel whose centre is below the ground; return 1, or 0 if it is above."""
    ground, along, upwards = _below(heights, cell, centre[0], centre[1])
    if not ground > centre[2]:
        return 0
    scale = 1.0 / math.sqrt(1.0 + along * along + upwards * upwards)
    return _add(out, 0, (centre[0], centre[1], ground), (-along * scale, -upwards * scale, scale),
                radius + (ground - centre[2]) * scale)


@njit(cache=True, nogil=True, error_model="numpy")
def _round(heights: Values, tops: Values, cell: Values, centre: Values, frame: Values, radius: float, half: float,
           wheel: bool, reach: Values, window: NDArray[np.int64], out: Values) -> int:
    """Write the contacts of a ball, or of the curved side of a cylinder along the third direction of ``frame``."""
    if _sunk(heights, cell, centre, radius, out):
        return 1
    if not _narrow(heights, tops, cell, centre, frame, radius, half, reach, window):
        return 0
    near = np.empty((_MOST_NEAR, _NEAR_WORDS))
    found = _near_triangles(heights, cell, centre, frame, radius, half, window, near)
    _mark_closest(heights, cell, centre, frame, near, found)
    solid = 0.0 if half > 0.0 else 1.0
    count = 0
    while count < out.shape[0] - 1:
        best = -1
        for index in range(found):
            if near[index, _N_OPEN] > 0.0 and (best < 0 or near[index, _N_DISTANCE] < near[best, _N_DISTANCE]):
                best = index
        if best < 0 or near[best, _N_DISTANCE] < _TIE:
            break
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
            count = _add(out, count, (centre[0] + u * frame[0, 0] + v * frame[1, 0] + s * frame[2, 0],
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


@njit(cache=True, nogil=True, error_model="numpy")
def _point(heights: Values, cell: Values, x: float, y: float, z: float, out: Values, count: int) -> int:
    """Write the contact of a point of a shape, if it is below the ground."""
    ground, along, upwards = _below(heights, cell, x, y)
    if ground > z:
        scale = 1.0 / math.sqrt(1.0 + along * along + upwards * upwards)
        count = _add(out, count, (x, y, z), (-along * scale, -upwards * scale, scale), (ground - z) * scale)
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
def _peaks(heights: Values, cell: Values, centre: Values, axes: Values, halves: Values, rounded: bool,
           window: NDArray[np.int64], out: Values, count: int) -> int:
    """Write the contacts of convex samples inside a box, or a cylinder if ``rounded``; the nearest face decides."""
    for row in range(window[0], window[1] + 2):
        for column in range(window[2], window[3] + 2):
            if heights[row, column] < centre[2] - halves[3] or not _convex(heights, row, column):
                continue
            x, y, z = _corner(heights, cell, row, column)
            least, face, sign = math.inf, 0, 0.0
            for axis in range(3):
                along = ((x - centre[0]) * axes[axis, 0] + (y - centre[1]) * axes[axis, 1]
                         + (z - centre[2]) * axes[axis, 2])
                side = 1.0 if along > 0.0 else -1.0
                inside = halves[axis] - abs(along)
                if inside < 0.0:
                    least = -1.0
                    break
                if inside < least and side * axes[axis, 2] < 0.3 and not (rounded and axis < 2):
                    least, face, sign = inside, axis, -side
            if 0.0 < least < math.inf:
                count = _add(out, count, (x, y, z),
                             (sign * axes[face, 0], sign * axes[face, 1], sign * axes[face, 2]), least)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _box(heights: Values, cell: Values, centre: Values, axes: Values, halves: Values, window: NDArray[np.int64],
         out: Values) -> int:
    """Write the contacts of a box: its corners, points along its edges, convex points of the ground in it."""
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
            for part in range(1, parts):
                along = halves[axis] * (2.0 * part / parts - 1.0)
                count = _point(heights, cell, x + along * axes[axis, 0], y + along * axes[axis, 1],
                               z + along * axes[axis, 2], out, count)
    return _peaks(heights, cell, centre, axes, halves, False, window, out, count)


@njit(cache=True, nogil=True, error_model="numpy")
def _upright(heights: Values, cell: Values, centre: Values, axes: Values, radius: float, half: float,
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
    return _peaks(heights, cell, centre, axes, halves, True, window, out, count)


@njit(cache=True, nogil=True, error_model="numpy")
def height_contacts(heights: Values, tops: Values, cell: Values, field: Values, kind: int, size: Values, pose: Values,
                    out: Values) -> int:
    """Find the contacts of a shape with a heightmap.

    Parameters
    ----------
    heights : (rows, columns) float64
    tops : (block rows, block columns) float64
        From :func:`tops_of`.
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

    Returns
    -------
    int
        Number of contacts.
    """
    centre, axes = _into(field, pose)
    reach, halves, window = np.empty(3), np.empty(4), np.empty(4, np.int64)
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
    if not _window(heights, tops, cell, centre, reach, window):
        return 0
    if kind == BOX:
        count = _box(heights, cell, centre, axes, halves, window, out)
    elif kind == SPHERE:
        count = _round(heights, tops, cell, centre, axes, size[0], 0.0, False, reach, window, out)
    elif kind == CYLINDER and abs(axes[2, 2]) > 0.7:
        halves[2] = 0.5 * size[1]
        count = _upright(heights, cell, centre, axes, size[0], 0.5 * size[1], halves, window, out)
    else:
        count = _round(heights, tops, cell, centre, axes, size[0], 0.5 * size[1], kind == WHEEL, reach, window, out)
    for index in range(count):          # back to libode's axes, then to the world
        for first in (0, 3):
            x, y, z = _turn(field, out[index, first], out[index, first + 2], -out[index, first + 1], 1.0)
            for axis in range(3):
                out[index, first + axis] = (x, y, z)[axis] + (field[axis] if first == 0 else 0.0)
    return count
