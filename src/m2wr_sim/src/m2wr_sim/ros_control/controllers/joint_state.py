# SPDX-License-Identifier: BSD-3-Clause
"""joint_state_controller/JointStateController: publishes the state of all joints with a transmission."""
from __future__ import annotations

import math
from typing import Any, List

from m2wr_sim.control_messages import JointState as JointStateMessage
from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode, Due
from m2wr_sim.ros_control.hardware import STATE, JointHandle, RobotHardware


class JointState(Controller):
    """Publishes ``joint_states`` in the namespace of the robot; claims nothing."""

    interface = STATE

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        if node.value("publish_rate") is None:
            node.fail("publish_rate", "a rate in Hz; Parameter 'publish_rate' not set")
        rate = node.number("publish_rate", least=0.0)
        self._due = Due(rate) if rate > 0.0 else None
        names = node.names("joints") if node.value("joints") is not None else sorted(hardware.joints)
        self._read: List[JointHandle] = [hardware.handle(name, STATE) for name in names]
        self._message = JointStateMessage()
        self._extra = self._extra_joints(node, names)
        self._message.name = names + [joint[0] for joint in self._extra]
        self._node = node
        self._port = node.advertise("joint_states", JointStateMessage, 100, of_robot=True)

    @staticmethod
    def _extra_joints(node: ControllerNode, names: List[str]) -> List[Any]:
        """Return name, position, velocity and effort of joints that are published but not measured."""
        found: List[Any] = []
        entries = node.value("extra_joints", [])
        for entry in entries if isinstance(entries, list) else [entries]:
            name = entry.get("name") if isinstance(entry, dict) else None
            values = [entry.get(key, 0.0) for key in ("position", "velocity", "effort")] if name else []
            if not isinstance(name, str) or not all(
                    isinstance(value, (int, float)) and math.isfinite(value) for value in values):
                node.fail("extra_joints", "a list of {name, position, velocity, effort} with finite numbers")
            if name in names:
                node.log.warning("Joint state interface already contains information for joint '%s'. The extra one is "
                                 "ignored.", name)
            else:
                found.append((name, *map(float, values)))
        return found

    def starting(self, now_ns: int) -> None:
        if self._due is not None:
            self._due.restart(now_ns, at_once=True)

    def update(self, now_ns: int, dt: float) -> None:
        if self._due is None or not self._due.due(now_ns) or not self._port.wanted():
            return
        message = self._message
        message.header.stamp = self._node.moment(now_ns)
        message.position = [joint.position for joint in self._read] + [joint[1] for joint in self._extra]
        message.velocity = [joint.velocity for joint in self._read] + [joint[2] for joint in self._extra]
        message.effort = [joint.effort for joint in self._read] + [joint[3] for joint in self._extra]
        self._port.publish(message)
