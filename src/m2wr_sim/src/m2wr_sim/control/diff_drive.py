# SPDX-License-Identifier: BSD-3-Clause
"""Differential drive: between the twist of a robot and the rim speeds of its wheels.

Rim speeds are named by the *joint tags* of the plugin, ``left`` and ``right``; which of the two is physically on the
left is a matter of the model, see :func:`wheel_speeds`.
"""
import math

CONVENTIONS = ("noetic", "kinetic", "rep103")


def is_swapped(convention, legacy_tag, left_y, right_y):
    """Tell whether the joint tagged left is driven as the physical right wheel.

    Parameters
    ----------
    convention : str
        ``noetic``: never, the tags are believed and ``<legacyMode>`` is ignored, as Gazebo does since Melodic.
        ``kinetic``: as ``<legacyMode>`` says, a missing tag meaning true, as Jade to Lunar did.
        ``rep103``: by where the wheels are, so that positive ``angular.z`` always turns left.
    legacy_tag : bool or None
        The value of ``<legacyMode>``, None where it is missing.
    left_y, right_y : float
        Lateral positions [m, positive to the left] of the joints tagged left and right.
    """
    if convention == "kinetic":
        return legacy_tag is not False
    if convention == "rep103":
        return left_y < right_y
    return False


def wheel_speeds(linear_x, angular_z, separation, swapped):
    """Return the rim speeds [m/s] of the joints tagged left and right.

    With v = ``linear_x`` and w = ``angular_z`` the left one turns at v - w b/2 and the right one at v + w b/2, b being
    the wheel separation; ``swapped`` exchanges them.
    """
    turn = 0.5 * angular_z * separation
    if swapped:
        turn = -turn
    return linear_x - turn, linear_x + turn


def ramp(target, current, instructed, limit):
    """Return the instructed speeds after one tick of Gazebo's wheel acceleration.

    Parameters
    ----------
    target, current, instructed : (float, float)
        Wanted, measured and last instructed rim speeds [m/s], left and right.
    limit : float
        Largest change in this tick [m/s]; 0 means no ramp.

    Notes
    -----
    When either wheel is within 0.01 m/s of its target both are set straight to their targets and the instructed
    speeds stay as they were, as in Gazebo.
    """
    if limit == 0.0 or any(abs(want - have) < 0.01 for want, have in zip(target, current)):
        return target, instructed
    instructed = tuple(past + max(-limit, min(limit, want - have))
                       for past, want, have in zip(instructed, target, current))
    return instructed, instructed


class EncoderOdometry:
    """Odometry from wheel rates; starts at the origin when it is made."""

    def __init__(self, separation, swapped):
        self._separation, self._swapped = separation, swapped
        self.x = self.y = self.theta = 0.0
        self.linear_x = self.angular_z = 0.0

    def update(self, left, right, dt):
        """Integrate rim speeds [m/s] over ``dt`` [s] with the midpoint rule; ``linear_x`` has no sign, as in Gazebo."""
        if dt <= 0.0:
            return
        if self._swapped:
            left, right = right, left
        turned = (right - left) * dt / self._separation
        travelled = 0.5 * (left + right) * dt
        self.x += travelled * math.cos(self.theta + 0.5 * turned)
        self.y += travelled * math.sin(self.theta + 0.5 * turned)
        self.theta += turned
        self.linear_x = abs(travelled) / dt
        self.angular_z = turned / dt

    def reset(self):
        """Return to the origin."""
        self.x = self.y = self.theta = self.linear_x = self.angular_z = 0.0
