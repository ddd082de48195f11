# SPDX-License-Identifier: BSD-3-Clause
"""Angles in the plane: wrapping and the yaw of a quaternion. Plain floats, no ROS types."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from motion_plan.planar_types import FloatArray

TWO_PI = 2.0 * math.pi
_Angle = TypeVar('_Angle', float, 'FloatArray')


def wrap_angle(angle: _Angle) -> _Angle:
    """Return ``angle`` [rad] wrapped to [-pi, pi), for any number of revolutions."""
    return (angle + math.pi) % TWO_PI - math.pi


def normalize_angle(angle: float) -> float:
    """Return ``angle`` [rad] moved by one revolution towards zero when its magnitude exceeds pi.

    The report's own formula: it removes one revolution only, so it is right for differences of two wrapped
    angles and does not change +pi and -pi.
    """
    if math.fabs(angle) > math.pi:
        angle = angle - (2 * math.pi * angle) / (math.fabs(angle))
    return angle


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw [rad] of a quaternion.

    Parameters
    ----------
    x, y, z, w : float
        The quaternion; it need not have unit length. All zeros means no rotation, as in Gazebo.

    Returns
    -------
    float
        Rotation about the fixed z axis (roll, pitch, yaw convention of REP 103) in [-pi, pi].

    Raises
    ------
    ValueError
        If a component is not finite.
    """
    if not all(math.isfinite(value) for value in (x, y, z, w)):
        raise ValueError('quaternion (%s, %s, %s, %s): expected four finite numbers' % (x, y, z, w))
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
