# SPDX-License-Identifier: BSD-3-Clause
"""Goals for the action ``move_base``, and what came of the last one."""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, Tuple

import actionlib
import rospy
from actionlib import CommState
from actionlib_msgs.msg import GoalStatus
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal

from m2wr_maps.ros.message_conversion import pose_message

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

RESULTS = {GoalStatus.SUCCEEDED: "succeeded", GoalStatus.ABORTED: "aborted", GoalStatus.REJECTED: "aborted",
           GoalStatus.PREEMPTED: "preempted", GoalStatus.RECALLED: "preempted", GoalStatus.LOST: "aborted"}
LOOK = 0.01                 # s in which a server that is there is found


class Goals:
    """Sends goals to one robot.

    Parameters
    ----------
    action : str
        Name of the action.
    """

    def __init__(self, action: str = "move_base") -> None:
        self.action = action
        # not the simple client: it reports an error whenever a goal replaces another one
        self._client = actionlib.ActionClient(action, MoveBaseAction)
        self._handle: Any = None
        self._lock = threading.Lock()
        self._result: Tuple[str, str] = ("", "")
        self._sent = 0

    def is_there(self) -> bool:
        """Return whether the action has a server."""
        return bool(self._client.wait_for_server(rospy.Duration(LOOK)))

    def send(self, pose: FloatArray, frame: str) -> None:
        """Send a goal; it replaces the last one.

        Parameters
        ----------
        pose : (3,) float64
            [m, m, rad]
        frame : str
        """
        goal = MoveBaseGoal()
        goal.target_pose.header.frame_id = frame
        goal.target_pose.header.stamp = rospy.Time.now()
        goal.target_pose.pose = pose_message(pose)
        self._sent += 1
        number = self._sent

        def changed(handle: Any) -> None:
            with self._lock:
                if number == self._sent and handle.get_comm_state() == CommState.DONE:
                    self._result = (RESULTS.get(handle.get_terminal_state(), "aborted"), handle.get_goal_status_text())

        self._handle = self._client.send_goal(goal, changed)

    def take(self) -> Tuple[str, str]:
        """Return the result of the last goal and why, once; two empty texts: there is none."""
        with self._lock:
            result, self._result = self._result, ("", "")
        return result

    def cancel(self) -> None:
        """Cancel the last goal; what comes of it does not count."""
        self._sent += 1
        if self._handle is not None:
            self._handle.cancel()

    def cancel_all(self, result: str = "") -> None:
        """Cancel all goals of the action, also those of others.

        Parameters
        ----------
        result : str
            What counts as the result of the last one.
        """
        with self._lock:
            self._client.cancel_all_goals()
            self._result = (result, "")

    def stop(self) -> None:
        """Cancel all goals if any was sent, at the end of the node."""
        if self._sent:
            self._client.cancel_all_goals()
