# SPDX-License-Identifier: BSD-3-Clause
"""JointTrajectoryController, of position, velocity and effort, with the FollowJointTrajectory action."""
from __future__ import annotations

from typing import Any, Dict, List, NamedTuple, Optional, Sequence

from m2wr_sim.control_messages import (
    FollowJointTrajectoryActionFeedback,
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryActionResult,
    JointTrajectory,
    JointTrajectoryControllerState,
    QueryTrajectoryState,
    QueryTrajectoryStateResponse,
)
from m2wr_sim.errors import PluginError
from m2wr_sim.ros_control.action_server import ABORTED, PREEMPTED, SUCCEEDED, ActionServer
from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode, Due, read_joints
from m2wr_sim.ros_control.hardware import EFFORT, POSITION, VELOCITY, RobotHardware
from m2wr_sim.ros_control.pid import Pid, read_gains
from m2wr_sim.ros_control.trajectory import State, Trajectory, TrajectoryError, follow, hold, stop

_INVALID_GOAL, _INVALID_JOINTS, _PATH_TOLERANCE, _GOAL_TOLERANCE = -1, -2, -4, -5      # of FollowJointTrajectoryResult


class _Tolerance(NamedTuple):
    """Greatest errors of one joint; 0: not checked."""

    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0

    def changed(self, message: Any) -> _Tolerance:
        """Return it with the values of a control_msgs/JointTolerance: 0 keeps a value, a negative one removes it."""
        new = message.position, message.velocity, message.acceleration
        return _Tolerance(*(old if value == 0.0 else max(0.0, value) for old, value in zip(self, new)))


class _Task(NamedTuple):
    """What is checked while the goal of an action is followed."""

    path: Sequence[_Tolerance]
    goal: Sequence[_Tolerance]
    patience: float         # s after the end of the trajectory


class JointTrajectoryController(Controller):
    """Moves joints along trajectories from the topic ``command`` or the action ``follow_joint_trajectory``."""

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        self._node, self._running = node, False
        self._names = node.names("joints")
        self.joints = list(read_joints(node, hardware, self.interface, self._names))
        self._partial = node.flag("allow_partial_joints_goal", False)
        self._stop_duration = node.number("stop_trajectory_duration", 0.0, least=0.0)
        self._read_constraints(node)
        self._pids: List[Pid] = []
        self._forward: List[float] = []
        if self.interface != POSITION:
            for name in self._names:
                place = "gains/" + name
                if node.value(place) is None and self.interface == EFFORT:
                    raise PluginError("%s/%s: read nothing; expected gains with at least p" % (node.namespace, place))
                self._pids.append(Pid(read_gains(node.value(place, {"p": 0.0}), "%s/%s" % (node.namespace, place))))
                self._forward.append(node.number("velocity_ff/" + name, 0.0))
        self._states = _rate(node, "state_publish_rate", 50.0)
        self._monitor = _rate(node, "action_monitor_rate", 20.0)
        self._message = JointTrajectoryControllerState(joint_names=list(self._names))
        self._port = node.advertise("state", JointTrajectoryControllerState, 1)
        self._trajectory, self._task = hold([0.0] * len(self.joints), 0.0), None  # type: Trajectory, Optional[_Task]
        node.subscribe("command", JointTrajectory, self._command)
        node.serve("query_state", QueryTrajectoryState, self._query)
        self._action = ActionServer(node, "follow_joint_trajectory", (
            FollowJointTrajectoryActionGoal, FollowJointTrajectoryActionFeedback, FollowJointTrajectoryActionResult),
            self._accept, self._halt)

    def _read_constraints(self, node: ControllerNode) -> None:
        stopped = node.number("constraints/stopped_velocity_tolerance", 0.01, least=0.0)
        self._patience = node.number("constraints/goal_time", 0.0, least=0.0)
        self._path, self._goal = (
            [_Tolerance(node.number("constraints/%s/%s" % (name, word), 0.0), velocity) for name in self._names]
            for word, velocity in (("trajectory", 0.0), ("goal", stopped)))

    # ---- goals --------------------------------------------------------------------------------------------------

    def _now(self) -> float:
        return self._node.now_ns * 1e-9

    def _follow(self, message: Any) -> None:
        """Begin to follow a trajectory; TrajectoryError if it cannot be followed."""
        self._trajectory, remark = follow(message, self._names, [joint.continuous for joint in self.joints],
                                          self._now(), self._trajectory, self._partial)
        if remark:
            self._node.log.warning("%s: %s", self._node.namespace, remark)

    def _command(self, message: Any) -> None:
        if not self._running:
            self._node.log.error("%s: Can't accept new commands. Controller is not running.", self._node.namespace)
            return
        try:
            if message.points:
                self._follow(message)
            else:
                self._halt()                # an empty trajectory: hold
        except TrajectoryError as error:
            self._node.log.error("%s: rejected a trajectory: %s", self._node.namespace, error)
            return
        self._action.end(PREEMPTED, _result(0, ""), "replaced by a trajectory on the topic command")
        self._task = None

    def _accept(self, goal: Any) -> Any:
        """Begin to follow the goal of an action; return None, or the result and its text if it is rejected."""
        if not self._running:
            return self._rejection(_INVALID_GOAL, "Can't accept new action goals. Controller is not running.")
        try:
            self._follow(goal.trajectory)
        except TrajectoryError as error:
            joints = "controller joints" in str(error)
            return self._rejection(_INVALID_JOINTS if joints else _INVALID_GOAL, str(error))
        patience = goal.goal_time_tolerance.secs + 1e-9 * goal.goal_time_tolerance.nsecs
        self._task = _Task(self._changed(self._path, goal.path_tolerance), self._changed(
            self._goal, goal.goal_tolerance), self._patience if patience == 0.0 else max(0.0, patience))
        return None

    def _changed(self, tolerances: Sequence[_Tolerance], messages: Sequence[Any]) -> List[_Tolerance]:
        by_name: Dict[str, Any] = {message.name: message for message in messages}
        return [tolerance.changed(by_name[name]) if name in by_name else tolerance
                for name, tolerance in zip(self._names, tolerances)]

    def _rejection(self, code: int, text: str) -> Any:
        self._node.log.error("%s: rejected a goal: %s", self._node.namespace, text)
        return _result(code, text), text

    def _halt(self) -> None:
        """Come to rest where the trajectory is now."""
        now = self._now()
        self._trajectory = stop(self._trajectory.sample(now), now, self._stop_duration)
        self._task = None

    # ---- control ------------------------------------------------------------------------------------------------

    def starting(self, now_ns: int) -> None:
        self._running, self._task = True, None
        self._trajectory = hold([joint.position for joint in self.joints], now_ns * 1e-9)
        for pid in self._pids:
            pid.reset()
        for due in (self._states, self._monitor):
            if due is not None:
                due.restart(now_ns)

    def update(self, now_ns: int, dt: float) -> None:
        now = now_ns * 1e-9
        self._trajectory.forget(now)
        desired = self._trajectory.sample(now)
        errors = [joint.position_error(position) for joint, position in zip(self.joints, desired.positions)]
        rates = [rate - joint.velocity for joint, rate in zip(self.joints, desired.velocities)]
        if self.interface == POSITION:
            for joint, position in zip(self.joints, desired.positions):
                joint.command = position
        else:
            for joint, pid, forward, rate, error, error_rate in zip(
                    self.joints, self._pids, self._forward, desired.velocities, errors, rates):
                joint.command = forward * rate + pid.update(error, dt, error_rate)
        if self._task is not None:
            self._check(self._task, now, errors, rates)
        self._action.spin(now_ns)
        self._publish(now_ns, desired, errors, rates)

    def _check(self, task: _Task, now: float, errors: Sequence[float], rates: Sequence[float]) -> None:
        """End the goal if it is reached, or a tolerance is violated; the joints still move to its end."""
        over = now >= self._trajectory.end
        violated = _violated("goal" if over else "path", task.goal if over else task.path, self._names, errors, rates)
        if not over and violated:
            self._end(ABORTED, _PATH_TOLERANCE, violated)
        elif over and not violated:
            self._end(SUCCEEDED, 0, "")
        elif over and now > self._trajectory.end + task.patience:
            self._end(ABORTED, _GOAL_TOLERANCE, violated)

    def _end(self, status: int, code: int, text: str) -> None:
        self._task = None
        if text:
            self._node.log.warning("%s: goal aborted: %s", self._node.namespace, text)
        self._action.end(status, _result(code, text), text)

    def _publish(self, now_ns: int, desired: State, errors: Sequence[float], rates: Sequence[float]) -> None:
        state = self._states is not None and self._states.due(now_ns) and self._port.wanted()
        monitor = self._monitor is not None and self._monitor.due(now_ns) and self._action.active
        if not (state or monitor):
            return
        message = self._message
        message.header.stamp = self._node.moment(now_ns)
        message.desired.positions, message.desired.velocities, message.desired.accelerations = map(list, desired)
        message.actual.positions = [joint.position for joint in self.joints]
        message.actual.velocities = [joint.velocity for joint in self.joints]
        message.error.positions, message.error.velocities = list(errors), list(rates)
        if state:
            self._port.publish(message)
        if monitor:
            feedback = FollowJointTrajectoryActionFeedback().feedback
            feedback.header, feedback.joint_names = message.header, message.joint_names
            feedback.desired, feedback.actual, feedback.error = message.desired, message.actual, message.error
            self._action.feed_back(feedback)

    def _query(self, request: Any) -> Any:
        """Answer the service ``query_state``."""
        state = self._trajectory.sample(request.time.secs + 1e-9 * request.time.nsecs)
        return QueryTrajectoryStateResponse(name=list(self._names), position=list(state.positions),
                                            velocity=list(state.velocities), acceleration=list(state.accelerations))

    def stopping(self, now_ns: int) -> None:
        self._running = False
        self._action.end(PREEMPTED, _result(0, ""), "the controller was stopped")
        self._task = None
        if self.interface != POSITION:
            for joint in self.joints:
                joint.command = 0.0


def _rate(node: ControllerNode, name: str, default: float) -> Optional[Due]:
    """Return the schedule of a rate, or None for a rate of 0."""
    rate = node.number(name, default, least=0.0)
    return Due(rate) if rate > 0.0 else None


def _result(code: int, text: str) -> Any:
    result = FollowJointTrajectoryActionResult().result
    result.error_code, result.error_string = code, text
    return result


def _violated(word: str, tolerances: Sequence[_Tolerance], names: Sequence[str], errors: Sequence[float],
              rates: Sequence[float]) -> str:
    """Return a text about the first joint with too large an error, or an empty text; ``word`` is path or goal."""
    for tolerance, name, error, rate in zip(tolerances, names, errors, rates):
        if tolerance.position > 0.0 and not abs(error) <= tolerance.position:
            return "%s %s error %f; expected at most %g" % (name, word, error, tolerance.position)
        if tolerance.velocity > 0.0 and not abs(rate) <= tolerance.velocity:
            return "%s velocity error %f; expected at most %g" % (name, rate, tolerance.velocity)
    return ""


class PositionTrajectory(JointTrajectoryController):
    """position_controllers/JointTrajectoryController."""

    interface = POSITION


class VelocityTrajectory(JointTrajectoryController):
    """velocity_controllers/JointTrajectoryController."""

    interface = VELOCITY


class EffortTrajectory(JointTrajectoryController):
    """effort_controllers/JointTrajectoryController."""

    interface = EFFORT
