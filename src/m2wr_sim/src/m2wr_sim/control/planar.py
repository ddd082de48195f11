# SPDX-License-Identifier: BSD-3-Clause
"""Motion in the plane by decree: a twist in the robot's frame to velocities in the world, and back from two poses."""
import math


def world_velocity(yaw, forward, left):
    """Return the x and y velocity in the world [m/s] of a robot that heads along ``yaw`` [rad]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return cosine * forward - sine * left, sine * forward + cosine * left


def twist_between(before, now, elapsed):
    """Return the mean twist between two planar poses, in the frame of the later one.

    Parameters
    ----------
    before, now : (float, float, float)
        x, y [m], yaw [rad].  Of the ways to turn from one yaw to the other the shorter one is taken.
    elapsed : float
        Time between them [s], above 0.

    Returns
    -------
    (float, float, float)
        Linear x, linear y [m/s], angular z [rad/s].
    """
    x, y = (now[0] - before[0]) / elapsed, (now[1] - before[1]) / elapsed
    cosine, sine = math.cos(now[2]), math.sin(now[2])
    turned = math.remainder(now[2] - before[2], 2.0 * math.pi)
    return cosine * x + sine * y, cosine * y - sine * x, turned / elapsed
