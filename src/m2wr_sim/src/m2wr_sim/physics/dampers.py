# SPDX-License-Identifier: BSD-3-Clause
"""Damping and springs of joints: as a force found before each step where that is stable, else through the solver.

A damping force that is found from the rate before the step drives a joint instead of braking it once it takes away more
than twice the rate in one step.  The solver knows no such bound: a motor that wants rest, as compliant as the damping
is weak, is the same force, found from the rate after the step.

A spring's force found before the step throws a joint ever farther once it changes the rate by more than four times what
takes the joint to its rest in a step.  Found after the step, from where the joint is then, it is a motor again: with
stiffness k, damping d, step h and the joint x away from its rest the force is -k (x + h v) - d v, that of a motor which
wants the rate -x k / (h k + d) with the compliance 1 / (h k + d).  No stiffness is too much for that; what swings fast
comes to rest by it.
"""
import itertools
import math

import numpy as np
import ode

from m2wr_sim.geometry import compose, matrix_from_quaternion, rotate, rotate_inverse
from m2wr_sim.physics.pyode_bodies import PARAM_CFM, PARAM_FMAX, PARAM_VEL

STABLE = 1.0                # share of a joint's rate, or way to rest, that a force found before the step may take in it
_STRONGEST = 1e6            # times what STABLE allows: beyond that a joint stands still anyway, to the last digits
_LEAST = 1e-12              # N m s/rad: less is nothing, and its inverse soon no number
_WEAKEST_MOTION = 1e-9      # 1/kg or 1/(kg m^2): a body that nothing moves


def slow_down(joints, links):
    """Push the joints that are damped by a force, or have a spring, and take speed from the links that lose some.

    The solver's springs are told where their joints are.
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

    Attributes
    ----------
    number : int
        Greater than those of all dampers made before.
    """

    _numbers = itertools.count()

    def __init__(self, world, drive, bodies, axis, held_by):
        self.number = next(self._numbers)
        self._motor = (ode.LMotor if drive.spec.kind == "prismatic" else ode.AMotor)(world)
        self._motor.attach(*bodies)
        if drive.spec.kind != "prismatic":
            self._motor.setMode(ode.AMotorUser)
        self._motor.setNumAxes(1)
        self._motor.setAxis(0, held_by, axis)
        self._motor.setParam(PARAM_FMAX, math.inf)

    def set(self, damping):
        """Brake with ``damping`` [N m s/rad or N s/m]."""
        self._motor.setParam(PARAM_CFM, 1.0 / damping)
        self.steer(0.0)

    def steer(self, rate):
        """Brake what differs from a rate [rad/s or m/s]; a spring's damper is told so before every step."""
        self._motor.setParam(PARAM_VEL, rate)

    def remove(self):
        """Take the damper off."""
        self._motor.attach(None, None)


def mobilities(drive, links):
    """Return how easily the child and the parent of a joint with one axis move along it [1/kg or 1/(kg m^2)].

    Those are the links alone, without what hangs on them; 0 for the world, and for what is driven or does not move.

    Parameters
    ----------
    drive : JointDrive
    links : dict
        Link name to LinkBody, of the joint's model.
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


def _arm(child, parent, axis):
    """Return the arm [m] with which a force along a slider, which libode applies midway, turns both of its links."""
    apart = np.subtract(*(compose(link.pose, link.inertial.pose)[0] for link in (child, parent)))
    return 0.5 * float(np.linalg.norm(np.cross(apart, axis)) / np.linalg.norm(axis))


def _angular_mobility(inertial, axis=None):
    """Return the angular acceleration about an axis of the link, or the easiest one, for a torque of one along it."""
    xx, xy, xz, yy, yz, zz = inertial.inertia
    tensor = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    if axis is None:
        return 1.0 / float(np.linalg.eigvalsh(tensor)[0])
    along = matrix_from_quaternion(inertial.pose[1]).T @ axis / np.linalg.norm(axis)
    return float(along @ np.linalg.solve(tensor, along))


def settle(world, parts, dt):
    """Choose for each joint of a model how it is damped and pulled.

    Set are ``drive.damping`` and ``drive.stiffness`` of the force found before the step, and ``drive.dampers`` with
    ``drive.pull`` [1/s], how fast the solver's spring wants to be at rest, for what is left to the solver.

    The sum of what the dampers of a link can take away in a step must stay within STABLE, so each counts the link as
    many times as there are dampers, or springs, on it.  Forces within that bound never add energy, whatever else the
    joints hold.  A spring that pushes away from its rest, of negative stiffness, is a force in any case.

    Parameters
    ----------
    world : ode.World
    parts : object with ``links`` and ``joints``
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
        if drive.spec.kind == "universal":
            _settle_universal(world, drive, links)
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


def _settle_universal(world, drive, links):
    """Damp both axes of a universal joint through the solver."""
    _fit(world, drive, links, {index: min(abs(axis.damping), 1.0 / _WEAKEST_MOTION)
                               for index, axis in enumerate(drive.spec.axes()) if abs(axis.damping) > _LEAST})


def _fit(world, drive, links, wanted):
    """Let a joint have dampers of the given strengths, by axis, and no others."""
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
