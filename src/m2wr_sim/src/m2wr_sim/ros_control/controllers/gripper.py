# SPDX-License-Identifier: BSD-3-Clause
"""GripperActionController, of position and effort: closes or opens a joint until it is there, or stalls."""
from __future__ import annotations

import math
from typing import Any, Optional

from m2wr_sim.control_messages import GripperCommandActionFeedback, GripperCommandActionGoal, GripperCommandActionResult
from m2wr_sim.ros_control.action_server import ABORTED, PREEMPTED, SUCCEEDED, ActionServer
from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode, read_joints
from m2wr_sim.ros_control.hardware import EFFORT, POSITION, RobotHardware
from m2wr_sim.ros_control.pid import Pid, read_gains


class Gripper(Controller):
    """Follows the goals of the action ``gripper_cmd``; a gripper that stalls ends its goal as aborted."""

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        self._node, self._running = node, False
        if node.value("joint") is None:
            node.fail("joint", "the name of a joint; Could not find joint name on param server")
        self.joints = list(read_joints(node, hardware, self.interface, node.names("joint")[:1]))
        self._tolerance = abs(node.number("goal_tolerance", 0.01))
        self._default_effort = abs(node.number("max_effort", 0.0))
        self._slow = node.number("stall_velocity_threshold", 0.001, least=0.0)
        self._stall_ns = int(node.number("stall_timeout", 1.0, least=0.0) * 1e9)
        self._pid: Optional[Pid] = None
        if self.interface == EFFORT:
            place = "gains/" + self.joints[0].name
            self._pid = Pid(read_gains(node.value(place), "%s/%s" % (node.namespace, place)))
        self._position, self._effort, self._moved_ns = 0.0, self._default_effort, 0
        self._action = ActionServer(node, "gripper_cmd", (
            GripperCommandActionGoal, GripperCommandActionFeedback, GripperCommandActionResult), self._accept,
            self._hold)

    def _accept(self, goal: Any) -> Any:
        command, text = goal.command, ""
        if not self._running:
            text = "Can't accept new action goals. Controller is not running."
        elif not (math.isfinite(command.position) and math.isfinite(command.max_effort)):
            text = ("read a position of %s and a greatest effort of %s; expected finite numbers"
                    % (command.position, command.max_effort))
        if text:
            self._node.log.error("%s: rejected a goal: %s", self._node.namespace, text)
            return self._result(False, False), text
        self._position, self._effort, self._moved_ns = command.position, abs(command.max_effort), self._node.now_ns
        return None

    def _result(self, reached: bool, stalled: bool) -> Any:
        result = GripperCommandActionResult().result
        result.position, result.effort = self.joints[0].position, self.joints[0].command
        result.reached_goal, result.stalled = reached, stalled
        return result

    def _hold(self) -> None:
        """Stay where the joint is."""
        self._position, self._effort = self.joints[0].position, self._default_effort

    def starting(self, now_ns: int) -> None:
        self._running, self._moved_ns = True, now_ns
        self._hold()
        if self._pid is not None:
            self._pid.reset()

    def update(self, now_ns: int, dt: float) -> None:
        joint = self.joints[0]
        error = self._position - joint.position
        if self._action.active:
            self._check(now_ns, error, joint.velocity)
        if self._pid is None:
            joint.command = self._position
        else:
            effort = self._pid.update(error, dt, -joint.velocity)
            joint.command = max(-self._effort, min(self._effort, effort))
        self._action.spin(now_ns)

    def _check(self, now_ns: int, error: float, velocity: float) -> None:
        """End the goal if the joint is there, or has not moved for too long."""
        if abs(error) < self._tolerance:
            self._action.end(SUCCEEDED, self._result(True, False))
        elif abs(velocity) > self._slow:
            self._moved_ns = now_ns
        elif now_ns - self._moved_ns > self._stall_ns:
            self._action.end(ABORTED, self._result(False, True), "the gripper stalled")

    def stopping(self, now_ns: int) -> None:
        self._running = False
        self._action.end(PREEMPTED, self._result(False, False), "the controller was stopped")
        if self.interface == EFFORT:
            self.joints[0].command = 0.0


class PositionGripper(Gripper):
    """position_controllers/GripperActionController."""

    interface = POSITION


class EffortGripper(Gripper):
    """effort_controllers/GripperActionController."""

    interface = EFFORT
