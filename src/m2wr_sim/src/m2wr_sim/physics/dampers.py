# SPDX-License-Identifier: BSD-3-Clause
"""Damping and springs of joints: explicit forces where they are stable, else implicit ones through the solver.

An explicit damping force, computed from the rate before the step, is unstable if it changes the rate by more than twice
its value in one step.  The implicit force, computed from the rate after the step, is always stable.  It is that of a
motor with target rate 0 and compliance 1 / damping.

An explicit spring force is unstable if it changes the rate by more than four times the rate that takes the joint to its
reference in one step.  With stiffness k, damping d, step size h and deflection x, the implicit force is -k (x + h v) -
d v.  This is a motor with target rate -x k / (h k + d) and compliance 1 / (h k + d).  It is stable for any stiffness,
but damps fast oscillations.
"""
from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Dict, List, Optional, Tuple

import numpy as np
import ode

from m2wr_sim.geometry import compose, matrix_from_quaternion, rotate, rotate_inverse
from m2wr_sim.physics.pyode_bodies import PARAM_CFM, PARAM_FMAX, PARAM_VEL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Vector
    from m2wr_sim.model.types import Inertial, Link
    from m2wr_sim.physics.parts import JointDrive, LinkBody, ModelParts

STABLE = 1.0                # greatest relative change of rate, or deflection, by an explicit force in one step
_STRONGEST = 1e6            # times the bound by STABLE: with more damping a joint does not move, within rounding
_LEAST = 1e-12              # N m s/rad; less has no effect, and its inverse may overflow
_WEAKEST_MOTION = 1e-9      # 1/kg or 1/(kg m^2); mobility of a body that practically does not move


def slow_down(joints: List[JointDrive], links: List[LinkBody]) -> None:
    """Apply explicit damping and springs to joints, update implicit springs, and reduce velocities of damped links.

    Parameters
    ----------
    joints : list of JointDrive
        Joints with damping or a spring.
    links : list of LinkBody
        Links with linear or angular damping.
    """
    for drive in joints:
        axis, joint = drive.spec.axis, drive.joint
        position, rate = (joint.getAngle(), joint.getAngleRate()) if drive.hinge else (
            joint.getPosition(), joint.getPositionRate())
        if drive.pull:
            drive.dampers[0].steer(-drive.pull * (position - axis.spring_reference))
            continue
        push = joint.addTorque if drive.hinge else joint.addForce
        push(-drive.damping * rate - drive.stiffness * (position - axis.spring_reference))
    for link in links:
        for scale, get, put in ((link.spec.linear_damping, link.body.getLinearVel, link.body.setLinearVel),
                                (link.spec.angular_damping, link.body.getAngularVel, link.body.setAngularVel)):
            keep = max(0.0, 1.0 - scale)
            put(tuple(keep * value for value in get()))


class Damper:
    """The solver's damper on one axis of a joint: a motor of libode between the joint's two bodies.

    Parameters
    ----------
    world : ode.World
    drive : JointDrive
    bodies : (ode.Body, ode.Body)
        Of the child and the parent.
    axis : (3,) of float
        In the world.
    held_by : int
        Body with which the axis rotates: 1, the child; 2, the parent; 0, the world.

    Attributes
    ----------
    number : int
        Greater than those of all earlier dampers.
    """

    _numbers = itertools.count()

    def __init__(self, world: ode.World, drive: JointDrive, bodies: Tuple[ode.Body, ode.Body], axis: Vector,
                 held_by: int) -> None:
        self.number = next(self._numbers)
        self._motor = (ode.LMotor if drive.spec.kind == "prismatic" else ode.AMotor)(world)
        self._motor.attach(*bodies)
        if drive.spec.kind != "prismatic":
            self._motor.setMode(ode.AMotorUser)
        self._motor.setNumAxes(1)
        self._motor.setAxis(0, held_by, axis)
        self._motor.setParam(PARAM_FMAX, math.inf)

    def set(self, damping: float) -> None:
        """Set the damping [N m s/rad or N s/m]."""
        self._motor.setParam(PARAM_CFM, 1.0 / damping)
        self.steer(0.0)

    def steer(self, rate: float) -> None:
        """Set the target rate [rad/s or m/s]; for a spring, before every step."""
        self._motor.setParam(PARAM_VEL, rate)

    def remove(self) -> None:
        """Detach the damper."""
        self._motor.attach(None, None)


def mobilities(drive: JointDrive, links: Dict[str, LinkBody]) -> List[float]:
    """Return the mobilities of child and parent of a joint along its one axis [1/kg or 1/(kg m^2)].

    Links connected by further joints are not included.  0 for the world, and for static or kinematic links.

    Parameters
    ----------
    drive : JointDrive
    links : dict
        Name of a link -> LinkBody, of the joint's model.

    Returns
    -------
    list of 2 floats
    """
    spec = drive.spec
    child = links[spec.child].spec
    axis = rotate(child.pose[1], rotate(spec.pose[1], spec.axis.xyz))           # in the model's axes
    arm = _arm(child, links[spec.parent].spec, axis) if spec.parent in links else 0.0
    found = []
    for name in (spec.child, spec.parent):
        link = links.get(name)
        if link is None or link.body is None or link.spec.kinematic:
            found.append(0.0)
        elif spec.kind == "prismatic":
            found.append(1.0 / link.spec.inertial.mass + arm * arm * _angular_mobility(link.spec.inertial))
        else:
            turned = rotate_inverse(link.spec.pose[1], axis)
            found.append(_angular_mobility(link.spec.inertial, np.array(turned)))
    return found


def _arm(child: Link, parent: Link, axis: Vector) -> float:
    """Return the lever arm [m] of a force along a slider, which libode applies in the middle between its links."""
    apart = np.subtract(compose(child.pose, child.inertial.pose)[0], compose(parent.pose, parent.inertial.pose)[0])
    return 0.5 * float(np.linalg.norm(np.cross(apart, axis)) / np.linalg.norm(axis))


def _angular_mobility(inertial: Inertial, axis: Optional[NDArray[np.float64]] = None) -> float:
    """Return the angular acceleration about an axis of the link, by default that of least inertia, per torque."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    tensor = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    if axis is None:
        return 1.0 / float(np.linalg.eigvalsh(tensor)[0])
    along = matrix_from_quaternion(inertial.pose[1]).T @ axis / np.linalg.norm(axis)
    return float(along @ np.linalg.solve(tensor, along))


def settle(world: ode.World, parts: ModelParts, dt: float) -> None:
    """Choose explicit or implicit damping and springs for each joint of a model.

    For explicit forces this sets ``drive.damping`` and ``drive.stiffness``.  For implicit ones it sets
    ``drive.dampers``, and ``drive.pull`` [1/s], the target rate of a spring per deflection.

    The sum of the effects of all dampers of a link must not exceed STABLE, so each one counts the link as often as it
    has dampers or springs.  Explicit forces within that bound never add energy.  A spring of negative stiffness is
    always explicit.

    Parameters
    ----------
    world : ode.World
    parts : ModelParts
    dt : float
        Step [s].
    """
    if not parts.joints:
        return
    links = {link.spec.name: link for link in parts.links}
    damped = [drive for drive in parts.joints if (drive.spec.axis.damping or drive.spec.axis.spring_stiffness)
              and drive.spec.kind in ("revolute", "prismatic")]
    ends = [end for drive in damped for end in (drive.spec.child, drive.spec.parent)]
    for drive in parts.joints:
        if drive.spec.kind in ("universal", "screw"):
            _settle_in_solver(world, drive, links)
            continue
        axis = drive.spec.axis
        damping, stiffness = (abs(axis.damping), axis.spring_stiffness) if drive in damped else (0.0, 0.0)
        bound = math.inf
        if drive in damped:
            motion = sum(mobility * ends.count(end) for mobility, end in zip(
                mobilities(drive, links), (drive.spec.child, drive.spec.parent)))
            bound = STABLE / (max(motion, _WEAKEST_MOTION) * dt)
        drive.damping, drive.stiffness, drive.pull, wanted = damping, stiffness, 0.0, {}
        if max(damping, dt * stiffness) > bound:
            pulling = max(stiffness, 0.0)
            strength = damping + dt * pulling
            drive.damping, drive.stiffness, drive.pull = 0.0, stiffness - pulling, pulling / strength
            wanted = {0: min(strength, _STRONGEST * bound)}
        _fit(world, drive, links, wanted)


def _settle_in_solver(world: ode.World, drive: JointDrive, links: Dict[str, LinkBody]) -> None:
    """Damp all axes of a joint through the solver."""
    _fit(world, drive, links, {index: min(abs(axis.damping), 1.0 / _WEAKEST_MOTION)
                               for index, axis in enumerate(drive.spec.axes()) if abs(axis.damping) > _LEAST})


def _fit(world: ode.World, drive: JointDrive, links: Dict[str, LinkBody], wanted: Dict[int, float]) -> None:
    """Give a joint dampers of the given strengths, by axis, and remove all others."""
    for index in [index for index in drive.dampers if index not in wanted]:
        drive.dampers.pop(index).remove()
    parent = links.get(drive.spec.parent)
    for index, damping in wanted.items():
        if index not in drive.dampers:
            bodies = (links[drive.spec.child].body, ode.environment if parent is None else parent.body)
            if drive.spec.kind != "universal":
                axis, held_by = drive.joint.getAxis(), 1
            elif index:
                axis, held_by = drive.joint.getAxis1(), 1           # the second one is the child's
            else:
                axis, held_by = drive.joint.getAxis2(), 0 if parent is None else 2
            drive.dampers[index] = Damper(world, drive, bodies, axis, held_by)
        drive.dampers[index].set(damping)
