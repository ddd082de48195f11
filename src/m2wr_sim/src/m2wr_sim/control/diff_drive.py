# SPDX-License-Identifier: BSD-3-Clause
"""Differential drive: converts between the twist of a robot and the rim speeds of its wheels.

``left`` and ``right`` are the *joint tags* of the plugin.  The model decides which of the two wheels is physically on
the left, see :func:`wheel_speeds`.
"""
from __future__ import annotations

import math
from typing import Optional, Tuple

CONVENTIONS = ("noetic", "kinetic", "rep103")
_REACHED = 0.01         # m/s; a wheel this close to its target ends the ramp, as in Gazebo

#: Rim speeds [m/s] of the joints tagged left and right.
Speeds = Tuple[float, float]


def is_swapped(convention: str, legacy_tag: Optional[bool], left_y: float, right_y: float) -> bool:
    """Return whether the joint tagged left is driven as the right wheel.

    Parameters
    ----------
    convention : str
        ``noetic``: never swapped, ``<legacyMode>`` is ignored, as in Gazebo since Melodic.
        ``kinetic``: swapped unless ``<legacyMode>`` is false, as in Gazebo from Jade to Lunar.
        ``rep103``: depends on the positions of the wheels, so that positive ``angular.z`` always turns left.
    legacy_tag : bool or None
        Value of ``<legacyMode>``, None if it is missing.
    left_y, right_y : float
        Lateral positions [m, positive to the left] of the joints tagged left and right.

    Returns
    -------
    bool
    """
    if convention == "kinetic":
        return legacy_tag is not False
    if convention == "rep103":
        return left_y < right_y
    return False


def wheel_speeds(linear_x: float, angular_z: float, separation: float, swapped: bool) -> Speeds:
    """Return the rim speeds of the joints tagged left and right.

    Inverse kinematics of a differential drive with the wheel separation b: v - w b / 2 on the left, v + w b / 2 on the
    right.

    Parameters
    ----------
    linear_x : float
        Forward speed v [m/s] in the robot's frame.
    angular_z : float
        Rotation rate w [rad/s], positive to the left.
    separation : float
        Wheel separation b [m].
    swapped : bool
        Exchanges the two speeds, see :func:`is_swapped`.

    Returns
    -------
    (float, float)
        Rim speeds [m/s] of the joints tagged left and right.
    """
    difference = 0.5 * angular_z * separation
    if swapped:
        difference = -difference
    return linear_x - difference, linear_x + difference


def ramp(target: Speeds, current: Speeds, instructed: Speeds, limit: float) -> Tuple[Speeds, Speeds]:
    """Limit the acceleration of the wheels in one update, as Gazebo's plugin does.

    Parameters
    ----------
    target, current, instructed : (float, float)
        Target, measured and last commanded rim speeds [m/s], left and right.
    limit : float
        Largest change in this update [m/s]; 0 means no limit.

    Returns
    -------
    command : (float, float)
        Rim speeds to set [m/s].
    instructed : (float, float)
        Value for the next call.

    Notes
    -----
    If either wheel is within 0.01 m/s of its target, both are set to their targets and ``instructed`` keeps its value,
    as in Gazebo.
    """
    if limit == 0.0 or any(abs(want - have) < _REACHED for want, have in zip(target, current)):
        return target, instructed
    left, right = (past + max(-limit, min(limit, want - have))
                   for past, want, have in zip(instructed, target, current))
    return (left, right), (left, right)


class EncoderOdometry:
    """Odometry from the wheel speeds, starting at the origin.

    Parameters
    ----------
    separation : float
        Wheel separation [m].
    swapped : bool
        See :func:`is_swapped`.

    Attributes
    ----------
    x, y, theta : float
        Pose in the odometry frame [m, rad].
    linear_x, angular_z : float
        Mean speed [m/s] and rotation rate [rad/s] of the last update.
    """

    def __init__(self, separation: float, swapped: bool) -> None:
        self._separation, self._swapped = separation, swapped
        self.x = self.y = self.theta = 0.0
        self.linear_x = self.angular_z = 0.0

    def update(self, left: float, right: float, dt: float) -> None:
        """Integrate the rim speeds with the midpoint rule. ``linear_x`` is never negative, as in Gazebo.

        Parameters
        ----------
        left, right : float
            Rim speeds [m/s] of the joints tagged left and right.
        dt : float
            Time since the last update [s]; 0 or less is ignored.
        """
        if dt <= 0.0:
            return
        if self._swapped:
            left, right = right, left
        rotation = (right - left) * dt / self._separation
        distance = 0.5 * (left + right) * dt
        self.x += distance * math.cos(self.theta + 0.5 * rotation)
        self.y += distance * math.sin(self.theta + 0.5 * rotation)
        self.theta += rotation
        self.linear_x = abs(distance) / dt
        self.angular_z = rotation / dt

    def reset(self) -> None:
        """Return to the origin."""
        self.x = self.y = self.theta = self.linear_x = self.angular_z = 0.0
