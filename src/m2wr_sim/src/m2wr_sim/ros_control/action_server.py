# SPDX-License-Identifier: BSD-3-Clause
"""An action server for one goal at a time, whose callbacks run between two steps of the simulation."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Dict, Optional

from m2wr_sim.control_messages import GoalID, GoalStatus, GoalStatusArray

if TYPE_CHECKING:
    from m2wr_sim.ros_control.controllers.base import ControllerNode

PENDING, ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, REJECTED = 0, 1, 2, 3, 4, 5     # of actionlib_msgs/GoalStatus

_STATUS_PERIOD_NS = 200000000       # 5 Hz, as actionlib
_KEPT_NS = 5000000000               # a finished goal stays in the list for 5 s, as in actionlib
_QUEUE = 50                         # goals and cancels between two steps


class ActionServer:
    """The topics of an action.

    Parameters
    ----------
    node : ControllerNode
    name : str
        Of the action, below the namespace of the controller.
    classes : tuple
        Message classes of the action's goal, feedback and result.
    accept : callable
        ``accept(goal)`` begins to follow a goal; returns None, or the result and a text if it is rejected.
    cancelled : callable
        Called when the active goal is cancelled by a client.
    """

    def __init__(self, node: ControllerNode, name: str, classes: Any, accept: Callable[[Any], Any],
                 cancelled: Callable[[], None]) -> None:
        goal, feedback, self._result_class = classes
        self._node, self._accept, self._cancelled = node, accept, cancelled
        self._feedback = node.advertise(name + "/feedback", feedback)
        self._feedback_class = feedback
        self._results = node.advertise(name + "/result", self._result_class)
        self._statuses = node.advertise(name + "/status", GoalStatusArray)
        self._known: Dict[str, Any] = {}            # status by the id of the goal
        self._ended_ns: Dict[str, int] = {}
        self._active: Optional[str] = None
        self._published_ns, self._numbered = 0, 0
        node.subscribe(name + "/goal", goal, self._receive, _QUEUE)
        node.subscribe(name + "/cancel", GoalID, self._cancel, _QUEUE)

    @property
    def active(self) -> bool:
        """Whether a goal is being followed."""
        return self._active is not None

    def _receive(self, message: Any) -> None:
        goal_id = message.goal_id
        if not goal_id.id:
            self._numbered += 1
            goal_id.id = "%s-%d" % (self._node.namespace, self._numbered)
        if goal_id.id in self._known:
            return                                  # a repeated message, or cancelled before it came
        status = GoalStatus(goal_id=goal_id, status=PENDING, text="")
        before = self._active
        rejected = self._accept(message.goal)
        self._known[goal_id.id] = status
        if rejected is not None:
            self._end(goal_id.id, REJECTED, *rejected)
            return
        if before is not None:
            self._end(before, PREEMPTED, self._result_class().result, "replaced by a newer goal")
        self._active, status.status = goal_id.id, ACTIVE
        self.publish_status(self._node.now_ns)

    def _cancel(self, message: Any) -> None:
        """Cancel one goal, those up to a time, or all: as actionlib understands a GoalID."""
        stamp = message.stamp.secs, message.stamp.nsecs
        if self._active is None:
            return
        goal_id = self._known[self._active].goal_id
        everything = not message.id and stamp == (0, 0)
        older = stamp != (0, 0) and (goal_id.stamp.secs, goal_id.stamp.nsecs) <= stamp
        if everything or older or message.id == self._active:
            self._cancelled()
            self.end(PREEMPTED, self._result_class().result, "cancelled")

    def end(self, status: int, result: Any, text: str = "") -> None:
        """End the active goal.

        Parameters
        ----------
        status : int
            PREEMPTED, SUCCEEDED or ABORTED.
        result : object
            Result of the action.
        text : str
        """
        if self._active is not None:
            ended, self._active = self._active, None
            self._end(ended, status, result, text)

    def _end(self, goal: str, code: int, result: Any, text: str) -> None:
        status, now_ns = self._known[goal], self._node.now_ns
        status.status, status.text = code, text
        self._ended_ns[goal] = now_ns
        message = self._result_class(status=status, result=result)
        message.header.stamp = self._node.moment(now_ns)
        self._results.publish(message)
        self.publish_status(now_ns)

    def feed_back(self, feedback: Any) -> None:
        """Publish feedback about the active goal."""
        if self._active is None or not self._feedback.wanted():
            return
        message = self._feedback_class(status=self._known[self._active], feedback=feedback)
        message.header.stamp = self._node.moment(self._node.now_ns)
        self._feedback.publish(message)

    def spin(self, now_ns: int) -> None:
        """Publish the list of goals at its rate; call it in each control cycle."""
        if not 0 <= now_ns - self._published_ns < _STATUS_PERIOD_NS:
            self.publish_status(now_ns)

    def publish_status(self, now_ns: int) -> None:
        """Publish the list of goals now."""
        self._published_ns = now_ns
        for goal in [goal for goal, ended_ns in self._ended_ns.items() if not 0 <= now_ns - ended_ns < _KEPT_NS]:
            del self._ended_ns[goal], self._known[goal]
        if self._statuses.wanted():
            message = GoalStatusArray(status_list=list(self._known.values()))
            message.header.stamp = self._node.moment(now_ns)
            self._statuses.publish(message)
