# SPDX-License-Identifier: BSD-3-Clause
"""Tangents and arcs between circles around the corners of inflated convex polygons.

A convex polygon inflated by r is bounded by arcs of radius r around its corners and by segments between them. A
shortest path around such obstacles consists of arcs of these circles and of tangents of two of them (Laumond 1987).
All arrays: ``points`` (N, 2) corners of all polygons [m]; ``first`` (K + 1,) index of each polygon's first corner;
``radii`` (K,) inflation of each polygon [m]; ``circles`` (C, 3) centre and radius [m].
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray

SLACK = 1e-9            # m: rounding of a line that is tangent to a circle; a path may enter an obstacle so far
_SAME = 1e-12           # m: circles with this distance of their centres have no tangents


@kernel
def _point_to_edge(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the square of the distance of a point from a segment [m^2]."""
    along_x, along_y = bx - ax, by - ay
    square = along_x * along_x + along_y * along_y
    share = 0.0
    if square > 0.0:
        share = min(max(((x - ax) * along_x + (y - ay) * along_y) / square, 0.0), 1.0)
    off_x, off_y = x - ax - share * along_x, y - ay - share * along_y
    return off_x * off_x + off_y * off_y


@kernel
def point_distance(points: FloatArray, begin: int, end: int, x: float, y: float) -> float:
    """Return the distance of a point from a convex polygon, 0 inside [m].

    Parameters
    ----------
    points : (N, 2) float64
    begin, end : int
        The polygon's corners are ``points[begin:end]``, counter-clockwise.
    x, y : float
        [m]
    """
    least, inside = np.inf, end - begin > 2
    for k in range(begin, end):
        after = k + 1 if k + 1 < end else begin
        ax, ay, bx, by = points[k, 0], points[k, 1], points[after, 0], points[after, 1]
        least = min(least, _point_to_edge(x, y, ax, ay, bx, by))
        if (bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0.0:
            inside = False
    return 0.0 if inside else math.sqrt(least)


@kernel
def crosses(line: Tuple[float, float, float, float], ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether two segments cross.

    Parameters
    ----------
    line : (float, float, float, float)
        x, y of the ends of one [m].
    ax, ay, bx, by : float
        Of the ends of the other [m].
    """
    px, py, qx, qy = line
    first = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    second = (qx - px) * (by - py) - (qy - py) * (bx - px)
    third = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    fourth = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    return first * second < 0.0 and third * fourth < 0.0


@kernel
def is_line_free(points: FloatArray, first: IndexArray, radii: FloatArray,
                 line: Tuple[float, float, float, float]) -> bool:
    """Return whether a segment keeps the distance ``radii`` from all polygons.

    Parameters
    ----------
    points : (N, 2) float64
    first : (K + 1,) int64
    radii : (K,) float64
    line : (float, float, float, float)
        x, y of its ends [m].
    """
    px, py, qx, qy = line
    for k in range(len(radii)):
        begin, end, needed = first[k], first[k + 1], radii[k] - SLACK
        if end - begin > 2 and (point_distance(points, begin, end, px, py) < needed
                                or point_distance(points, begin, end, qx, qy) < needed):
            return False
        for j in range(begin, end):
            after = j + 1 if j + 1 < end else begin
            ax, ay, bx, by = points[j, 0], points[j, 1], points[after, 0], points[after, 1]
            if _point_to_edge(ax, ay, px, py, qx, qy) < needed * needed \
                    or _point_to_edge(px, py, ax, ay, bx, by) < needed * needed \
                    or _point_to_edge(qx, qy, ax, ay, bx, by) < needed * needed or crosses(line, ax, ay, bx, by):
                return False
    return True


@kernel
def is_point_free(points: FloatArray, first: IndexArray, radii: FloatArray, x: float, y: float) -> bool:
    """Return whether a point keeps the distance ``radii`` from all polygons.

    Parameters
    ----------
    points : (N, 2) float64
    first : (K + 1,) int64
    radii : (K,) float64
    x, y : float
        [m]
    """
    for k in range(len(radii)):
        if point_distance(points, first[k], first[k + 1], x, y) < radii[k] - SLACK:
            return False
    return True


@kernel
def tangents(points: FloatArray, first: IndexArray, radii: FloatArray, circles: FloatArray,
             used: IndexArray) -> Tuple[IndexArray, FloatArray, FloatArray]:
    """Return the free common tangents of all pairs of circles.

    The unit normal n of a tangent has n . (c2 - c1) = s2 r2 - s1 r1, where s1, s2 = +-1 are the sides.

    Parameters
    ----------
    points : (N, 2) float64
    first : (K + 1,) int64
    radii : (K,) float64
    circles : (C, 3) float64
    used : (U,) int64
        The circles that count.

    Returns
    -------
    pairs : (T, 2) int64
        The two circles.
    angles : (T, 2) float64
            Where the tangent meets them [rad].
    lengths : (T,) float64
        [m]
    """
    room = 64
    pairs, angles, lengths = np.empty((room, 2), np.int64), np.empty((room, 2)), np.empty(room)
    count = 0
    for one in range(len(used)):
        for two in range(one + 1, len(used)):
            i, j = used[one], used[two]
            across, up = circles[j, 0] - circles[i, 0], circles[j, 1] - circles[i, 1]
            far = math.hypot(across, up)
            if far < _SAME:
                continue
            ahead = math.atan2(up, across)
            for kind in range(4):
                side, turn = 1.0 if kind < 2 else -1.0, 1.0 if kind % 2 == 0 else -1.0
                if (kind > 1 and (circles[i, 2] == 0.0 or circles[j, 2] == 0.0)) \
                        or (kind > 0 and circles[i, 2] == 0.0 and circles[j, 2] == 0.0):
                    continue            # the same line again
                share = (side * circles[j, 2] - circles[i, 2]) / far
                if abs(share) > 1.0:
                    continue
                normal = ahead + turn * math.acos(share)
                at_i, at_j = normal + math.pi, normal + (math.pi if side > 0.0 else 0.0)
                line = (circles[i, 0] + circles[i, 2] * math.cos(at_i), circles[i, 1] + circles[i, 2] * math.sin(at_i),
                        circles[j, 0] + circles[j, 2] * math.cos(at_j), circles[j, 1] + circles[j, 2] * math.sin(at_j))
                if not is_line_free(points, first, radii, line):
                    continue
                if count == room:
                    room *= 2
                    more_pairs, more_angles, more_lengths = np.empty((room, 2), np.int64), np.empty((room, 2)), \
                        np.empty(room)
                    more_pairs[:count], more_angles[:count], more_lengths[:count] = pairs, angles, lengths
                    pairs, angles, lengths = more_pairs, more_angles, more_lengths
                pairs[count, 0], pairs[count, 1] = i, j
                angles[count, 0], angles[count, 1] = at_i % (2.0 * math.pi), at_j % (2.0 * math.pi)
                lengths[count] = math.hypot(line[2] - line[0], line[3] - line[1])
                count += 1
    return pairs[:count].copy(), angles[:count].copy(), lengths[:count].copy()


@kernel
def free_limits(points: FloatArray, first: IndexArray, radii: FloatArray, circle: FloatArray) -> FloatArray:
    """Return the angles (A,) at which free arcs of a circle may begin or end [rad].

    They are where it meets the boundary of an inflated polygon: circles around corners, and edges moved outwards.

    Parameters
    ----------
    points : (N, 2) float64
    first : (K + 1,) int64
    radii : (K,) float64
    circle : (3,) float64
    """
    found, count = np.empty(4 * len(points)), 0
    x, y, radius = circle[0], circle[1], circle[2]
    for k in range(len(radii)):
        for j in range(first[k], first[k + 1]):
            after = j + 1 if j + 1 < first[k + 1] else first[k]
            across, up = points[j, 0] - x, points[j, 1] - y
            far = math.hypot(across, up)
            for kind in range(2):
                if kind == 0:           # the circle around the corner
                    if far < _SAME:
                        continue
                    share, middle = (far * far + radius * radius - radii[k] ** 2) / (2.0 * far * radius), \
                        math.atan2(up, across)
                else:                   # the edge that begins there
                    run, rise = points[after, 0] - points[j, 0], points[after, 1] - points[j, 1]
                    length = math.hypot(run, rise)
                    if length < _SAME:
                        continue
                    middle = math.atan2(-run, rise)
                    share = ((across * rise - up * run) / length + radii[k]) / radius
                if abs(share) > 1.0:
                    continue
                for turn in (-1.0, 1.0):
                    angle = middle + turn * math.acos(share)
                    if is_point_free(points, first, radii, x + radius * math.cos(angle), y + radius * math.sin(angle)):
                        found[count] = angle % (2.0 * math.pi)
                        count += 1
    return found[:count].copy()


@kernel
def free_arcs(points: FloatArray, first: IndexArray, radii: FloatArray, circle: FloatArray,
              angles: FloatArray) -> FloatArray:
    """Return the lengths (A,) of the arcs from each angle to the next one, the last to the first; inf: not free.

    Parameters
    ----------
    points : (N, 2) float64
    first : (K + 1,) int64
    radii : (K,) float64
    circle : (3,) float64
    angles : (A,) float64
        Sorted, with all limits of free arcs among them [rad].
    """
    arcs = np.empty(len(angles))
    for k in range(len(angles)):
        after = angles[k + 1] if k + 1 < len(angles) else angles[0] + 2.0 * math.pi
        middle = 0.5 * (angles[k] + after)
        free = is_point_free(points, first, radii, circle[0] + circle[2] * math.cos(middle),
                             circle[1] + circle[2] * math.sin(middle))
        arcs[k] = circle[2] * (after - angles[k]) if free else np.inf
    return arcs
