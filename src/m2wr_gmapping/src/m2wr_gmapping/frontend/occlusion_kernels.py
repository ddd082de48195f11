# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of two scans by occlusion."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray


@kernel
def passed_through(rays: Float32Array, seen: FloatArray, points: FloatArray, margin: float,
                   farthest_gap: float) -> Tuple[int, int]:
    """Count the points of one scan that the rays of another one pass through.

    Parameters
    ----------
    rays : (2, S) float32
        Ends of the beams, in the order of their angles [m, frame of their laser].
    seen : (3,) float64
        Pose of the points' laser in that frame [m, m, rad].
    points : (2, B) float64
        End points of the other scan [m, frame of its laser].
    margin : float
        A ray passes through a point if it ends this much behind it [m].
    farthest_gap : float
        Points between two beams count if the beams are closer together than this, in median gaps.

    Returns
    -------
    through, in_view : int
        Number of such points, and of all points that the rays reach.
    """
    count = rays.shape[1]
    if count < 2:
        return 0, 0
    angle, reach = np.empty(count), np.empty(count)
    for k in range(count):
        angle[k] = math.atan2(rays[1, k], rays[0, k])
        reach[k] = math.sqrt(rays[0, k] * rays[0, k] + rays[1, k] * rays[1, k])
    for k in range(1, count):
        if angle[k] < angle[k - 1]:         # a full circle may begin anywhere
            order = np.argsort(angle)
            angle, reach = angle[order], reach[order]
            break
    widest = farthest_gap * np.median(np.diff(angle))
    c, s = math.cos(seen[2]), math.sin(seen[2])
    through = in_view = 0
    for k in range(points.shape[1]):
        x = seen[0] + c * points[0, k] - s * points[1, k]
        y = seen[1] + s * points[0, k] + c * points[1, k]
        after = np.searchsorted(angle, math.atan2(y, x))
        if after == 0 or after == count or angle[after] - angle[after - 1] >= widest:
            continue
        far, least = math.sqrt(x * x + y * y), min(reach[after], reach[after - 1])
        through += far + margin < least
        in_view += far < least + margin
    return through, in_view
