# SPDX-License-Identifier: BSD-3-Clause
"""Places on a map: which poses are apart, which one is nearest, and how well all beams of a scan agree with each."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_maps.pose_kernels import wrapped
from m2wr_navigation.localization.sensor_kernels import ray_length
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray, IndexArray


@kernel
def _within(one: FloatArray, other: FloatArray, limits: FloatArray) -> bool:
    """Whether two poses are nearer than a distance and an angle."""
    return (math.hypot(one[0] - other[0], one[1] - other[1]) < limits[0]
            and abs(wrapped(one[2] - other[2])) < limits[1])


@kernel
def distinct(poses: FloatArray, places: FloatArray, known: int, apart: FloatArray) -> int:
    """Add poses that are apart from all places.

    Parameters
    ----------
    poses : (N, 3) float64
        The best first: x, y [m], theta [rad].
    places : (K, 3) float64
        The first ``known`` rows are places; the next ones are written.
    known : int
    apart : (2,) float64
        Two poses that are nearer than both are one place [m, rad].

    Returns
    -------
    int
        Number of places, at most K.
    """
    count = known
    for i in range(len(poses)):
        if count == len(places):
            break
        new = True
        for k in range(count):
            if _within(poses[i], places[k], apart):
                new = False
                break
        if new:
            places[count] = poses[i]
            count += 1
    return count


@kernel
def nearest(poses: FloatArray, places: FloatArray, near: FloatArray, out: IndexArray) -> None:
    """Find the nearest place of each pose.

    Parameters
    ----------
    poses : (N, 3) float64
        x, y [m], theta [rad].
    places : (K, 3) float64
        Likewise.
    near : (2,) float64
        Greatest distance and angle [m, rad].
    out : (N,) int64
        Written: the index of the place, -1: none is near.
    """
    for i in range(len(poses)):
        out[i] = -1
        best = math.inf
        for k in range(len(places)):
            away = math.hypot(poses[i, 0] - places[k, 0], poses[i, 1] - places[k, 1])
            if away < best and _within(poses[i], places[k], near):
                best = away
                out[i] = k


@kernel
def _is_wall(column: int, row: int, occupied: BoolArray) -> bool:
    """Whether a cell or one beside it is occupied: rays slip through walls of cells that meet at corners only."""
    for j in range(max(0, row - 1), min(occupied.shape[0], row + 2)):
        for i in range(max(0, column - 1), min(occupied.shape[1], column + 2)):
            if occupied[j, i]:
                return True
    return False


@kernel
def agreement(places: FloatArray, mount: FloatArray, beams: FloatArray, reach: float, blocked: BoolArray,
              free: Float32Array, occupied: BoolArray, cell: float, spread: float, unmapped: float,
              out: FloatArray) -> None:
    """Add up how well the ranges of a scan agree with those to the map's obstacles, by ray casting.

    A ray that leaves the known part of the map tells only that there is nothing before. So a beam without return agrees
    with it, and one that returns from beyond counts like one that hit what is not on the map.

    Parameters
    ----------
    places : (K, 3) float64
        Poses of the base in the grid's frame [cells, cells, rad].
    mount : (2,) float64
        The laser in the base frame [m].
    beams : (2, B) float64
        Direction in the base frame [rad] and range [m] of each beam; without return, the greatest range.
    reach : float
        Greatest range [m].
    blocked, free
        As for :func:`m2wr_navigation.localization.sensor_kernels.ray_length`.
    occupied : (H, W) bool
        Cells with obstacles.
    cell : float
        Side of a cell [m].
    spread : float
        Deviation of a range [m].
    unmapped : float
        Share of the beams that say nothing.
    out : (K,) float64
        Written: sums of ln((1 - unmapped) exp(-d^2 / (2 spread^2)) + unmapped); for a ray that leaves the known part, d
        is 0 for a beam without return, otherwise infinite.
    """
    scale, limit = -0.5 / (spread * spread), reach / cell
    for k in range(len(places)):
        cos, sin = math.cos(places[k, 2]), math.sin(places[k, 2])
        x = places[k, 0] + (cos * mount[0] - sin * mount[1]) / cell
        y = places[k, 1] + (sin * mount[0] + cos * mount[1]) / cell
        total = 0.0
        for b in range(beams.shape[1]):
            direction = places[k, 2] + beams[0, b]
            length = ray_length(x, y, direction, limit, blocked, free)
            if length < limit and not _is_wall(math.floor(x + length * math.cos(direction)),
                                               math.floor(y + length * math.sin(direction)), occupied):
                total += 0.0 if beams[1, b] >= reach else math.log(unmapped)
                continue
            away = beams[1, b] - cell * length
            total += math.log((1.0 - unmapped) * math.exp(scale * away * away) + unmapped)
        out[k] = total
