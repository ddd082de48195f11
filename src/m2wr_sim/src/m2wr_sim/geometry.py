# SPDX-License-Identifier: BSD-3-Clause
"""Rotations and rigid transforms on plain arrays.

Quaternions are ``(x, y, z, w)`` as in ROS messages.  Roll, pitch, yaw are fixed-axis angles in that order (the
convention of URDF and SDF).  A pose is a pair ``(position (3,), quaternion (4,))``; ``parent_from_child`` names a
pose that takes child coordinates to parent coordinates.
"""
import math

import numpy as np

from m2wr_sim.angles import quaternion_from_rpy, yaw_of  # noqa: F401 (part of this module's interface)


def rpy_from_quaternion(quaternion):
    """Return fixed-axis roll, pitch, yaw [rad] of a unit quaternion."""
    x, y, z, w = quaternion
    sin_pitch = max(-1.0, min(1.0, 2.0 * (w * y - z * x)))
    return (math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)), math.asin(sin_pitch),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def normalise_quaternion(quaternion):
    """Return the unit quaternion; all zeros give the identity, as Gazebo does."""
    x, y, z, w = quaternion
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if norm < 1e-12:
        return (0.0, 0.0, 0.0, 1.0)
    return (x / norm, y / norm, z / norm, w / norm)


def multiply(left, right):
    """Return the quaternion product ``left * right``."""
    lx, ly, lz, lw = left
    rx, ry, rz, rw = right
    return (lw * rx + lx * rw + ly * rz - lz * ry, lw * ry - lx * rz + ly * rw + lz * rx,
            lw * rz + lx * ry - ly * rx + lz * rw, lw * rw - lx * rx - ly * ry - lz * rz)


def conjugate(quaternion):
    """Return the inverse of a unit quaternion."""
    x, y, z, w = quaternion
    return (-x, -y, -z, w)


def matrix_from_quaternion(quaternion):
    """Return the (3, 3) rotation matrix of a unit quaternion."""
    x, y, z, w = quaternion
    return np.array([[1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                     [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                     [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]])


def rotate(quaternion, vector):
    """Return ``vector`` (3,) rotated by a unit quaternion, as a tuple."""
    x, y, z, w = quaternion
    vx, vy, vz = vector
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return (vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx)


def rotate_inverse(quaternion, vector):
    """Return ``vector`` (3,) expressed in the frame that the unit quaternion rotates from."""
    return rotate(conjugate(quaternion), vector)


def compose(parent_from_middle, middle_from_child):
    """Chain two poses; returns ``parent_from_child`` as ``(position, quaternion)`` tuples."""
    (position, orientation), (offset, turn) = parent_from_middle, middle_from_child
    moved = rotate(orientation, offset)
    return ((position[0] + moved[0], position[1] + moved[1], position[2] + moved[2]), multiply(orientation, turn))


def invert(parent_from_child):
    """Return ``child_from_parent``."""
    position, orientation = parent_from_child
    back = conjugate(orientation)
    moved = rotate(back, position)
    return ((-moved[0], -moved[1], -moved[2]), back)


def cross(left, right):
    """Return the cross product of two 3-vectors as a tuple."""
    return (left[1] * right[2] - left[2] * right[1], left[2] * right[0] - left[0] * right[2],
            left[0] * right[1] - left[1] * right[0])


IDENTITY = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
