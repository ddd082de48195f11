# SPDX-License-Identifier: BSD-3-Clause
"""Controllers with a PID for each joint: position by effort or velocity, velocity by effort."""
from __future__ import annotations

from typing import Any, List

from m2wr_sim.control_messages import JointControllerState
from m2wr_sim.ros_control.controllers.base import ControllerNode
from m2wr_sim.ros_control.controllers.forward import Forward, ForwardGroup
from m2wr_sim.ros_control.hardware import EFFORT, VELOCITY, JointHandle, RobotHardware
from m2wr_sim.ros_control.pid import Pid, read_gains

_STATES = 10            # control cycles between two messages about the state


class _JointPid(Forward):
    """One joint with a PID; publishes ``state``, control_msgs/JointControllerState."""

    of_position = True

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        super().configure(node, hardware)
        self._pids = [Pid(read_gains(node.value("pid"), node.namespace + "/pid"))]
        self._port: Any = node.advertise("state", JointControllerState, 1)
        self._message, self._cycles = JointControllerState(), 0

    def starting(self, now_ns: int) -> None:
        self.wanted = [joint.position if self.of_position else 0.0 for joint in self.joints]
        for pid in self._pids:
            pid.reset()

    def update(self, now_ns: int, dt: float) -> None:
        for joint, pid, wanted in zip(self.joints, self._pids, self.wanted):
            joint.command = pid.update(self.error(joint, wanted), dt)
        self._publish(now_ns, dt)

    def error(self, joint: JointHandle, wanted: float) -> float:
        """Return desired minus measured value; a position is first moved into the limits of the joint."""
        if not self.of_position:
            return wanted - joint.velocity
        if joint.limits.position is not None:
            low, high = joint.limits.position
            wanted = max(low, min(high, wanted))
        return joint.position_error(wanted)

    def _publish(self, now_ns: int, dt: float) -> None:
        self._cycles += 1
        if self._cycles % _STATES != 1 or not self._port.wanted():
            return
        message, joint, gains = self._message, self.joints[0], self._pids[0].gains
        message.header.stamp, message.time_step = self._node.moment(now_ns), dt
        message.set_point = self.wanted[0]
        message.process_value = joint.position if self.of_position else joint.velocity
        message.process_value_dot = joint.velocity
        message.error, message.command = self.error(joint, self.wanted[0]), joint.command
        message.p, message.i, message.d = gains.p, gains.i, gains.d
        message.i_clamp, message.antiwindup = gains.i_max, gains.antiwindup
        self._port.publish(message)

    def stopping(self, now_ns: int) -> None:
        for joint in self.joints:
            joint.command = 0.0


class PositionByEffort(_JointPid):
    """effort_controllers/JointPositionController."""

    interface = EFFORT


class PositionByVelocity(_JointPid):
    """velocity_controllers/JointPositionController."""

    interface = VELOCITY


class VelocityByEffort(_JointPid):
    """effort_controllers/JointVelocityController."""

    interface, of_position = EFFORT, False


class PositionGroupByEffort(ForwardGroup):
    """effort_controllers/JointGroupPositionController; the gains are in ``JOINT/pid``."""

    interface = EFFORT

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        super().configure(node, hardware)
        self._pids: List[Pid] = [Pid(read_gains(node.value(joint.name + "/pid"), "%s/%s/pid" % (
            node.namespace, joint.name))) for joint in self.joints]

    def starting(self, now_ns: int) -> None:
        self.wanted = [joint.position for joint in self.joints]
        for pid in self._pids:
            pid.reset()

    def update(self, now_ns: int, dt: float) -> None:
        for joint, pid, wanted in zip(self.joints, self._pids, self.wanted):
            joint.command = pid.update(joint.position_error(wanted), dt)
