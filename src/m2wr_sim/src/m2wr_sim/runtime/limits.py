# SPDX-License-Identifier: BSD-3-Clause
"""Limits of forces, efforts and joint parameters, beyond which the simulation would diverge."""
import math

import numpy as np

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import compose, rotate, rotate_inverse
from m2wr_sim.physics.engine import FASTEST

GREATEST_GRAVITY = 1e4                      # m/s^2; a falling body reaches FASTEST within a second
GREATEST_MOTOR = 1e6                        # N m and N


def strongest(inertial, step):
    """Return the force and the torque that accelerate a body from rest to ``FASTEST`` in one step.

    Parameters
    ----------
    inertial : Inertial
    step : float
        Step size [s].

    Returns
    -------
    (float, float)
        Force [N], torque [N m].
    """
    return FASTEST * inertial.mass / step, FASTEST * max(float(np.linalg.eigvalsh(_tensor(inertial))[0]), 0.0) / step


def strongest_effort(model, joint, step):
    """Return the effort that accelerates the lighter side of a joint from rest to ``FASTEST`` in one step.

    Parameters
    ----------
    model : LiveModel
    joint : Joint
    step : float
        Step size [s].

    Returns
    -------
    float
        [N m or N].
    """
    return FASTEST * min(_inertias(model, joint)) / step


def solver_stops(where, joint, position, step, stops):
    """Return the stops of a joint for the solver.

    A hinge of ODE cannot have a stop beyond 180 degrees; such a stop is removed.

    Parameters
    ----------
    where : str
        Name of the joint, for messages.
    joint : Joint
    position : float
        Present position [rad or m].
    step : float
        Step size [s].
    stops : dict
        ``lower``, ``upper`` or both -> position [rad or m].

    Returns
    -------
    dict

    Raises
    ------
    ModelError
        If the joint is so far beyond a new stop that the solver would accelerate it too much.
    """
    taken = dict(stops)
    if joint.kind != "prismatic":
        position = math.remainder(position, 2.0 * math.pi)
        if stops.get("lower", 0.0) <= -math.pi:
            taken["lower"] = -math.inf
        if stops.get("upper", 0.0) >= math.pi:
            taken["upper"] = math.inf
    for name, value in taken.items():
        beyond = value - position if name == "lower" else position - value
        farthest = FASTEST * step if joint.kind == "prismatic" else math.pi
        if beyond > farthest:
            raise ModelError("joint %s: the %s stop %g is %g away from where the joint is, %g; expected at most %g"
                             % (where, name, value, beyond, position, farthest))
    return taken


def _inertias(model, joint):
    """Return the mass [kg], or inertia about the axis [kg m^2], on the child's and on the parent's side of a joint.

    All links of a side count, because some models have links almost without mass between two joints.  The distances
    between axis and centres of mass are ignored; they would only increase the inertia.  The world is not counted.
    """
    beyond = model.links_beyond(joint.child)
    sides = [beyond] if joint.parent == "world" else [
        beyond, [link.name for link in model.record.links if link.name not in beyond]]
    return [sum(model.acting_inertial(name).mass if joint.kind == "prismatic" else
                _about_axis(model.acting_inertial(name), model.link_record(name), joint, model) for name in side)
            for side in sides if side]


def _about_axis(inertial, link, joint, model):
    """Return the moment of inertia [kg m^2] of a link about its centre of mass and along a joint's axis."""
    child = model.link_record(joint.child)
    axis = rotate(compose(child.pose, joint.pose)[1], joint.axis.xyz)                   # in the model's frame
    axis = np.array(rotate_inverse(inertial.pose[1], rotate_inverse(link.pose[1], axis)))
    return float(axis @ _tensor(inertial) @ axis / (axis @ axis))


def _tensor(inertial):
    xx, xy, xz, yy, yz, zz = inertial.inertia
    return np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
