# SPDX-License-Identifier: BSD-3-Clause
"""Angles and quaternions ``(x, y, z, w)`` as plain numbers. Does not import numpy, so that commands start quickly."""
from __future__ import annotations

import math
from typing import Sequence, Tuple


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Tuple[float, float, float, float]:
    """Return the quaternion of fixed-axis angles.

    Parameters
    ----------
    roll, pitch, yaw : float
        Rotations about the fixed x, y and z axes, in this order [rad].

    Returns
    -------
    tuple of 4 floats
        Unit quaternion x, y, z, w.
    """
    half_roll, half_pitch, half_yaw = 0.5 * roll, 0.5 * pitch, 0.5 * yaw
    cr, sr = math.cos(half_roll), math.sin(half_roll)
    cp, sp = math.cos(half_pitch), math.sin(half_pitch)
    cy, sy = math.cos(half_yaw), math.sin(half_yaw)
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


def yaw_of(quaternion: Sequence[float]) -> float:
    """Return the yaw [rad] of a unit quaternion."""
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
