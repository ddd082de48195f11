# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of the unit tests: the three arenas of the series, and traps."""
import math

import numpy as np

from planar_rig import World


def world_01():
    """The empty arena."""
    return World().arena()


def world_02():
    """A wall of three barriers across the path, and another of two behind it."""
    world = World().arena()
    for x, y, yaw in ((-4.97, 4.73, 0), (-0.94, 4.73, 0), (2.99, 4.72, 0), (-2.28, -0.40, 0), (1.77, -0.39, 0),
                      (-4.71, -2.79, -1.58)):
        world.barrier(x, y, yaw)
    return world.disc(-4.40, -0.66, 0.35)


def world_03():
    """A nearly closed yard around the goal."""
    world = World().arena()
    for x, y, yaw in ((-4.75, 0.83, -1.54), (-2.66, 2.94, 0), (-0.73, 2.94, 0), (3.40, -2.95, -1.54), (1.67, -5.22, 0),
                      (-2.37, -5.23, 0), (-4.72, -3.19, -1.58), (1.51, -0.50, 0)):
        world.barrier(x, y, yaw)
    return world


def u_trap():
    """A U that is open towards the start at (0, 6); the goal is behind its bottom."""
    return World().box(0.0, 0.0, 5.0, 0.4).box(-2.5, 1.8, 0.4, 4.0).box(2.5, 1.8, 0.4, 4.0)


def yard(gap=0.0):
    """A square yard of 6 m around the origin, with a gap in its left (west) wall."""
    world = World().box(0.0, 3.0, 6.2, 0.2).box(0.0, -3.0, 6.2, 0.2).box(3.0, 0.0, 0.2, 6.2)
    if gap <= 0.0:
        return world.box(-3.0, 0.0, 0.2, 6.2)
    side = (6.2 - gap) / 2
    return world.box(-3.0, 3.1 - side / 2, 0.2, side).box(-3.0, -3.1 + side / 2, 0.2, side)


def posts():
    """Thin posts and a rotated box on the path."""
    world = World().disc(0.1, 3.0, 0.05).disc(-0.6, 1.0, 0.1).disc(1.2, 0.8, 0.05)
    return world.box(0.0, -1.5, 1.2, 0.8, math.radians(30))


def corridor(width):
    """A corridor along y of the given width with a bend to the left (east for a robot that drives south)."""
    half = width / 2
    world = World().box(-half - 0.1, 0.0, 0.2, 8.0 + width)
    world.box(half + 0.1, 0.0 + width / 2, 0.2, 8.0)
    return world.box(2.0, -4.0 - width / 2 - 0.1, 4.0 + width + 0.4, 0.2)


def clutter(number):
    """The arena with 18 to 37 boxes and discs at random, free around (0, 8) and (0, -8)."""
    rng = np.random.default_rng(number)
    world = World().arena()
    for index in range(18 + number % 20):
        while True:
            x, y = rng.uniform(-7.5, 7.5, 2)
            if math.hypot(x, y - 8) > 1.5 and math.hypot(x, y + 8) > 1.2:
                break
        if index % 3:
            world.box(x, y, *rng.uniform(0.3, 2.5, 2), rng.uniform(0, 3))
        else:
            world.disc(x, y, rng.uniform(0.05, 0.6))
    return world
