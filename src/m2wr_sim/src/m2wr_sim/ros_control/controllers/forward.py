# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that pass a command on to their joint or joints, of position, velocity and effort."""
from __future__ import annotations

import math
from typing import Any, List

from m2wr_sim.control_messages import Float64, Float64MultiArray
from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode, read_joints
from m2wr_sim.ros_control.hardware import EFFORT, POSITION, VELOCITY, RobotHardware


class Forward(Controller):
    """One joint; commands come as std_msgs/Float64 on ``command``. At the start the joint is held, or at rest."""

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        if node.value("joint") is None:
            node.fail("joint", "the name of a joint; No joint given (namespace: %s)" % node.namespace)
        self._node = node
        self.joints = list(read_joints(node, hardware, self.interface, node.names("joint")[:1]))
        self.wanted: List[float] = [0.0]
        node.subscribe("command", Float64, lambda message: self.set([message.data]))

    def set(self, values: List[float]) -> None:
        """Set the commands of all joints; values that are not finite are rejected with a warning."""
        if all(math.isfinite(value) for value in values):
            self.wanted = list(values)
        else:
            self._node.log.warning("%s: rejected the command %s; expected finite numbers. The last command stays.",
                                   self._node.namespace, list(values))

    def starting(self, now_ns: int) -> None:
        self.wanted = [joint.position if self.interface == POSITION else 0.0 for joint in self.joints]

    def update(self, now_ns: int, dt: float) -> None:
        for joint, value in zip(self.joints, self.wanted):
            joint.command = value

    def stopping(self, now_ns: int) -> None:
        if self.interface != POSITION:
            for joint in self.joints:
                joint.command = 0.0


class ForwardGroup(Forward):
    """Several joints; commands come as std_msgs/Float64MultiArray."""

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        if node.value("joints") is None:
            node.fail("joints", "a list of joints; Failed to getParam 'joints' (namespace: %s)." % node.namespace)
        self._node = node
        self.joints = list(read_joints(node, hardware, self.interface, node.names("joints")))
        self.wanted = [0.0] * len(self.joints)
        node.subscribe("command", Float64MultiArray, self._store)

    def _store(self, message: Any) -> None:
        if len(message.data) != len(self.joints):
            self._node.log.error("%s: Dimension of command (%d) does not match number of joints (%d)! Not executing!",
                                 self._node.namespace, len(message.data), len(self.joints))
        else:
            self.set(list(message.data))


class PositionForward(Forward):
    """position_controllers/JointPositionController."""

    interface = POSITION


class VelocityForward(Forward):
    """velocity_controllers/JointVelocityController."""

    interface = VELOCITY


class EffortForward(Forward):
    """effort_controllers/JointEffortController."""

    interface = EFFORT


class PositionGroup(ForwardGroup):
    """position_controllers/JointGroupPositionController."""

    interface = POSITION


class VelocityGroup(ForwardGroup):
    """velocity_controllers/JointGroupVelocityController."""

    interface = VELOCITY


class EffortGroup(ForwardGroup):
    """effort_controllers/JointGroupEffortController."""

    interface = EFFORT
