# SPDX-License-Identifier: BSD-3-Clause
"""What a running world survives: forces, efforts and numbers of joints beyond which it would come apart."""
import math

import numpy as np

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import compose, rotate, rotate_inverse
from m2wr_sim.physics.engine import FASTEST

GREATEST_GRAVITY = 1e4                      # m/s^2: what falls becomes as fast as anything may be within a second
GREATEST_MOTOR = 1e6                        # N m and N


def strongest(inertial, step):
    """Return the force [N] and the torque [N m] that bring a body from rest to ``FASTEST`` in one step [s]."""
    return FASTEST * inertial.mass / step, FASTEST * max(float(np.linalg.eigvalsh(_tensor(inertial))[0]), 0.0) / step


def strongest_effort(model, joint, step):
    """Return the effort [N m or N] on a joint that brings the lighter of its sides to ``FASTEST`` in one step [s]."""
    return FASTEST * min(_inertias(model, joint)) / step


def solver_stops(where, joint, position, step, stops):
    """Return the stops of a joint as the solver takes them; ``stops`` holds ``lower``, ``upper`` or both.

    A hinge of ODE knows no stop beyond half a turn: such a one is none.

    Raises
    ------
    ModelError
        If a joint at ``position`` would be thrown towards its new stop.
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
    """Return the mass [kg], or inertia about the axis [kg m^2], on the child's side of a joint and on its parent's.

    All links of a side count, for some models have all but massless ones between two joints.  The arms between the axis
    and the centres of mass do not: they only add to it.  What hangs on the world has no other side.
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
