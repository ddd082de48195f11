# SPDX-License-Identifier: BSD-3-Clause
"""The way out for a robot whose outline is in an obstacle: motions that make the overlap smaller."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.controllers.rollout_kernels import roll_out, step_count
from m2wr_navigation.costmap.cost_layout import LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Uint8Array

MOST_CELLS = 4000           # that are looked at; a robot that has more around it has no way out
_SLOW = 1e-3                # s: of motions that lead out alike, the slower one; m of overlap per m/s
_ROUNDING = 1e-6            # m
_PROGRESS = 0.02            # share by which a motion has to lessen the overlap


@kernel
def _blocked(costs: Uint8Array, row: int, column: int) -> bool:
    """Return whether a cell is lethal, unknown, or outside of the grid."""
    if not (0 <= row < costs.shape[0] and 0 <= column < costs.shape[1]):
        return True
    return costs[row, column] == LETHAL or costs[row, column] == NO_INFORMATION


@kernel
def obstacles_around(costs: Uint8Array, resolution: float, origin: FloatArray, x: float, y: float,
                     radii: Tuple[float, float], out: FloatArray) -> int:
    """Write the centres of the lethal and unknown cells around a robot; return their number.

    Parameters
    ----------
    costs, resolution, origin
        The local costmap.
    x, y : float
        [m]
    radii : (float, float)
        All cells count within the first one, within the second one those with a free neighbour at a side: a robot
        comes into the others only through these [m].
    out : (N, 2) float64
        Written; cells that find no place are left out [m].

    Returns
    -------
    int
    """
    count = 0
    radius = radii[1]
    top = max(0, int((y - radius - origin[1]) / resolution))
    bottom = min(costs.shape[0], int((y + radius - origin[1]) / resolution) + 1)
    left = max(0, int((x - radius - origin[0]) / resolution))
    right = min(costs.shape[1], int((x + radius - origin[0]) / resolution) + 1)
    for row in range(top, bottom):
        for column in range(left, right):
            if not _blocked(costs, row, column) or count == len(out):
                continue
            across, along = origin[0] + (column + 0.5) * resolution, origin[1] + (row + 0.5) * resolution
            far = math.hypot(across - x, along - y)
            if far > radius or (far > radii[0] and _blocked(costs, row - 1, column) and _blocked(
                    costs, row + 1, column) and _blocked(costs, row, column - 1) and _blocked(costs, row, column + 1)):
                continue
            out[count, 0], out[count, 1] = across, along
            count += 1
    return count


@kernel
def overlap(points: FloatArray, margin: float, footprint: FloatArray, x: float, y: float,
            yaw: float) -> Tuple[float, float]:
    """Return the sum of the depths of points inside a footprint, and the greatest depth [m].

    Parameters
    ----------
    points : (N, 2) float64
        Centres of cells [m].
    margin : float
        Added to the depth, for the size of a cell [m].
    footprint : (K, 2) float64
        Corners in the base frame [m].
    x, y, yaw : float
        Of the base, in the frame of the points [m, m, rad].
    """
    cosine, sine = math.cos(yaw), math.sin(yaw)
    total = deepest = farthest = 0.0
    for corner in range(len(footprint)):
        farthest = max(farthest, math.hypot(footprint[corner, 0], footprint[corner, 1]))
    farthest = (farthest + margin) ** 2
    for k in range(len(points)):
        if (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 >= farthest:
            continue
        a = cosine * (points[k, 0] - x) + sine * (points[k, 1] - y)
        b = cosine * (points[k, 1] - y) - sine * (points[k, 0] - x)
        inside, nearest = False, math.inf
        before = len(footprint) - 1
        for corner in range(len(footprint)):
            ax, ay = footprint[before, 0], footprint[before, 1]
            bx, by = footprint[corner, 0], footprint[corner, 1]
            dx, dy = bx - ax, by - ay
            share = ((a - ax) * dx + (b - ay) * dy) / max(dx * dx + dy * dy, 1e-12)
            share = min(max(share, 0.0), 1.0)
            nearest = min(nearest, math.hypot(a - ax - share * dx, b - ay - share * dy))
            if (by > b) != (ay > b) and a < bx + (b - by) / (ay - by) * (ax - bx):
                inside = not inside
            before = corner
        depth = (nearest if inside else -nearest) + margin
        total += max(depth, 0.0)
        deepest = max(deepest, depth)
    return total, deepest


@kernel
def best_way_out(samples: FloatArray, start: FloatArray, velocity: FloatArray, acceleration: FloatArray,
                 rolled: FloatArray, points: FloatArray, margin: float, footprint: FloatArray) -> int:
    """Return the index of the velocity that lessens the overlap most; -1 if none does.

    Neither the overlap nor its greatest depth may rise on the way: a corner must not cut through a thin wall.

    Parameters
    ----------
    samples : (N, 3) float64
        Velocities [m/s, m/s, rad/s].
    start, velocity, acceleration : (3,) float64
        As for ``roll_out``.
    rolled : (4,) float64
        sim_time [s], sim_granularity [m], angular_sim_granularity [rad], greatest number of poses.
    points, margin, footprint
        As for :func:`overlap`.
    """
    most = int(rolled[3])
    poses = np.empty((most, 3))
    before, deepest = overlap(points, margin, footprint, start[0], start[1], start[2])
    best, least = -1, (1.0 - _PROGRESS) * before
    for i in range(len(samples)):
        steps = step_count(samples[i], rolled[0], rolled[1], rolled[2], most)
        roll_out(start, velocity, samples[i], acceleration, rolled[0], steps, poses)
        slow = _SLOW * (math.hypot(samples[i, 0], samples[i, 1]) + abs(samples[i, 2]))
        now = before
        for k in range(1, steps):
            now, depth = overlap(points, margin, footprint, poses[k, 0], poses[k, 1], poses[k, 2])
            if now > before + _ROUNDING or depth > deepest + _ROUNDING:
                now = math.inf
                break
        if now + slow < least:
            best, least = i, now + slow
    return best
