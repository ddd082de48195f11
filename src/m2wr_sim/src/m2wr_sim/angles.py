# SPDX-License-Identifier: BSD-3-Clause
"""Angles and quaternions ``(x, y, z, w)`` as plain numbers, for what must start quickly: numpy is not imported here."""
import math


def quaternion_from_rpy(roll, pitch, yaw):
    """Return the quaternion of fixed-axis roll, pitch, yaw [rad] as a tuple of four floats."""
    half_roll, half_pitch, half_yaw = 0.5 * roll, 0.5 * pitch, 0.5 * yaw
    cr, sr = math.cos(half_roll), math.sin(half_roll)
    cp, sp = math.cos(half_pitch), math.sin(half_pitch)
    cy, sy = math.cos(half_yaw), math.sin(half_yaw)
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


def yaw_of(quaternion):
    """Return the yaw [rad] of a unit quaternion."""
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
