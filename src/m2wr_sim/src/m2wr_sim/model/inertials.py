# SPDX-License-Identifier: BSD-3-Clause
"""Masses and tensors that descriptions give to bodies: which a solver can use, and what stands in for one it cannot."""
import math

import numpy as np

from m2wr_sim.model.sdf.shapes import inertial_moments
from m2wr_sim.model.types import Box, Cylinder, Inertial, Mesh, Sphere

_NO_SHAPE = 0.1         # m: radius of the ball that stands in for a link without shapes


def mass_fault(inertial):
    """Return why no moving body can have this mass as (found, expected), or None."""
    return None if inertial.mass > 0.0 else ("mass is {:g}".format(inertial.mass), "a positive mass in kg")


def usable(inertial, collisions):
    """Return an Inertial that a solver can use, and a sentence part where it is not the one given.

    A tensor that is not positive definite, all zeros most often, gives way to that of a solid ball around the centre of
    mass which the link's collisions just fit into.

    Parameters
    ----------
    inertial : Inertial
        Of positive mass.
    collisions : sequence of Collision

    Returns
    -------
    inertial : Inertial
    told : str or None
    """
    if inertial_moments(inertial)[0] > 0.0:
        return inertial, None
    radius = max((_reach(shape, inertial.pose[0]) for shape in collisions), default=0.0) or _NO_SHAPE
    moment = 0.4 * inertial.mass * radius * radius
    told = ("the inertia tensor (ixx ixy ixz iyy iyz izz = {}) is not positive definite; expected three positive "
            "principal moments; that of a ball of {:g} kg and {:.3g} m is taken".format(
                " ".join("{:g}".format(value) for value in inertial.inertia), inertial.mass, radius))
    return Inertial(inertial.mass, inertial.pose, (moment, 0.0, 0.0, moment, 0.0, moment)), told


def _reach(collision, centre):
    """Return how far a collision reaches from a point of its link [m], at most; 0 for what has no end."""
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
