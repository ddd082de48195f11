# SPDX-License-Identifier: BSD-3-Clause
"""Checks models before they are built, because ODE aborts the process for some values.

ODE was compiled with assertions.  These are the assertions that values can violate, and the limits that prevent it:

=============================  =====================================================================================
``dMassCheck``                 Rounding makes the Cholesky factor of an inertia fail.  Principal moments are limited
                               to a ratio of SPREAD.
``bSafeNormalize4Fault``       A rotation is NaN: the solver has divided by 0, or a sum is beyond 1e308.  Masses,
                               inertias and lever arms are limited, each one and in combination (LEVERAGE), so that
                               the solver's matrix stays regular with the softness (CFM) that is added.
``bSafeNormalize3Fault``       A direction has length 0: the axis of a joint, the normal of two parallel axes, or the
                               edge of a shape thinner than ``LEAST_SIZE`` of physics/engine.py.
``d[i] != 0``                  The same, in the factor of the solver's matrix.  If the direct solver removes a row, it
                               adds 1 to numbers as large as the square of a body's mobility, and above DIRECT the 1 is
                               lost to rounding.  Such a body is solved iteratively, which needs no factor.  Softness
                               divided by the step adds to the mobility, and is limited to SOFTEST.
``aabbBound < dMaxIntExact``   A position beyond 2^31 cells of the hash space: ``TOO_FAR`` of physics/engine.py.
=============================  =====================================================================================
"""
from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Dict, Iterable, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import compose, matrix_from_quaternion
from m2wr_sim.model.types import Box, Cylinder, Sphere
from m2wr_sim.physics.engine import FARTHEST, LEAST_INERTIA, LEAST_MASS, SHORTEST_STEP

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Vector
    from m2wr_sim.model.types import Geometry, Inertial, Joint, Link, Model

HEAVIEST, GREATEST_INERTIA = 1e9, 1e9       # kg, kg m^2
FARTHEST_CENTRE = 100.0                     # m, of the centre of mass from its link's frame
SPREAD = 1e10           # of the principal moments of a link; a double has 16 digits, and Cholesky's squares take half
LEVERAGE = 1e13         # 1/kg: mobility of a point of a body, 1/m + r^2/I; times 1e-16 it is below CFM over the step
DIRECT = 2.0 ** 26      # 1/kg: mobility beside whose square, 2^52, a double still holds 1
SOFTEST = DIRECT * SHORTEST_STEP            # s/kg: softness (CFM); over the step it adds to the mobility
LEAST_AXIS, GREATEST_AXIS = 1e-6, 1e6       # length of a joint's axis, which is a direction
LEAST_ANGLE = 1e-3                          # rad, between the axes of a universal joint
GREATEST_NUMBER = 1e16                      # of friction, stops and softness of joints; SDF's own infinity
GREATEST_STIFFNESS = 1e300                  # of dampers and springs, which are solved implicitly: any is stable


def check_model(model: Model, name: str) -> None:
    """Raise ModelError if a movable model has values that ODE cannot use.

    Parameters
    ----------
    model : m2wr_sim.model.types.Model
    name : str
        Its name in the world, for messages.
    """
    if model.static:
        return
    for joint in model.joints:
        _check_joint(joint, "%s::%s" % (name, joint.name))
    anchors = _anchors(model)
    for link in model.links:
        where = "%s::%s" % (name, link.name)
        check_inertial(link.inertial, where)
        _check_numbers(where, (("linear damping", link.linear_damping), ("angular damping", link.angular_damping)))
        check_leverage(link, anchors.get(link.name, ()), where)


def _anchors(model: Model) -> Dict[str, List[Vector]]:
    """Return ``{link: [anchor, ...]}``: the anchors of the joints of each link, in the frame of the link [m]."""
    links = {link.name: link for link in model.links}
    anchors: Dict[str, List[Vector]] = {}
    for joint in model.joints:
        child = links.get(joint.child)
        if child is not None:
            anchors.setdefault(joint.child, []).append(joint.pose[0])
            if joint.parent in links:
                there, origin = compose(child.pose, joint.pose)[0], links[joint.parent].pose[0]
                anchors.setdefault(joint.parent, []).append(
                    (there[0] - origin[0], there[1] - origin[1], there[2] - origin[2]))
    return anchors


def check_inertial(inertial: Inertial, where: str) -> None:
    """Check mass, inertia and centre of mass of a link.

    Parameters
    ----------
    inertial : m2wr_sim.model.types.Inertial
    where : str
        ``model::link``, for messages.

    Raises
    ------
    ModelError
        If they are not those of a physical body, or beyond the limits of ODE.
    """
    moments = _moments(tuple(inertial.inertia))
    if not 0.0 < inertial.mass < math.inf or not moments[0] > 0.0:
        raise ModelError("link %s: mass %g with inertia %s is no physical body; expected a positive mass and a "
                         "positive definite inertia" % (where, inertial.mass, list(inertial.inertia)))
    if inertial.mass < LEAST_MASS or moments[0] < LEAST_INERTIA:
        raise ModelError("link %s: mass %g kg with inertia %s is less than the solver can take; expected at least %g "
                         "kg and %g kg m^2" % (where, inertial.mass, list(inertial.inertia), LEAST_MASS, LEAST_INERTIA))
    if not (inertial.mass <= HEAVIEST and moments[-1] <= GREATEST_INERTIA):
        raise ModelError("link %s: mass %g kg with inertia %s; expected at most %g kg and %g kg m^2" % (
            where, inertial.mass, list(inertial.inertia), HEAVIEST, GREATEST_INERTIA))
    if moments[-1] > SPREAD * moments[0]:
        raise ModelError("link %s: inertia %s has principal moments from %g to %g kg m^2; expected them within a "
                         "factor of %g" % (where, list(inertial.inertia), moments[0], moments[-1], SPREAD))
    if not all(abs(value) <= FARTHEST_CENTRE for value in inertial.pose[0]):
        raise ModelError("link %s: centre of mass at %s; expected at most %g m from the link's frame" % (
            where, tuple(inertial.pose[0]), FARTHEST_CENTRE))


def _check_joint(joint: Joint, where: str) -> None:
    if not all(abs(value) <= FARTHEST for value in joint.pose[0]):
        raise ModelError("joint %s: anchor at %s in the child link; expected at most %g m" % (
            where, tuple(joint.pose[0]), FARTHEST))
    for axis in joint.axes():
        if not LEAST_AXIS <= float(np.linalg.norm(axis.xyz)) <= GREATEST_AXIS:
            raise ModelError("joint %s: axis %s; expected a direction with a length of %g to %g" % (
                where, tuple(axis.xyz), LEAST_AXIS, GREATEST_AXIS))
        _check_numbers(where, (
            ("friction", axis.friction), ("stop_erp", axis.stop_erp), ("stop_cfm", axis.stop_cfm),
            ("spring reference", axis.spring_reference), ("fudge factor", axis.fudge_factor or 0.0)))
        _check_numbers(where, (("damping", axis.damping), ("spring stiffness", axis.spring_stiffness)),
                       GREATEST_STIFFNESS)
        if math.isnan(axis.lower) or math.isnan(axis.upper):
            raise ModelError("joint %s: limits %g and %g; expected numbers" % (where, axis.lower, axis.upper))
    if joint.kind == "universal":
        one, two = (np.asarray(axis.xyz, float) / np.linalg.norm(axis.xyz) for axis in joint.axes())
        if not np.linalg.norm(np.cross(one, two)) > LEAST_ANGLE:
            raise ModelError("joint %s: axes %s and %s of a universal joint; expected two that are not parallel" % (
                where, tuple(joint.axes()[0].xyz), tuple(joint.axes()[1].xyz)))


def _check_numbers(where: str, numbers: Iterable[Tuple[str, float]], greatest: float = GREATEST_NUMBER) -> None:
    for name, value in numbers:
        if not abs(value) <= greatest:
            raise ModelError("%s: %s %g; expected a number of at most %g" % (where, name, value, greatest))


def check_leverage(link: Link, anchors: Sequence[Sequence[float]], where: str) -> None:
    """Check the lever arms of contacts and joints of a link against its inertia.

    Parameters
    ----------
    link : m2wr_sim.model.types.Link
    anchors : list of (3,) of float
        Anchors of its joints, in its frame [m].
    where : str
        ``model::link``, for the message.

    Raises
    ------
    ModelError
        If the mobility of a point at which a force may act is above :data:`LEVERAGE`.
    """
    centre = link.inertial.pose[0]
    arm = max([_reach(link)] + [math.dist(centre, anchor) for anchor in anchors])
    if _mobility(link.inertial, arm) > LEVERAGE:
        raise ModelError("link %s: %g kg with a least moment of inertia of %g kg m^2 has a joint or contact %g m from "
                         "its centre of mass; expected 1/m + r^2/I to be at most %g 1/kg" % (
                             where, link.inertial.mass, _least_moment(link.inertial), arm, LEVERAGE))


def too_mobile(links: Iterable[Link]) -> Optional[Tuple[str, str]]:
    """Return the name of a link whose contacts need the iterative solver, and the reason; None if there is none.

    Parameters
    ----------
    links : iterable of m2wr_sim.model.types.Link
        Of a movable model.
    """
    for link in links:
        arm = _reach(link)
        if link.collisions and not link.kinematic and _mobility(link.inertial, arm) > DIRECT:
            return link.name, "it has contacts up to %g m from its centre of mass, with %g kg and a least moment of " \
                "inertia of %g kg m^2; the direct solver takes 1/m + r^2/I up to %g 1/kg" % (
                    arm, link.inertial.mass, _least_moment(link.inertial), DIRECT)
    return None


def _reach(link: Link) -> float:
    """Return the greatest distance of a contact of a link from its centre of mass [m]."""
    centre = link.inertial.pose[0]
    return max([math.dist(centre, collision.pose[0]) + _radius(collision.geometry) for collision in link.collisions],
               default=0.0)


def _least_moment(inertial: Inertial) -> float:
    """Return the least principal moment of inertia [kg m^2]."""
    return _moments(tuple(inertial.inertia))[0]


@lru_cache(maxsize=1024)
def _moments(inertia: Tuple[float, ...]) -> Tuple[float, ...]:
    """Return the principal moments of inertia [kg m^2] in ascending order; -inf alone if a number is not finite."""
    ixx, ixy, ixz, iyy, iyz, izz = inertia
    tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]], dtype=float)
    return tuple(np.linalg.eigvalsh(tensor).tolist()) if np.all(np.isfinite(tensor)) else (-math.inf,)


def _mobility(inertial: Inertial, arm: float) -> float:
    """Return the greatest mobility [1/kg] of a point of a body at a distance [m] from its centre of mass."""
    return 1.0 / inertial.mass + arm * arm / _least_moment(inertial)


def _radius(geometry: Geometry) -> float:
    """Return the greatest distance of a point of a shape from its origin [m]; 0 for planes, which never move."""
    if isinstance(geometry, Box):
        return 0.5 * math.sqrt(sum(size * size for size in geometry.size))
    if isinstance(geometry, Sphere):
        return geometry.radius
    if isinstance(geometry, Cylinder):
        return math.hypot(geometry.radius, 0.5 * geometry.length)
    vertices = getattr(geometry, "vertices", None)
    return 0.0 if vertices is None or not len(vertices) else float(np.max(np.linalg.norm(vertices, axis=1)))


def link_tensor(inertial: Inertial) -> NDArray[np.float64]:
    """Return the inertia (3, 3) of an Inertial in link axes, about the centre of mass [kg m^2]."""
    ixx, ixy, ixz, iyy, iyz, izz = inertial.inertia
    rotation = matrix_from_quaternion(inertial.pose[1])
    return rotation @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]], dtype=float) @ rotation.T
