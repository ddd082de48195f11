# SPDX-License-Identifier: BSD-3-Clause
"""ackermann_steering_controller/AckermannSteeringController: a driven rear wheel and a steered front wheel."""
from __future__ import annotations

import math

from m2wr_sim.errors import PluginError
from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode, read_joints
from m2wr_sim.ros_control.controllers.odometry import OdometryPublisher, PlanarOdometry, TwistCommand
from m2wr_sim.ros_control.hardware import POSITION, VELOCITY, RobotHardware

_STEEPEST = math.radians(89.0)      # rad: beyond, the tangent of a steering angle has no meaning for odometry


class Ackermann(Controller):
    """Drives one rear wheel and steers one front wheel, which may be virtual ones in the middle of the axles.

    As in ros_controllers, ``angular.z`` of a command is the steering angle itself [rad].
    """

    interface = VELOCITY

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        rear, front = node.names("rear_wheel"), node.names("front_steer")
        self._rear, = read_joints(node, hardware, VELOCITY, rear[:1])
        self._front, = read_joints(node, hardware, POSITION, front[:1])
        self.joints = [self._rear, self._front]
        base = node.value("wheel_separation_h")
        base = node.description.wheel_separation(rear[0], front[0]) if base is None else node.number(
            "wheel_separation_h")
        radius = node.value("wheel_radius")
        radius = node.description.wheel_radius(rear[0]) if radius is None else node.number("wheel_radius")
        self._base = base * node.number("wheel_separation_h_multiplier", 1.0)
        self._radius = radius * node.number("wheel_radius_multiplier", 1.0)
        self._steer = node.number("steer_pos_multiplier", 1.0)
        if not (self._base > 0.0 and self._radius > 0.0):
            raise PluginError("%s: read a wheel base of %g m and a radius of %g m; expected lengths above 0"
                              % (node.namespace, self._base, self._radius))
        self._odometry = PlanarOdometry(int(node.number("velocity_rolling_window_size", 10, least=1)))
        self._publisher, self._command, self._rolled = OdometryPublisher(node), TwistCommand(node), 0.0

    def starting(self, now_ns: int) -> None:
        self._rear.command, self._front.command = 0.0, self._front.position
        self._rolled = self._rear.position
        self._odometry.restart()
        self._publisher.restart(now_ns)
        self._command.restart()
        self._command.running = True

    def update(self, now_ns: int, dt: float) -> None:
        rolled = self._rear.position
        distance, self._rolled = (rolled - self._rolled) * self._radius, rolled
        angle = max(-_STEEPEST, min(_STEEPEST, self._front.position * self._steer))
        self._odometry.move(distance, distance * math.tan(angle) / self._base, dt)
        self._publisher.publish(now_ns, self._odometry)
        linear, angle = self._command.update(now_ns, dt)
        self._rear.command, self._front.command = linear / self._radius, angle

    def stopping(self, now_ns: int) -> None:
        self._command.running = False
        self._rear.command = 0.0
