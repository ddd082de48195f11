# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of collision shapes from above: obstacles for a robot between two heights."""
from __future__ import annotations

from typing import Any, List, Optional

import numpy as np

from m2wr_sim.geometry import Pose, matrix_from_quaternion
from m2wr_sim.model.placed import placed_collisions
from m2wr_sim.model.types import Box, Cylinder, Mesh, Sphere, World
from m2wr_view.mesh_outlines import mesh_outlines
from m2wr_view.outlines import FLOOR, ROBOT_HEIGHT, Outline, box_outline, cylinder_outline, sphere_outline


def outlines_of(geometry: Any, pose: Pose, low: float = FLOOR, high: float = ROBOT_HEIGHT,
                name: str = "") -> List[Outline]:
    """Return the outlines from above of the part of a shape between two heights.

    Parameters
    ----------
    geometry : m2wr_sim.model.types.Geometry
        See :mod:`m2wr_sim.model.types`.
    pose : ((x, y, z), (x, y, z, w))
        Of the shape in world.
    low, high : float
        Heights [m].
    name : str
        For :attr:`Outline.name`.

    Returns
    -------
    list of Outline
        None for ground (planes, heightmaps, see :mod:`m2wr_view.mesh_outlines`), and if no part of the shape is between
        the heights; one for a box, sphere or cylinder, any number for a mesh.
    """
    found: Optional[Outline] = None
    centre, rotation = np.asarray(pose[0], float), matrix_from_quaternion(pose[1])
    if isinstance(geometry, Sphere):
        found = sphere_outline(geometry.radius, centre, low, high, name)
    elif isinstance(geometry, Box):
        found = box_outline(geometry.size, centre, rotation, low, high, name)
    elif isinstance(geometry, Cylinder):
        found = cylinder_outline(geometry.radius, geometry.length, centre, rotation, low, high, name)
    elif isinstance(geometry, Mesh):
        return mesh_outlines(geometry.vertices.dot(rotation.T) + centre, geometry.triangles.astype(np.int64), low, high,
                             name)
    return [] if found is None else [found]


def obstacle_outlines(world: World, low: float = FLOOR, high: float = ROBOT_HEIGHT) -> List[Outline]:
    """Return the outlines of all obstacles of a world at their poses in the world file, except ground and actors.

    Parameters
    ----------
    world : World
    low, high : float
        Heights [m]; obstacles are shapes between the two.
    """
    return [outline for model, collision, pose in placed_collisions(world)
            if collision.surface.collide_bitmask and not collision.surface.collide_without_contact
            and model.script is None
            for outline in outlines_of(collision.geometry, pose, low, high, model.name)]
