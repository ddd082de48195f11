# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of collision shapes from above: obstacles for a robot between two heights."""
from __future__ import annotations

from typing import Any, List, Optional, Tuple

import numpy as np

from m2wr_sim.geometry import Pose, matrix_from_quaternion
from m2wr_sim.model.placed import placed_collisions
from m2wr_sim.model.types import Box, Cylinder, Mesh, Sphere, World
from m2wr_view.mesh_outlines import mesh_outlines
from m2wr_view.outlines import (
    FLOOR,
    ROBOT_HEIGHT,
    Outline,
    box_outline,
    cylinder_outline,
    point_distances,
    sphere_outline,
)

STEP = 0.1              # m: radius of a wheel of m2wr; a higher top is no ground for a robot that starts at the floor
CARRIED = 0.5           # m around a place: all of a robot; the foot of a wall is narrower
LEVEL = 1e-6            # 1 - cos of the greatest tilt of ground


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


def ground_height(world: World, place: Tuple[float, float] = (0.0, 0.0)) -> float:
    """Return the height of the level surface that carries a robot at a place [m]; 0 without one.

    A static box or cylinder carries a robot on its level top if all of the robot is on it. A top higher than STEP does
    not: a robot that is put there at the height of the floor is inside of a block, while one in a plate is pushed out.

    Parameters
    ----------
    world : World
    place : (float, float)
        [m]
    """
    angles = np.arange(8) * (np.pi / 4.0)
    found, around = 0.0, np.asarray(place, float) + CARRIED * np.stack([np.cos(angles), np.sin(angles)], -1)
    for model, collision, pose in placed_collisions(world):
        shape = collision.geometry
        if not model.static or not isinstance(shape, (Box, Cylinder)) or not collision.surface.collide_bitmask:
            continue
        upright = matrix_from_quaternion(pose[1])[2]
        axis = int(np.argmax(np.abs(upright))) if isinstance(shape, Box) else 2
        if abs(upright[axis]) < 1.0 - LEVEL:
            continue
        top = pose[0][2] + 0.5 * (shape.size[axis] if isinstance(shape, Box) else shape.length)
        if found < top <= STEP and all(not point_distances(around, outline).any() for outline in outlines_of(
                shape, pose, -np.inf, np.inf)):
            found = top
    return found


def obstacle_outlines(world: World, low: float = FLOOR, high: float = ROBOT_HEIGHT,
                      place: Tuple[float, float] = (0.0, 0.0)) -> List[Outline]:
    """Return the outlines of all obstacles of a world at their poses in the world file, except ground and actors.

    Parameters
    ----------
    world : World
    low, high : float
        Heights above the ground [m]; obstacles are shapes between the two.
    place : (float, float)
        Where a robot stands on the ground [m]; see :func:`ground_height`.
    """
    ground = ground_height(world, place)
    return [outline for model, collision, pose in placed_collisions(world)
            if collision.surface.collide_bitmask and not collision.surface.collide_without_contact
            and model.script is None
            for outline in outlines_of(collision.geometry, pose, ground + low, ground + high, model.name)]
