# SPDX-License-Identifier: BSD-3-Clause
"""Planar motion: from a twist in the robot's frame to velocities in the world, and from two poses back to a twist."""
from __future__ import annotations

import math
from typing import Sequence, Tuple


def world_velocity(yaw: float, forward: float, left: float) -> Tuple[float, float]:
    """Return the velocity of a robot in the world frame.

    Parameters
    ----------
    yaw : float
        Heading of the robot in the world [rad].
    forward, left : float
        Velocity in the robot's frame [m/s].

    Returns
    -------
    (float, float)
        Velocity along x and y of the world [m/s].
    """
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return cosine * forward - sine * left, sine * forward + cosine * left


def twist_between(before: Sequence[float], now: Sequence[float], elapsed: float) -> Tuple[float, float, float]:
    """Return the mean twist between two planar poses, in the frame of the later one.

    Parameters
    ----------
    before, now : (float, float, float)
        x, y [m], yaw [rad].  The rotation between the two is taken as the shorter one, at most pi.
    elapsed : float
        Time between them [s], above 0.

    Returns
    -------
    (float, float, float)
        Linear x, linear y [m/s], angular z [rad/s].
    """
    x, y = (now[0] - before[0]) / elapsed, (now[1] - before[1]) / elapsed
    cosine, sine = math.cos(now[2]), math.sin(now[2])
    rotation = math.remainder(now[2] - before[2], 2.0 * math.pi)
    return cosine * x + sine * y, cosine * y - sine * x, rotation / elapsed
