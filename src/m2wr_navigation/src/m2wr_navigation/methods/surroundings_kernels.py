# SPDX-License-Identifier: BSD-3-Clause
"""Compiled rules of :mod:`motion_plan.surroundings`: which points are kept after a scan, how far a disc can travel.

``limits`` (4,) are the greatest range of a point when it is stored, and while it is, the distance by which a beam has
to pass a point to clear it, and the side of a cell [m].
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_maps.pose_kernels import wrapped
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray

_ROW = 1000003              # cells in a row of the grid of points, more than any range: prime, as in _first_in_cells


@kernel
def _cell(x: float, y: float, side: float) -> int:
    """Return the number of the cell of a point."""
    return int(math.floor(x / side)) * _ROW + int(math.floor(y / side))


@kernel
def _is_own(x: float, y: float, parts: FloatArray) -> bool:
    """Return whether a point of the robot's frame is on a part of it."""
    for part in range(parts.shape[0]):
        if parts[part, 0] < x < parts[part, 1] and parts[part, 2] < abs(y) < parts[part, 3]:
            return True
    return False


@kernel
def _least(one: float, two: float) -> float:
    """Return the lesser of two readings; one that is not a number does not count."""
    if one != one or two < one:
        return two
    return one


@kernel
def _is_seen(readings: FloatArray, angles: FloatArray, increment: float, bearing: float, distance: float,
             margin: float) -> bool:
    """Return whether a point is covered by a scan: inside its field of view, and not hidden."""
    last = len(readings) - 1
    middle = 0.5 * (angles[0] + angles[last])
    beam = int(np.rint((middle + wrapped(bearing - middle) - angles[0]) / increment))
    if beam < 0 or beam > last:
        return False
    beam = min(max(beam, 1), last - 1) if last > 1 else 0
    # the least of three beams: a thin post must not be cleared by the beam that passes beside it
    through = _least(_least(readings[max(beam - 1, 0)], readings[min(beam + 1, last)]), readings[beam])
    return distance < through + margin


@kernel
def _new_points(readings: FloatArray, cosines: FloatArray, sines: FloatArray, place: FloatArray, limits: FloatArray,
                parts: FloatArray, found: FloatArray, cells: IndexArray) -> int:
    """Write the points of a scan and their cells; return how many. Of neighbours in one cell the first counts."""
    ahead, left, laser_x, laser_y, cos_yaw, sin_yaw = place[0], place[1], place[2], place[3], place[4], place[5]
    count = 0
    for beam in range(len(readings)):
        reading = readings[beam]
        if not reading < limits[0]:
            continue
        local_x, local_y = reading * cosines[beam], reading * sines[beam]
        if _is_own(ahead + local_x, left + local_y, parts):
            continue
        x, y = laser_x + cos_yaw * local_x - sin_yaw * local_y, laser_y + sin_yaw * local_x + cos_yaw * local_y
        cell = _cell(x, y, limits[3])
        if count == 0 or cells[count - 1] != cell:
            found[count, 0], found[count, 1], cells[count] = x, y, cell
            count += 1
    return count


@kernel
def points_after(readings: FloatArray, angles: FloatArray, cosines: FloatArray, sines: FloatArray, increment: float,
                 place: FloatArray, yaw: float, limits: FloatArray, parts: FloatArray,
                 points: FloatArray) -> FloatArray:
    """Return the points (N, 2) after a scan, in the order of their cells, one in each [m].

    Parameters
    ----------
    readings : (B,) float64
        Not less than the least range [m].
    angles, cosines, sines : (B,) float64
        Of the beams [rad].
    increment : float
        Between two beams [rad].
    place : (6,) float64
        Of the laser in the robot's frame and in the odometry frame [m], cosine and sine of the robot's yaw.
    yaw : float
        Of the robot in the odometry frame [rad].
    limits : (4,) float64
    parts : (P, 4) float64
        See :class:`motion_plan.surroundings.Surroundings`, with its margin.
    points : (M, 2) float64
        Those before the scan, a result of this function or empty [m].
    """
    found, cells = np.empty((len(readings), 2)), np.empty(len(readings), np.int64)
    count = _new_points(readings, cosines, sines, place, limits, parts, found, cells)
    order = np.argsort(cells[:count], kind='mergesort')
    out = np.empty((count + len(points), 2))
    new, rows, last = 0, 0, -1
    for old in range(len(points) + 1):          # both are in the order of cells; in a cell a new point counts
        cell = np.iinfo(np.int64).max
        if old < len(points):
            across, up = points[old, 0] - place[2], points[old, 1] - place[3]
            distance = math.hypot(across, up)
            bearing = wrapped(math.atan2(up, across) - yaw)
            if not distance < limits[1] or _is_seen(readings, angles, increment, bearing, distance, limits[2]):
                continue
            cell = _cell(points[old, 0], points[old, 1], limits[3])
        while new < count and cells[order[new]] <= cell:
            if last < 0 or cells[order[new]] != cells[order[last]]:
                out[rows] = found[order[new]]
                rows, last = rows + 1, new
            new += 1
        if old < len(points) and (last < 0 or cells[order[last]] != cell):
            out[rows] = points[old]
            rows += 1
    return out[:rows]


@kernel
def _travel(points: FloatArray, x: float, y: float, cosine: float, sine: float, radius: float) -> Tuple[float, int]:
    """Return how far a disc can travel in a direction [m], and the row of the point that ends it or -1."""
    least, blocker = math.inf, -1
    for row in range(len(points)):
        across, up = points[row, 0] - x, points[row, 1] - y
        along = cosine * across + sine * up
        if along <= 0.0:
            continue
        beside = cosine * up - sine * across
        reach = radius * radius - beside * beside
        if reach <= 0.0:
            continue
        travel = max(along - math.sqrt(reach), 0.0)
        if travel < least:
            least, blocker = travel, row
    return least, blocker


@kernel
def free_travel(points: FloatArray, x: float, y: float, cosines: FloatArray, sines: FloatArray,
                radius: float) -> Tuple[FloatArray, IndexArray]:
    """Return the result of :meth:`motion_plan.surroundings.Surroundings.free_travel`.

    Parameters
    ----------
    points : (N, 2) float64
        [m]
    x, y, radius : float
        Of the disc [m].
    cosines, sines : (D,) float64
        Of the directions.
    """
    travel, blockers = np.empty(len(cosines)), np.empty(len(cosines), np.int64)
    for number in range(len(cosines)):
        travel[number], blockers[number] = _travel(points, x, y, cosines[number], sines[number], radius)
    return travel, blockers


@kernel
def first_free(points: FloatArray, x: float, y: float, cosines: FloatArray, sines: FloatArray, radius: float,
               distance: float) -> Tuple[int, int]:
    """Return the result of :meth:`motion_plan.surroundings.Surroundings.first_free`.

    Parameters
    ----------
    points, x, y, cosines, sines, radius
        As for `free_travel`.
    distance : float
        Required free travel [m].
    """
    rows, near = np.empty(len(points), np.int64), np.empty((len(points), 2))
    count = 0
    for row in range(len(points)):              # others cannot end a travel of this length; a margin for rounding
        across, up = points[row, 0] - x, points[row, 1] - y
        if across * across + up * up < (distance + radius) ** 2 + 1e-6:
            near[count], rows[count] = points[row], row
            count += 1
    before = -1
    for number in range(len(cosines)):
        travel, blocker = _travel(near[:count], x, y, cosines[number], sines[number], radius)
        if travel >= distance:
            return number, before
        before = rows[blocker]
    return -1, before
