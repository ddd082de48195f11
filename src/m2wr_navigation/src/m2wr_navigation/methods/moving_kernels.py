# SPDX-License-Identifier: BSD-3-Clause
"""Groups of the points of a scan, and which points lie where an earlier scan saw free space."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray

FIT_STEPS = 5               # of the fit of a circle


@kernel
def groups_of(points: FloatArray, beams: IndexArray, gap: float, out: IndexArray) -> int:
    """Number the groups of points in the order of their beams.

    Parameters
    ----------
    points : (N, 2) float64
        [m]
    beams : (N,) int64
        Which beam hit each, rising.
    gap : float
        Two points that follow each other and are farther apart belong to two groups [m].
    out : (N,) int64
        Written: the number of each point's group.

    Returns
    -------
    int
        How many groups there are.
    """
    count = 0
    for k in range(len(points)):
        if k > 0:
            away = math.hypot(points[k, 0] - points[k - 1, 0], points[k, 1] - points[k - 1, 1])
            if beams[k] - beams[k - 1] > 2 or away > gap:
                count += 1
        out[k] = count
    return count + 1 if len(points) else 0


@kernel
def discs_around(points: FloatArray, beams: IndexArray, groups: IndexArray, fresh: BoolArray, laser: FloatArray,
                 ranges: FloatArray, out: FloatArray) -> None:
    """Write the disc of each group: as wide as the group looks, and behind its points by what a round body would be.

    Parameters
    ----------
    points : (N, 2) float64
        [m]
    beams, groups : (N,) int64
        As of :func:`groups_of`.
    fresh : (N,) bool
        As of :func:`mark_fresh`.
    laser : (2,) float64
        Where the points are seen from [m].
    ranges : (B,) float64
        Of all beams [m].
    out : (G, 8) float64
        Written: x, y, radius [m], number of points, share of fresh points, 1 if both ends are in sight and 0 if
        something nearer hides an end or the scan ends there, number of the first point and that after the last.
    """
    out[:] = 0.0
    out[:, 5] = 1.0
    for k in range(len(points)):
        g = groups[k]
        out[g, 0] += points[k, 0]
        out[g, 1] += points[k, 1]
        out[g, 3] += 1.0
        out[g, 4] += fresh[k]
        first = k == 0 or groups[k - 1] != g
        last = k == len(points) - 1 or groups[k + 1] != g
        if first:
            out[g, 6] = k
        if last:
            out[g, 7] = k + 1
        before, after = beams[k] - 1, beams[k] + 1
        if first and not (before >= 0 and ranges[before] > ranges[beams[k]]):       # not of NaN
            out[g, 5] = 0.0
        if last and not (after < len(ranges) and ranges[after] > ranges[beams[k]]):
            out[g, 5] = 0.0
    for g in range(len(out)):
        out[g, 0] /= out[g, 3]
        out[g, 1] /= out[g, 3]
        out[g, 4] /= out[g, 3]
        x, y = out[g, 0] - laser[0], out[g, 1] - laser[1]
        away, least, most = max(math.hypot(x, y), 1e-6), np.inf, -np.inf
        for k in range(int(out[g, 6]), int(out[g, 7])):     # how wide: across the line of sight
            across = (x * (points[k, 1] - laser[1]) - y * (points[k, 0] - laser[0])) / away
            least, most = min(least, across), max(most, across)
        # the mean depth of the visible half of a circle, seen from afar, is pi / 4 of its radius
        behind = 0.25 * math.pi * 0.5 * (most - least) / away
        out[g, 0] += behind * x
        out[g, 1] += behind * y
        for k in range(int(out[g, 6]), int(out[g, 7])):
            out[g, 2] = max(out[g, 2], math.hypot(points[k, 0] - out[g, 0], points[k, 1] - out[g, 1]))


@kernel
def circle_through(points: FloatArray, x: float, y: float, radius: float) -> Tuple[float, float]:
    """Return the centre of a circle of a known radius through points, near to where it is expected.

    What a short arc does not tell of the centre stays as expected.

    Parameters
    ----------
    points : (N, 2) float64
        [m]
    x, y, radius : float
        The expected centre, and the radius [m].
    """
    for _ in range(FIT_STEPS):
        across, up = 0.0, 0.0
        for k in range(len(points)):
            dx, dy = x - points[k, 0], y - points[k, 1]
            scale = radius / max(math.hypot(dx, dy), 1e-6)
            across += points[k, 0] + scale * dx
            up += points[k, 1] + scale * dy
        x, y = across / len(points), up / len(points)
    return x, y


@kernel
def beam_at(x: float, y: float, laser: FloatArray, angle_min: float, increment: float, count: int) -> int:
    """Return the number of the beam that is nearest to the direction of a place; -1: the scan does not reach there.

    Parameters
    ----------
    x, y : float
        [m]
    laser : (3,) float64
        Pose of the laser [m, m, rad].
    angle_min, increment : float
        Of the beams, in the frame of the laser [rad].
    count : int
        Of the beams.
    """
    turn = 2.0 * math.pi
    angle = math.atan2(y - laser[1], x - laser[0]) - laser[2] - angle_min
    angle -= turn * math.floor(angle / turn) if increment > 0.0 else turn * math.ceil(angle / turn)
    place = angle / increment
    return int(place + 0.5) if 0.0 <= place < count - 0.5 else -1


@kernel
def mark_fresh(points: FloatArray, laser: FloatArray, ranges: FloatArray, angle_min: float, increment: float,
               margin: float, out: BoolArray) -> None:
    """Write which points lie where an earlier scan saw free space: all beams around ended behind them.

    Parameters
    ----------
    points : (N, 2) float64
        [m]
    laser, angle_min, increment
        As of :func:`beam_at`, of the earlier scan.
    ranges : (B,) float64
        Of the earlier scan [m]; NaN: nothing is known.
    margin : float
        How far behind a point the beams end at least [m].
    out : (N,) bool
    """
    for k in range(len(points)):
        beam = beam_at(points[k, 0], points[k, 1], laser, angle_min, increment, len(ranges))
        away = math.hypot(points[k, 0] - laser[0], points[k, 1] - laser[1]) + margin
        out[k] = 1 <= beam < len(ranges) - 1 and (ranges[beam - 1] > away and ranges[beam] > away
                                                  and ranges[beam + 1] > away)
