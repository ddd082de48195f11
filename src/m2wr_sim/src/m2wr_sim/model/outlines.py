# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of collision shapes from above: obstacles for a robot between two heights."""
from __future__ import annotations

from typing import Any, List, Optional

import numpy as np

from m2wr_sim.geometry import Pose, matrix_from_quaternion
from m2wr_sim.model.placed import placed_collisions
from m2wr_sim.model.types import Box, Cylinder, Sphere, World
from m2wr_view.outlines import FLOOR, ROBOT_HEIGHT, Outline, box_outline, cylinder_outline, sphere_outline


def outline_of(geometry: Any, pose: Pose, low: float = FLOOR, high: float = ROBOT_HEIGHT,
               name: str = "") -> Optional[Outline]:
    """Return the outline from above of the part of a shape between two heights.

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
        None for a plane, and if no part of the shape is between the heights.
    """
    centre, rotation = np.asarray(pose[0], float), matrix_from_quaternion(pose[1])
    if isinstance(geometry, Sphere):
        return sphere_outline(geometry.radius, centre, low, high, name)
    if isinstance(geometry, Box):
        return box_outline(geometry.size, centre, rotation, low, high, name)
    if isinstance(geometry, Cylinder):
        return cylinder_outline(geometry.radius, geometry.length, centre, rotation, low, high, name)
    return None


def obstacle_outlines(world: World, low: float = FLOOR, high: float = ROBOT_HEIGHT) -> List[Outline]:
    """Return the outlines of all obstacles of a world at their poses in the world file, except planes and actors.

    Parameters
    ----------
    world : World
    low, high : float
        Heights [m]; obstacles are shapes between the two.
    """
    outlines = [outline_of(collision.geometry, pose, low, high, model.name)
                for model, collision, pose in placed_collisions(world)
                if collision.surface.collide_bitmask and not collision.surface.collide_without_contact
                and model.script is None]
    return [outline for outline in outlines if outline is not None]
