# SPDX-License-Identifier: BSD-3-Clause
"""Checks masses and inertia tensors of descriptions and replaces tensors that a solver cannot use."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Iterable, Optional, Tuple, Union

import numpy as np

from m2wr_sim.geometry import Vector
from m2wr_sim.model.sdf.shapes import inertial_moments
from m2wr_sim.model.types import Box, Collision, Cylinder, Inertial, Mesh, Sphere

if TYPE_CHECKING:
    from m2wr_sim.model.urdf.lumping import Part

_NO_SHAPE = 0.1         # m: radius of the sphere that replaces a link without shapes


def mass_fault(inertial: Inertial) -> Optional[Tuple[str, str]]:
    """Return (found, expected) if the mass is invalid for a moving body, else None."""
    return None if inertial.mass > 0.0 else ("mass is {:g}".format(inertial.mass), "a positive mass in kg")


def usable(inertial: Inertial, collisions: Iterable[Union[Collision, Part]]) -> Tuple[Inertial, Optional[str]]:
    """Return an Inertial that a solver can use, and a message if it is not the given one.

    A tensor that is not positive definite, mostly all zeros, is replaced. The new one is that of a solid sphere around
    the centre of mass that just encloses the link's collisions: 2/5 m r^2.

    Parameters
    ----------
    inertial : Inertial
        Of positive mass.
    collisions : iterable of Collision or Part

    Returns
    -------
    inertial : Inertial
    message : str or None
    """
    if inertial_moments(inertial)[0] > 0.0:
        return inertial, None
    radius = max((_reach(shape, inertial.pose[0]) for shape in collisions), default=0.0) or _NO_SHAPE
    moment = 0.4 * inertial.mass * radius * radius
    message = ("the inertia tensor (ixx ixy ixz iyy iyz izz = {}) is not positive definite; expected three positive "
               "principal moments; using that of a ball of {:g} kg and {:.3g} m".format(
                   " ".join("{:g}".format(value) for value in inertial.inertia), inertial.mass, radius))
    return Inertial(inertial.mass, inertial.pose, (moment, 0.0, 0.0, moment, 0.0, moment)), message


def _reach(collision: Union[Collision, Part], centre: Vector) -> float:
    """Return an upper bound [m] of the distance from a point to the points of a collision; 0 for an infinite shape."""
    shape = collision.geometry
    if isinstance(shape, Box):
        extent = 0.5 * math.hypot(*shape.size)
    elif isinstance(shape, Sphere):
        extent = shape.radius
    elif isinstance(shape, Cylinder):
        extent = math.hypot(shape.radius, 0.5 * shape.length)
    elif isinstance(shape, Mesh):
        extent = float(np.linalg.norm(shape.vertices, axis=1).max(initial=0.0))
    else:
        return 0.0
    return extent + math.dist(collision.pose[0], centre)
