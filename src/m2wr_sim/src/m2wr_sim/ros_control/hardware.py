# SPDX-License-Identifier: BSD-3-Clause
"""The joints of a robot as hardware interfaces: what Gazebo's DefaultRobotHWSim does."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, Iterable, List, Optional

from m2wr_sim.errors import PluginError
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.ros_control.joint_limits import JointLimits

if TYPE_CHECKING:
    from m2wr_sim.physics.engine import Engine
    from m2wr_sim.ros_control.pid import Pid

EFFORT = "hardware_interface/EffortJointInterface"
POSITION = "hardware_interface/PositionJointInterface"
VELOCITY = "hardware_interface/VelocityJointInterface"
STATE = "hardware_interface/JointStateInterface"
INTERFACES = (EFFORT, POSITION, VELOCITY)

UNBOUNDED_EFFORT = 1e6      # N m or N: a joint without an effort limit; the solver loses digits beyond
FASTEST_SERVO = 50.0        # rad/s or m/s of a position servo without a velocity limit; hobby servos reach 10 rad/s


class JointHandle:
    """State and command of one joint; controllers read and write its attributes.

    Parameters
    ----------
    name : str
    number : int
        The engine's number of the joint.
    interface : str
        How it is commanded, one of :data:`INTERFACES`.
    limits : JointLimits
        Of its commands.
    effort_limit : float or None
        Of its motor [N m or N]; None: unbounded.
    angular, continuous : bool
        Whether it rotates, and without position limits.
    pid : Pid or None
        For position and velocity commands; None: a motor.

    Attributes
    ----------
    position, velocity, effort : float
        State at the last :meth:`RobotHardware.read` [rad or m, s, N m or N].
    command : float
        Position, velocity or effort, as the interface says.
    """

    __slots__ = ("name", "number", "interface", "limits", "limited", "effort_limit", "angular", "continuous", "pid",
                 "position", "velocity", "effort", "command", "last", "motor")

    def __init__(self, name: str, number: int, interface: str, limits: JointLimits, effort_limit: Optional[float],
                 angular: bool, continuous: bool, pid: Optional[Pid] = None) -> None:
        self.name, self.number, self.interface = name, number, interface
        self.limits, self.limited = limits, limits.any
        self.effort_limit = UNBOUNDED_EFFORT if effort_limit is None else min(abs(effort_limit), UNBOUNDED_EFFORT)
        self.angular, self.continuous, self.pid = angular, continuous, pid
        self.position = self.velocity = self.effort = self.command = self.last = 0.0
        self.motor: Optional[float] = None          # speed to which the motor is set

    def position_error(self, wanted: float) -> float:
        """Return the way to a position: for a continuous joint the shortest turn."""
        return math.remainder(wanted - self.position, math.tau) if self.continuous else wanted - self.position


class RobotHardware:
    """All joints with a transmission.

    Parameters
    ----------
    engine : Engine
    joints : iterable of JointHandle
    """

    def __init__(self, engine: Engine, joints: Iterable[JointHandle]) -> None:
        self._engine = engine
        self.joints: Dict[str, JointHandle] = {joint.name: joint for joint in joints}
        self._all: List[JointHandle] = list(self.joints.values())
        self.stopped = False
        #: Whether :meth:`write` has work in each step; velocity motors keep what was set.
        self.restless = any(joint.pid is not None or joint.interface != VELOCITY for joint in self._all)
        self.hold()

    def handle(self, name: str, interface: str) -> JointHandle:
        """Return a joint for a controller.

        Parameters
        ----------
        name : str
        interface : str
            One of :data:`INTERFACES`, or :data:`STATE` to read only.

        Raises
        ------
        PluginError
            If there is no such joint, or it is not commanded by this interface.
        """
        joint = self.joints.get(name)
        if joint is not None and interface in (STATE, joint.interface):
            return joint
        title = interface.replace("/", "::")
        same = [other.name for other in self._all if interface in (STATE, other.interface)]
        if not same:
            raise PluginError("This controller requires a hardware interface of type '%s'. Make sure this is "
                              "registered in the hardware_interface::RobotHW class. No transmission has it." % title)
        raise PluginError("Could not find resource '%s' in '%s'. It has %s." % (name, title, ", ".join(sorted(same))))

    def read(self) -> None:
        """Read the state of all joints."""
        engine = self._engine
        for joint in self._all:
            joint.position, joint.velocity = engine.joint_angle(joint.number), engine.joint_rate(joint.number)

    def hold(self) -> None:
        """Command all joints to stay where they are, and discard the past."""
        self.read()
        for joint in self._all:
            joint.command = joint.last = joint.position if joint.interface == POSITION else 0.0
            joint.effort, joint.motor = 0.0, None
            if joint.pid is not None:
                joint.pid.reset()

    def write(self, dt: float) -> None:
        """Apply the commands in the next step; ``dt`` [s] is its length."""
        for joint in self._all:
            interface, command = joint.interface, joint.command
            if not math.isfinite(command):
                command = joint.command = joint.last
            if interface == VELOCITY:
                self._write_velocity(joint, 0.0 if self.stopped else command, dt)
            elif interface == POSITION:
                self._write_position(joint, joint.last if self.stopped else command, dt)
            else:
                command = 0.0 if self.stopped else command
                if joint.limited:
                    command = joint.limits.effort_command(command, joint.position, joint.velocity)
                self._push(joint, command)

    def _write_velocity(self, joint: JointHandle, command: float, dt: float) -> None:
        if joint.limited:
            command = joint.limits.velocity_command(command, joint.last, joint.position, dt)
        joint.last = command
        if joint.pid is not None:
            self._push(joint, joint.pid.update(command - joint.velocity, dt))
        elif command != joint.motor:
            joint.motor = command = min(FASTEST, max(-FASTEST, command))
            self._engine.set_joint_motor(joint.number, command, joint.effort_limit)

    def _write_position(self, joint: JointHandle, command: float, dt: float) -> None:
        if joint.limited:
            command = joint.limits.position_command(command, joint.last, dt)
        joint.last = command
        error = joint.position_error(command)
        if joint.pid is not None:
            self._push(joint, joint.pid.update(error, dt))
            return
        # Gazebo places the joint; a strong motor reaches the same position at the end of the step, and feels contacts
        fastest = FASTEST_SERVO if joint.limits.velocity is None else max(joint.limits.velocity, 1e-3)
        speed = min(fastest, max(-fastest, error / dt))
        if speed != joint.motor:
            joint.motor = speed
            self._engine.set_joint_motor(joint.number, speed, UNBOUNDED_EFFORT)

    def _push(self, joint: JointHandle, effort: float) -> None:
        joint.effort = effort = min(joint.effort_limit, max(-joint.effort_limit, effort))
        if abs(joint.velocity) < FASTEST:
            self._engine.add_joint_force(joint.number, effort)
