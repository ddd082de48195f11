# SPDX-License-Identifier: BSD-3-Clause
"""What ODE can take of a model, checked before anything of it is built: ODE answers some numbers by ending the process.

ODE was compiled with assertions.  These are the ones that numbers can reach, and what keeps models away from them:

=============================  =====================================================================================
``dMassCheck``                 An inertia whose Cholesky factor fails to rounding: principal moments within SPREAD.
``bSafeNormalize4Fault``       A turn that is no number: the solver has divided by 0, or a sum is beyond 1e308.  Masses,
                               inertias and arms are bounded on their own and by the LEVERAGE a body gives what pushes
                               it, so that the solver's matrix stays regular with the softness (CFM) that is added.
``bSafeNormalize3Fault``       A direction without length: a joint's axis, what two parallel axes span, or the edge of
                               a shape thinner than ``LEAST_SIZE`` of physics/engine.py.
``d[i] != 0``                  The same, in the solver's factor.  Where it takes a row away, the direct solver adds
                               1 to numbers as large as a body's mobility squared, and beyond DIRECT the 1 is lost: such
                               a body is left to the iterative solver, which factors nothing.  Softness over the step
                               adds to the mobility, and is held below SOFTEST.
``aabbBound < dMaxIntExact``   A place beyond 2^31 cells of the hash space: ``TOO_FAR`` of physics/engine.py.
=============================  =====================================================================================
"""
import math

import numpy as np

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import compose, matrix_from_quaternion
from m2wr_sim.model.types import Box, Cylinder, Sphere
from m2wr_sim.physics.engine import FARTHEST, LEAST_INERTIA, LEAST_MASS, SHORTEST_STEP

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


def check_model(model, name):
    """Raise ModelError where a movable model has numbers that ODE cannot take.

    Parameters
    ----------
    model : m2wr_sim.model.types.Model
    name : str
        Under which it comes into the world, for messages.
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


def _anchors(model):
    """Return ``{link: [point, ...]}``: where joints hold the links of a model, each in its link's frame [m]."""
    links = {link.name: link for link in model.links}
    anchors = {}
    for joint in model.joints:
        child = links.get(joint.child)
        if child is not None:
            anchors.setdefault(joint.child, []).append(joint.pose[0])
            if joint.parent in links:
                there = compose(child.pose, joint.pose)[0]
                parent = links[joint.parent]
                anchors.setdefault(joint.parent, []).append(tuple(a - b for a, b in zip(there, parent.pose[0])))
    return anchors


def check_inertial(inertial, where):
    """Raise ModelError for a mass, an inertia or a centre of mass that are not those of a body ODE can move."""
    ixx, ixy, ixz, iyy, iyz, izz = inertial.inertia
    tensor = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]], dtype=float)
    moments = np.linalg.eigvalsh(tensor) if np.all(np.isfinite(tensor)) else (-math.inf,)
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


def _check_joint(joint, where):
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


def _check_numbers(where, numbers, greatest=GREATEST_NUMBER):
    for name, value in numbers:
        if not abs(value) <= greatest:
            raise ModelError("%s: %s %g; expected a number of at most %g" % (where, name, value, greatest))


def check_leverage(link, anchors, where):
    """Raise ModelError where something can push a link with an arm that its inertia does not match.

    Parameters
    ----------
    link : m2wr_sim.model.types.Link
    anchors : list of (3,) of float
        Where joints hold it, in its frame [m].
    where : str
        Its name, for the message.
    """
    centre = link.inertial.pose[0]
    arm = max([_reach(link)] + [math.dist(centre, anchor) for anchor in anchors])
    if _mobility(link.inertial, arm) > LEVERAGE:
        raise ModelError("link %s: %g kg with a least moment of inertia of %g kg m^2 has a joint or contact %g m from "
                         "its centre of mass; expected 1/m + r^2/I to be at most %g 1/kg" % (
                             where, link.inertial.mass, _least_moment(link.inertial), arm, LEVERAGE))


def too_mobile(links):
    """Return the name of a link whose contacts only the iterative solver can take, and why; None where there is none.

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


def _reach(link):
    """Return the greatest distance of a contact of a link from its centre of mass [m]."""
    centre = link.inertial.pose[0]
    return max([math.dist(centre, collision.pose[0]) + _radius(collision.geometry) for collision in link.collisions],
               default=0.0)


def _least_moment(inertial):
    ixx, ixy, ixz, iyy, iyz, izz = inertial.inertia
    return float(np.linalg.eigvalsh(np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]))[0])


def _mobility(inertial, arm):
    """Return the greatest mobility [1/kg] of a point of a body at a distance [m] from its centre of mass."""
    return 1.0 / inertial.mass + arm * arm / _least_moment(inertial)


def _radius(geometry):
    """Return how far a shape reaches from its middle [m]; 0 for planes, which never move."""
    if isinstance(geometry, Box):
        return 0.5 * math.sqrt(sum(size * size for size in geometry.size))
    if isinstance(geometry, Sphere):
        return geometry.radius
    if isinstance(geometry, Cylinder):
        return math.hypot(geometry.radius, 0.5 * geometry.length)
    vertices = getattr(geometry, "vertices", None)
    return 0.0 if vertices is None or not len(vertices) else float(np.max(np.linalg.norm(vertices, axis=1)))


def turned_tensor(inertial):
    """Return the inertia (3, 3) of an Inertial in link axes, about the centre of mass [kg m^2]."""
    ixx, ixy, ixz, iyy, iyz, izz = inertial.inertia
    turn = matrix_from_quaternion(inertial.pose[1])
    return turn @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]], dtype=float) @ turn.T
