# SPDX-License-Identifier: BSD-3-Clause
"""Other robots in a scan: they move, so no map may keep them."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray

RADIUS = 0.6        # m: disc about the origin of m2wr that holds its body, and 0.1 m for the error of its pose


def without(ranges: Float32Array, angles: FloatArray, laser: FloatArray, places: FloatArray,
            radius: float = RADIUS) -> Float32Array:
    """Return the ranges of a scan, NaN where the beam ends on another robot.

    REP 117: NaN is no measurement; the beam neither marks nor clears.

    Parameters
    ----------
    ranges : (N,) float32
        [m]
    angles : (N,) float64
        Of the beams in the laser's frame [rad].
    laser : (3,) float64
        Pose of the laser [m, m, rad].
    places : (M, 2) float64
        Of the other robots, in the same frame [m].
    radius : float
        Of a robot [m].
    """
    ranges = np.asarray(ranges, np.float32)
    finite = np.where(np.isfinite(ranges), ranges, 0.0)
    x = laser[0] + finite * np.cos(angles + laser[2])
    y = laser[1] + finite * np.sin(angles + laser[2])
    hidden = np.zeros(len(ranges), bool)
    for place in places:
        hidden |= np.isfinite(ranges) & (np.hypot(x - place[0], y - place[1]) < radius)
    result: Float32Array = np.where(hidden, np.float32(np.nan), ranges)
    return result
