# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of collision shapes, seen from above: what a robot can run into between two heights."""
import numpy as np

from m2wr_sim.geometry import matrix_from_quaternion
from m2wr_sim.model.placed import placed_collisions
from m2wr_sim.model.types import Box, Cylinder, Sphere
from m2wr_view.outlines import FLOOR, ROBOT_HEIGHT, box_outline, cylinder_outline, sphere_outline


def outline_of(geometry, pose, low=FLOOR, high=ROBOT_HEIGHT, name=""):
    """Return what of a shape lies between two heights, seen from above.

    Parameters
    ----------
    geometry : Box, Cylinder, Sphere or Plane
        See :mod:`m2wr_sim.model.types`.
    pose : ((x, y, z), (x, y, z, w))
        Of the shape in world.
    low, high : float
        Heights [m].
    name : str
        For :attr:`Outline.name`.

    Returns
    -------
    Outline or None
        None for a plane and where nothing lies between the heights.
    """
    centre, rotation = np.asarray(pose[0], float), matrix_from_quaternion(pose[1])
    if isinstance(geometry, Sphere):
        return sphere_outline(geometry.radius, centre, low, high, name)
    if isinstance(geometry, Box):
        return box_outline(geometry.size, centre, rotation, low, high, name)
    if isinstance(geometry, Cylinder):
        return cylinder_outline(geometry.radius, geometry.length, centre, rotation, low, high, name)
    return None


def obstacle_outlines(world, low=FLOOR, high=ROBOT_HEIGHT):
    """Return the outlines of all that a robot can bump into in a world, planes apart, where the world file puts it."""
    outlines = [outline_of(collision.geometry, pose, low, high, model.name)
                for model, collision, pose in placed_collisions(world)
                if collision.surface.collide_bitmask and not collision.surface.collide_without_contact]
    return [outline for outline in outlines if outline is not None]
