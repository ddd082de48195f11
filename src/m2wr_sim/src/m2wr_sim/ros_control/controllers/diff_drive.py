# SPDX-License-Identifier: BSD-3-Clause
"""diff_drive_controller/DiffDriveController: velocity commands to the wheels of two sides, and wheel odometry."""
from __future__ import annotations

from typing import List, Sequence, Tuple

from m2wr_sim.control_messages import JointTrajectoryControllerState
from m2wr_sim.errors import PluginError
from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode, read_joints
from m2wr_sim.ros_control.controllers.odometry import OdometryPublisher, PlanarOdometry, TwistCommand
from m2wr_sim.ros_control.hardware import VELOCITY, JointHandle, RobotHardware


class DiffDrive(Controller):
    """Drives any number of wheels on each side."""

    interface = VELOCITY

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        left, right = self._wheels(node)
        self._left, self._right = (read_joints(node, hardware, VELOCITY, names) for names in (left, right))
        self.joints = [*self._left, *self._right]
        separation, radius = wheel_geometry(node, left[0], right[0])
        self._separation = separation * node.number("wheel_separation_multiplier", 1.0)
        both = node.number("wheel_radius_multiplier", 1.0)
        self._radii = (radius * node.number("left_wheel_radius_multiplier", both),
                       radius * node.number("right_wheel_radius_multiplier", both))
        if not (self._separation > 0.0 and min(self._radii) > 0.0):
            raise PluginError("%s: read a wheel separation of %g m and radii of %g and %g m; expected lengths above 0"
                              % (node.namespace, self._separation, self._radii[0], self._radii[1]))
        self._open_loop = node.flag("open_loop", False)
        window = int(node.number("velocity_rolling_window_size", 10, least=1))
        if not 1 <= window <= 100000:
            node.fail("velocity_rolling_window_size", "a whole number from 1 to 100000")
        self._odometry, self._publisher = PlanarOdometry(window), OdometryPublisher(node)
        self._command = TwistCommand(node)
        self._travelled = (0.0, 0.0)
        self._states = WheelStates(node, self._left, self._right) if node.flag(
            "publish_wheel_joint_controller_state", False) else None

    @staticmethod
    def _wheels(node: ControllerNode) -> Tuple[List[str], List[str]]:
        for side in ("left_wheel", "right_wheel"):
            if node.value(side) is None:
                node.fail(side, "a joint or a list of joints; Couldn't retrieve wheel param '%s'." % side)
        left, right = node.names("left_wheel"), node.names("right_wheel")
        if len(left) != len(right):
            raise PluginError("%s: #left wheels (%d) != #right wheels (%d). Expected as many on each side."
                              % (node.namespace, len(left), len(right)))
        if set(left) & set(right):
            raise PluginError("%s: joint %s is both a left and a right wheel; expected each joint once"
                              % (node.namespace, sorted(set(left) & set(right))[0]))
        return left, right

    def _positions(self) -> Tuple[float, float]:
        """Return how far each side has rolled [m]."""
        left = right = 0.0
        for joint in self._left:
            left += joint.position
        for joint in self._right:
            right += joint.position
        return left / len(self._left) * self._radii[0], right / len(self._right) * self._radii[1]

    def starting(self, now_ns: int) -> None:
        for joint in self.joints:
            joint.command = 0.0
        self._travelled = self._positions()
        self._odometry.restart()
        self._publisher.restart(now_ns)
        self._command.restart()
        self._command.running = True

    def update(self, now_ns: int, dt: float) -> None:
        if self._open_loop:
            linear, angular = self._command.last
            self._odometry.move(linear * dt, angular * dt, dt)
        else:
            left, right = self._positions()
            before_left, before_right = self._travelled
            self._travelled = left, right
            left, right = left - before_left, right - before_right
            self._odometry.move(0.5 * (right + left), (right - left) / self._separation, dt)
        self._publisher.publish(now_ns, self._odometry)
        linear, angular = self._command.update(now_ns, dt)
        turn = 0.5 * angular * self._separation
        left_speed, right_speed = (linear - turn) / self._radii[0], (linear + turn) / self._radii[1]
        for joint in self._left:
            joint.command = left_speed
        for joint in self._right:
            joint.command = right_speed
        if self._states is not None:
            self._states.publish(now_ns, dt, left_speed, right_speed)

    def stopping(self, now_ns: int) -> None:
        self._command.running = False
        for joint in self.joints:
            joint.command = 0.0


class WheelStates:
    """Publishes ``wheel_joint_controller_state``: what is wanted of the wheels, and what they do.

    Parameters
    ----------
    node : ControllerNode
    left, right : sequence of JointHandle
    """

    def __init__(self, node: ControllerNode, left: Sequence[JointHandle], right: Sequence[JointHandle]) -> None:
        self._node, self._joints, self._left = node, [*left, *right], len(left)
        self._port = node.advertise("wheel_joint_controller_state", JointTrajectoryControllerState, 100)
        self._positions = [0.0] * len(self._joints)
        self._wanted, self._measured = [0.0] * len(self._joints), [0.0] * len(self._joints)

    def publish(self, now_ns: int, dt: float, left: float, right: float) -> None:
        """Publish the state; ``left`` and ``right`` [rad/s] are commanded since now, ``dt`` [s] after the last ones.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        dt : float
            Time since the last call [s].
        left : float
            Rate of the left wheels [rad/s].
        right : float
            Rate of the right wheels [rad/s].
        """
        wanted = [left] * self._left + [right] * self._left
        measured = [joint.velocity for joint in self._joints]
        self._positions = [position + rate * dt for position, rate in zip(self._positions, wanted)]
        if self._port.wanted() and dt > 0.0:
            message = JointTrajectoryControllerState(joint_names=[joint.name for joint in self._joints])
            message.header.stamp = self._node.moment(now_ns)
            desired, actual, error = message.desired, message.actual, message.error
            desired.positions, desired.velocities = list(self._positions), wanted
            desired.accelerations = [(new - old) / dt for new, old in zip(wanted, self._wanted)]
            actual.positions, actual.velocities = [joint.position for joint in self._joints], measured
            actual.accelerations = [(new - old) / dt for new, old in zip(measured, self._measured)]
            actual.effort = [joint.effort for joint in self._joints]
            for field in ("positions", "velocities", "accelerations"):
                setattr(error, field, [want - have for want, have in zip(
                    getattr(desired, field), getattr(actual, field))])
            self._port.publish(message)
        self._wanted, self._measured = wanted, measured


def wheel_geometry(node: ControllerNode, left: str, right: str) -> Tuple[float, float]:
    """Return wheel separation and radius [m]: the parameters, or what the description says.

    Parameters
    ----------
    node : ControllerNode
    left, right : str
        Joints of the first wheel on each side.

    Raises
    ------
    PluginError
        If neither has it.
    """
    separation, radius = node.value("wheel_separation"), node.value("wheel_radius")
    return (node.description.wheel_separation(left, right) if separation is None else node.number("wheel_separation"),
            node.description.wheel_radius(left) if radius is None else node.number("wheel_radius"))
