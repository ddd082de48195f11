# SPDX-License-Identifier: BSD-3-Clause
"""Changes to links, joints and the physics of a running world."""
from __future__ import annotations

import logging
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Dict, Iterable, Mapping, Optional, Sequence, Tuple

from m2wr_sim.errors import ModelError, ParameterError
from m2wr_sim.geometry import IDENTITY, Pose, Vector, compose, cross, rotate, rotate_inverse, unit_pose
from m2wr_sim.model.types import SECOND_AXIS
from m2wr_sim.physics.engine import FASTEST, LONGEST_STEP, SHORTEST_STEP, settings_from_physics
from m2wr_sim.physics.limits import GREATEST_NUMBER
from m2wr_sim.runtime.entities import plain_joint_name
from m2wr_sim.runtime.limits import GREATEST_GRAVITY, GREATEST_MOTOR, check_pose, check_velocity, solver_stops

if TYPE_CHECKING:
    from m2wr_sim.model.types import Inertial, Physics
    from m2wr_sim.runtime.entities import LiveModel
    from m2wr_sim.runtime.simulator import Simulator

log = logging.getLogger(__name__)

_SOFTNESS = ("cfm", "stop_cfm", "erp", "stop_erp")      # below 0 they make the solver's matrix singular

#: Index of an axis -> (fields of its Axis, parameters of its solver).
Changes = Mapping[int, Tuple[Dict[str, Any], Dict[str, float]]]


def set_link_state(simulator: Simulator, model: LiveModel, name: str, pose: Pose, linear: Sequence[float],
                   angular: Sequence[float]) -> None:
    """Set pose and velocity of one link, in the world frame.

    Joints are ignored; the solver corrects their errors in the next steps.

    Parameters
    ----------
    simulator : Simulator
    model : LiveModel
    name : str
        Name of the link.
    pose : pose
        Of the link frame; the quaternion need not be normalised.
    linear : (3,) sequence of float
        Velocity of the centre of mass [m/s].
    angular : (3,) sequence of float
        Angular velocity [rad/s].

    Raises
    ------
    ModelError
        If a position or velocity exceeds the limits of the engine.
    """
    where = "%s::%s" % (model.name, name)
    check_pose(where, pose)
    check_velocity(where, linear, angular)
    link = model.handle.links[name]
    simulator.engine.set_link_pose(link, unit_pose(pose))
    simulator.engine.set_link_velocity(link, linear, angular)


def set_link_properties(simulator: Simulator, model: LiveModel, name: str, gravity: bool, inertial: Inertial,
                        solve: bool) -> None:
    """Set gravity switch and Inertial of a link.

    Parameters
    ----------
    simulator : Simulator
    model : LiveModel
    name : str
        Name of the link.
    gravity : bool
    inertial : Inertial
    solve : bool
        Whether the physics uses the new Inertial; if not, it is only stored.

    Raises
    ------
    ModelError
        If the physics is to use them, and mass or inertia are not physical or exceed the limits of the solver.
    """
    link = model.handle.links[name]
    if solve:
        simulator.engine.set_link_inertial(link, inertial)
        model.kept_inertials.pop(name, None)
    else:
        model.kept_inertials.setdefault(name, model.link_record(name).inertial)
    simulator.engine.set_link_gravity(link, gravity)
    model.record = replace(model.record, links=tuple(
        replace(record, gravity=gravity, inertial=inertial) if record.name == name else record
        for record in model.record.links))


def set_joint_properties(simulator: Simulator, model: LiveModel, name: str, changes: Changes) -> None:
    """Change the axes of a joint: all that are given, or none if one is invalid.

    Parameters
    ----------
    simulator : Simulator
    model : LiveModel
    name : str
        Name of the joint.
    changes : dict
        Index of the axis -> (fields of its Axis, parameters of its solver: ``engine.JOINT_PARAMETERS``).  For a joint
        that cannot move (fixed, or of a static model) the values are only stored.

    Raises
    ------
    ModelError
        If a number is not finite or exceeds its limit.
    """
    where = "%s::%s" % (model.name, name)
    name, second = plain_joint_name(name)
    if second:
        changes = {1: changes[0]} if 0 in changes else {}
    for fields, parameters in changes.values():
        _check_joint_numbers(where, list(fields.items()) + list(parameters.items()))
    joint, number = model.joint_record(name), model.handle.joints.get(name)
    axes, taken = dict(enumerate(joint.axes() or (joint.axis,))), {}
    for index, (fields, parameters) in changes.items():
        if index not in axes:
            log.warning("joint %s: values for axis %d have no effect: it is of type %s and has %d", where, index,
                        joint.kind, len(joint.axes()))
            continue
        axes[index] = replace(axes[index], **fields)
        if number is not None and joint.axes():
            stops = {key: parameters[key] for key in ("lower", "upper") if key in parameters}
            position = simulator.engine.joint_angle(model.handle.joints[name + (SECOND_AXIS if index else "")])
            taken[index] = dict(parameters, **solver_stops(where, joint, position, simulator.step_ns * 1e-9, stops))
    for index, parameters in taken.items():
        simulator.engine.change_joint(number, axes[index], parameters, index)
    model.record = replace(model.record, joints=tuple(
        replace(record, axis=axes[0], axis2=axes.get(1, record.axis2)) if record.name == name else record
        for record in model.record.joints))


def _check_joint_numbers(where: str, numbers: Iterable[Tuple[str, float]]) -> None:
    """Raise ModelError if one of some ``(name, value)`` is not finite or exceeds its limit."""
    most = {"rate": FASTEST, "max_force": GREATEST_MOTOR, "lower": math.inf, "upper": math.inf}
    for key, value in numbers:
        if not math.isfinite(value):
            raise ModelError("joint %s: %s is %g; expected a finite number" % (where, key, value))
        if abs(value) > most.get(key, GREATEST_NUMBER):
            raise ModelError("joint %s: %s is %g; expected at most %g" % (where, key, value,
                                                                          most.get(key, GREATEST_NUMBER)))
        if value < 0.0 and key in _SOFTNESS:
            raise ModelError("joint %s: %s is %g; expected at least 0" % (where, key, value))


def wrench_as_gazebo(link_pose: Pose, frame: Optional[Pose], point: Vector, force: Vector,
                     torque: Vector) -> Tuple[Vector, Vector]:
    """Return the force and torque that Gazebo applies for a wrench in a reference frame.

    Gazebo rotates the wrench into the *link's* frame, and then applies it as if it were in the world frame.  Without a
    reference frame it does not rotate it.  The reference point changes the torque.

    Parameters
    ----------
    link_pose : pose
        Link frame in the world.
    frame : pose or None
        Reference frame in the world; None for the world itself.
    point, force, torque : (3,)
        Reference point [m], force [N] and torque [N m] in the reference frame.

    Returns
    -------
    force, torque : tuples of 3 floats
        In the world frame [N, N m].
    """
    torque = _sum(torque, cross(point, force))
    if frame is None:
        return (force[0], force[1], force[2]), torque
    offset = rotate_inverse(link_pose[1], tuple(a - b for a, b in zip(frame[0], link_pose[0])))
    force, torque = (rotate_inverse(link_pose[1], rotate(frame[1], vector)) for vector in (force, torque))
    return force, _sum(torque, cross(offset, force))


def wrench_in_world(link_pose: Pose, centre: Vector, frame: Optional[Pose], point: Vector, force: Vector,
                    torque: Vector) -> Tuple[Vector, Vector]:
    """Return the force and the torque about the centre of mass of a link, for a wrench in a reference frame.

    Parameters
    ----------
    link_pose : pose
        Link frame in the world.
    centre : (3,)
        Centre of mass in the link frame [m].
    frame : pose or None
        Reference frame in the world; None for the world itself.
    point, force, torque : (3,)
        Point at which the wrench acts [m], force [N] and torque [N m] in the reference frame.

    Returns
    -------
    force, torque : tuples of 3 floats
        In the world frame [N, N m].
    """
    frame = IDENTITY if frame is None else frame
    force, torque = rotate(frame[1], force), rotate(frame[1], torque)
    acts_at = compose(frame, (tuple(point), IDENTITY[1]))[0]
    middle = compose(link_pose, (centre, IDENTITY[1]))[0]
    return force, _sum(torque, cross(tuple(a - b for a, b in zip(acts_at, middle)), force))


def _sum(one: Vector, two: Vector) -> Vector:
    return (one[0] + two[0], one[1] + two[1], one[2] + two[2])


def set_physics(simulator: Simulator, physics: Physics) -> None:
    """Change the physics; the engine uses the same parameters as of a world file.

    Parameters
    ----------
    simulator : Simulator
    physics : m2wr_sim.model.types.Physics

    Raises
    ------
    ParameterError
        If a number is not finite, or gravity or step size exceed the limits of the engine.
    """
    numbers = {"gravity": physics.gravity, "max_update_rate": (physics.real_time_update_rate,),
               "erp": (physics.erp,), "cfm": (physics.cfm,), "sor_pgs_w": (physics.sor,),
               "contact_surface_layer": (physics.contact_surface_layer,),
               "contact_max_correcting_vel": (physics.contact_max_correcting_vel,)}
    for name, values in numbers.items():
        if not all(math.isfinite(value) for value in values):
            raise ParameterError("%s is %s; expected finite numbers" % (name, " ".join(map(str, values))))
    if max(map(abs, physics.gravity)) > GREATEST_GRAVITY:
        raise ParameterError("gravity is %s; expected at most %g m/s^2"
                             % (" ".join(map(str, physics.gravity)), GREATEST_GRAVITY))
    if not SHORTEST_STEP <= physics.max_step_size <= LONGEST_STEP:
        raise ParameterError("time_step is %g s; expected %g to %g s"
                             % (physics.max_step_size, SHORTEST_STEP, LONGEST_STEP))
    old = simulator.engine.settings
    step_ns = int(round(physics.max_step_size * 1e9))
    wanted = settings_from_physics(physics, step_ns, old.solver)
    simulator.engine.configure(replace(old, step_ns=step_ns, iterations=wanted.iterations, gravity=wanted.gravity,
                                       erp=wanted.erp, max_contacts=wanted.max_contacts))
    simulator.step_ns, simulator.physics = step_ns, physics
