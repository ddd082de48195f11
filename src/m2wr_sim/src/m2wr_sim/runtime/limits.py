# SPDX-License-Identifier: BSD-3-Clause
"""Limits of positions, velocities, forces, efforts and joint parameters, beyond which the simulation would diverge."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, List, Mapping, Sequence, Tuple

import numpy as np

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import Pose, compose, rotate, rotate_inverse
from m2wr_sim.physics.engine import FARTHEST, FASTEST

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.model.types import Inertial, Joint, Link
    from m2wr_sim.runtime.entities import LiveModel

GREATEST_GRAVITY = 1e4                      # m/s^2; a falling body reaches FASTEST within a second
GREATEST_MOTOR = 1e6                        # N m and N


def check_pose(where: str, pose: Pose) -> Pose:
    """Return a pose whose position the engine can use.

    Parameters
    ----------
    where : str
        Name of the model or link, for the message.
    pose : pose
        In the world, or of a part in its model.

    Returns
    -------
    pose

    Raises
    ------
    ModelError
        If a coordinate is not finite or exceeds ``FARTHEST``.
    """
    x, y, z = pose[0]
    if not (abs(x) <= FARTHEST and abs(y) <= FARTHEST and abs(z) <= FARTHEST):
        raise ModelError("position %s for \"%s\": expected at most %g m from the origin" % (pose[0], where, FARTHEST))
    return pose


def check_velocity(where: str, linear: Sequence[float], angular: Sequence[float]) -> None:
    """Check that the engine can use a velocity.

    Parameters
    ----------
    where : str
        Name of the model or link, for the message.
    linear, angular : (3,) sequences of float
        [m/s, rad/s].

    Raises
    ------
    ModelError
        If a component is not finite or exceeds ``FASTEST``.
    """
    if not all(abs(value) <= FASTEST for value in tuple(linear) + tuple(angular)):
        raise ModelError("velocity %s, %s for \"%s\": expected at most %g m/s and rad/s"
                         % (tuple(linear), tuple(angular), where, FASTEST))


def strongest(inertial: Inertial, step: float) -> Tuple[float, float]:
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


def strongest_effort(model: LiveModel, joint: Joint, step: float) -> float:
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


def solver_stops(where: str, joint: Joint, position: float, step: float,
                 stops: Mapping[str, float]) -> Dict[str, float]:
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


def _inertias(model: LiveModel, joint: Joint) -> List[float]:
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


def _about_axis(inertial: Inertial, link: Link, joint: Joint, model: LiveModel) -> float:
    """Return the moment of inertia [kg m^2] of a link about its centre of mass and along a joint's axis."""
    child = model.link_record(joint.child)
    axis = rotate(compose(child.pose, joint.pose)[1], joint.axis.xyz)                   # in the model's frame
    along = np.array(rotate_inverse(inertial.pose[1], rotate_inverse(link.pose[1], axis)))
    return float(along @ _tensor(inertial) @ along / (along @ along))


def _tensor(inertial: Inertial) -> NDArray[np.float64]:
    xx, xy, xz, yy, yz, zz = inertial.inertia
    return np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
