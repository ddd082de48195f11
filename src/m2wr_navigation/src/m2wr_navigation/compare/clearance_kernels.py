# SPDX-License-Identifier: BSD-3-Clause
"""The least distance of a robot from obstacles along a drive.

Robot and obstacles are convex polygons, each widened by a radius: ``points`` (N, 2) corners of all polygons [m];
``first`` (K + 1,) index of each polygon's first corner; ``radii`` (K,) [m].
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.optimum.tangent_kernels import crosses, point_distance
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray


@kernel
def _between(one: FloatArray, begin: int, end: int, two: FloatArray, start: int, stop: int) -> float:
    """Return the distance [m] of the polygons ``one[begin:end]`` and ``two[start:stop]``, 0 where they overlap."""
    least = math.inf
    for i in range(begin, end):
        least = min(least, point_distance(two, start, stop, one[i, 0], one[i, 1]))
    for j in range(start, stop):
        least = min(least, point_distance(one, begin, end, two[j, 0], two[j, 1]))
    if least == 0.0 or end - begin < 2 or stop - start < 2:
        return least
    for i in range(begin, end):                 # two bars that cross have no corner in one another
        after = i + 1 if i + 1 < end else begin
        side = one[i, 0], one[i, 1], one[after, 0], one[after, 1]
        for j in range(start, stop):
            beyond = j + 1 if j + 1 < stop else start
            if crosses(side, two[j, 0], two[j, 1], two[beyond, 0], two[beyond, 1]):
                return 0.0
    return least


@kernel
def least_distance(poses: FloatArray, parts: FloatArray, part_first: IndexArray, part_radii: FloatArray,
                   points: FloatArray, first: IndexArray, radii: FloatArray, circles: FloatArray) -> float:
    """Return the least distance of a robot from all obstacles at many poses [m], infinite without any.

    A robot that moves cannot come nearer by more than its corners move: poses between which that is less than what is
    left to the least distance so far are not looked at.

    Parameters
    ----------
    poses : (N, 3) float64
        In the order of the drive [m, m, rad].
    parts, part_first, part_radii
        The robot in its own frame.
    points, first, radii
        The obstacles.
    circles : (K, 3) float64
        Centre and radius of a circle around each widened obstacle [m].
    """
    reach = 0.0
    for part in range(len(part_radii)):
        for corner in range(part_first[part], part_first[part + 1]):
            reach = max(reach, math.hypot(parts[corner, 0], parts[corner, 1]) + part_radii[part])
    best, left, placed = math.inf, -math.inf, np.empty_like(parts)
    for i in range(len(poses)):
        x, y, yaw = poses[i]
        if i > 0:
            left -= math.hypot(x - poses[i - 1, 0], y - poses[i - 1, 1]) \
                + 2.0 * reach * abs(math.sin(0.5 * (yaw - poses[i - 1, 2])))
        if left > 0.0:
            continue
        cosine, sine = math.cos(yaw), math.sin(yaw)
        for corner in range(len(parts)):
            placed[corner, 0] = x + cosine * parts[corner, 0] - sine * parts[corner, 1]
            placed[corner, 1] = y + sine * parts[corner, 0] + cosine * parts[corner, 1]
        here = math.inf
        for k in range(len(radii)):
            if math.hypot(x - circles[k, 0], y - circles[k, 1]) - circles[k, 2] - reach >= here:
                continue
            for part in range(len(part_radii)):
                here = min(here, max(_between(placed, part_first[part], part_first[part + 1], points, first[k],
                                              first[k + 1]) - part_radii[part] - radii[k], 0.0))
        best = min(best, here)
        left = here - best
    return best
