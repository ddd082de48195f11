# SPDX-License-Identifier: BSD-3-Clause
"""Rotations and rigid transforms on plain arrays.

Quaternions are ``(x, y, z, w)`` as in ROS messages.  Roll, pitch, yaw are fixed-axis angles in that order (the
convention of URDF and SDF).  A pose is a pair ``(position (3,), quaternion (4,))``; ``parent_from_child`` names a
pose that takes child coordinates to parent coordinates.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

from m2wr_sim.angles import quaternion_from_rpy, yaw_of  # noqa: F401 (part of this module's interface)

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: x, y, z.
Vector = Tuple[float, float, float]
#: x, y, z, w.
Quaternion = Tuple[float, float, float, float]
#: Position [m] and orientation of a child frame in its parent frame.
Pose = Tuple[Vector, Quaternion]


def rpy_from_quaternion(quaternion: Sequence[float]) -> Vector:
    """Return fixed-axis roll, pitch, yaw [rad] of a unit quaternion."""
    x, y, z, w = quaternion
    sin_pitch = max(-1.0, min(1.0, 2.0 * (w * y - z * x)))
    return (math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)), math.asin(sin_pitch),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def normalise_quaternion(quaternion: Sequence[float]) -> Quaternion:
    """Return the unit quaternion. Zeros give the identity, as in Gazebo."""
    x, y, z, w = quaternion
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if norm < 1e-12:
        return (0.0, 0.0, 0.0, 1.0)
    return (x / norm, y / norm, z / norm, w / norm)


def unit_pose(pose: Tuple[Sequence[float], Sequence[float]]) -> Pose:
    """Return a pose as tuples, with a unit quaternion."""
    x, y, z = pose[0]
    return ((x, y, z), normalise_quaternion(pose[1]))


def multiply(left: Sequence[float], right: Sequence[float]) -> Quaternion:
    """Return the quaternion product ``left * right``, which rotates by ``right`` first.

    Parameters
    ----------
    left, right : (4,) sequences of float
        Quaternions x, y, z, w.

    Returns
    -------
    tuple of 4 floats
    """
    lx, ly, lz, lw = left
    rx, ry, rz, rw = right
    return (lw * rx + lx * rw + ly * rz - lz * ry, lw * ry - lx * rz + ly * rw + lz * rx,
            lw * rz + lx * ry - ly * rx + lz * rw, lw * rw - lx * rx - ly * ry - lz * rz)


def conjugate(quaternion: Sequence[float]) -> Quaternion:
    """Return the inverse of a unit quaternion."""
    x, y, z, w = quaternion
    return (-x, -y, -z, w)


def matrix_from_quaternion(quaternion: Sequence[float]) -> NDArray[np.float64]:
    """Return the (3, 3) rotation matrix of a unit quaternion."""
    x, y, z, w = quaternion
    return np.array([[1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                     [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                     [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]])


def rotate(quaternion: Sequence[float], vector: Sequence[float]) -> Vector:
    """Rotate a vector.

    Parameters
    ----------
    quaternion : (4,) sequence of float
        Unit quaternion x, y, z, w.
    vector : (3,) sequence of float
        In the frame from which the quaternion rotates.

    Returns
    -------
    tuple of 3 floats
    """
    x, y, z, w = quaternion
    vx, vy, vz = vector
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return (vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx)


def rotate_inverse(quaternion: Sequence[float], vector: Sequence[float]) -> Vector:
    """Rotate a vector by the inverse of a unit quaternion.

    Parameters
    ----------
    quaternion : (4,) sequence of float
        Unit quaternion x, y, z, w.
    vector : (3,) sequence of float
        In the frame to which the quaternion rotates.

    Returns
    -------
    tuple of 3 floats
        The same vector in the frame from which the quaternion rotates.
    """
    return rotate(conjugate(quaternion), vector)


def compose(parent_from_middle: Tuple[Sequence[float], Sequence[float]],
            middle_from_child: Tuple[Sequence[float], Sequence[float]]) -> Pose:
    """Chain two poses.

    Parameters
    ----------
    parent_from_middle, middle_from_child : pose
        Position (3,) and unit quaternion (4,).

    Returns
    -------
    pose
        ``parent_from_child``.
    """
    if middle_from_child is IDENTITY:       # as most links and collisions of obstacles have it
        (x, y, z), (i, j, k, w) = parent_from_middle
        return (x, y, z), (i, j, k, w)
    (position, orientation), (offset, rotation) = parent_from_middle, middle_from_child
    moved = rotate(orientation, offset)
    return ((position[0] + moved[0], position[1] + moved[1], position[2] + moved[2]), multiply(orientation, rotation))


def invert(parent_from_child: Tuple[Sequence[float], Sequence[float]]) -> Pose:
    """Return ``child_from_parent``."""
    position, orientation = parent_from_child
    inverse = conjugate(orientation)
    moved = rotate(inverse, position)
    return ((-moved[0], -moved[1], -moved[2]), inverse)


def cross(left: Sequence[float], right: Sequence[float]) -> Vector:
    """Return the cross product of two vectors.

    Parameters
    ----------
    left, right : (3,) sequences of float

    Returns
    -------
    tuple of 3 floats
    """
    return (left[1] * right[2] - left[2] * right[1], left[2] * right[0] - left[0] * right[2],
            left[0] * right[1] - left[1] * right[0])


IDENTITY: Pose = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
