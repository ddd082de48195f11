# SPDX-License-Identifier: BSD-3-Clause
"""The node ``tf2_web_republisher``."""
from __future__ import annotations

import math
import threading
import time
from typing import Any, Callable, List, Optional, Set

import actionlib
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from tf2_web_republisher.msg import TFArray, TFSubscriptionAction, TFSubscriptionFeedback
from tf2_web_republisher.srv import RepublishTFs, RepublishTFsResponse

from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.ros.transform_buffer import TransformBuffer
from web_transforms.subscription import Pose, Subscription

MOST = 200                  # subscriptions at the same time; the oldest ends for a new one
LONGEST_TIMEOUT = 3600.0    # s without a subscriber after which a topic ends in any case
_LOOK = 0.5                 # s after which the node looks again if it has nothing to do


class Task:
    """One subscription and where its transforms are sent.

    Parameters
    ----------
    wanted : Subscription
    send : callable
        Takes a list of geometry_msgs/TransformStamped.
    listened : callable
        Returns whether what is sent is read.
    end : callable
        Ends it, with a text that says why.
    patience : float
        Time without a reader after which it ends [s].
    """

    def __init__(self, wanted: Subscription, send: Callable[[List[Any]], None], listened: Callable[[], bool],
                 end: Callable[[str], None], patience: float) -> None:
        self.wanted, self.send, self.listened, self.end, self.patience = wanted, send, listened, end, patience
        self.due = self.read = time.monotonic()


def subscription_of(asked: Any) -> Subscription:
    """Return what a goal or a request asks for.

    Parameters
    ----------
    asked : TFSubscriptionGoal or RepublishTFsRequest

    Raises
    ------
    ValueError
        If it cannot be done.
    """
    return Subscription(asked.source_frames, asked.target_frame, asked.angular_thres, asked.trans_thres, asked.rate)


class RepublisherNode:
    """Serves the action and the service until ROS ends."""

    def __init__(self) -> None:
        self._stopping = threading.Event()
        at_shutdown(self._stopping.set)
        self._buffer = TransformBuffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._tasks: List[Task] = []
        self._goals: List[Any] = []             # (identifier, Task)
        self._topics = 0
        self._unknown: Set[str] = set()
        self._lock = threading.Lock()
        self._server = actionlib.ActionServer(rospy.get_name(), TFSubscriptionAction, self._take_goal,
                                              self._cancel_goal, auto_start=False)
        self._service = rospy.Service("republish_tfs", RepublishTFs, self._take_request)
        self._server.start()

    # ---- what pages ask ----------------------------------------------------------------------------------------

    def _take_goal(self, goal: Any) -> None:
        try:
            wanted = subscription_of(goal.get_goal())
        except ValueError as error:
            rospy.logwarn("a goal is refused: %s", error)
            goal.set_rejected(text=str(error))
            return
        goal.set_accepted()

        def end(reason: str) -> None:
            goal.set_aborted(text=reason)

        task = Task(wanted, lambda transforms: goal.publish_feedback(TFSubscriptionFeedback(transforms)),
                    lambda: self._server.feedback_pub.get_num_connections() > 0, end, math.inf)
        self._add(task, goal.get_goal_id().id)

    def _cancel_goal(self, goal: Any) -> None:
        identifier = goal.get_goal_id().id
        with self._lock:
            found = [task for name, task in self._goals if name == identifier]
            self._forget(found)
        if found:
            goal.set_canceled()

    def _take_request(self, request: Any) -> Any:
        try:
            wanted = subscription_of(request)
        except ValueError as error:
            rospy.logwarn("a request is refused: %s", error)
            raise rospy.ServiceException(str(error)) from None
        with self._lock:
            name, self._topics = "~tf_repub_%d" % self._topics, self._topics + 1
        publisher = rospy.Publisher(name, TFArray, queue_size=10, latch=True)
        patience = min(max(0.0, request.timeout.to_sec()), LONGEST_TIMEOUT)
        self._add(Task(wanted, lambda transforms: publisher.publish(TFArray(transforms)),
                       lambda: publisher.get_num_connections() > 0, lambda _: publisher.unregister(), patience))
        return RepublishTFsResponse(publisher.resolved_name)

    def _add(self, task: Task, goal: Optional[str] = None) -> None:
        """Begin a subscription; ``goal``: the identifier of its goal."""
        with self._lock:
            oldest = self._tasks[:max(0, len(self._tasks) + 1 - MOST)]
            self._forget(oldest)
            self._tasks.append(task)
            if goal is not None:
                self._goals.append((goal, task))
        for old in oldest:
            rospy.logwarn("%d subscriptions: the oldest ends", MOST)
            old.end("%d newer subscriptions" % MOST)

    def _forget(self, tasks: List[Task]) -> None:
        self._tasks = [task for task in self._tasks if task not in tasks]
        self._goals = [(name, task) for name, task in self._goals if task not in tasks]

    # ---- what they get -----------------------------------------------------------------------------------------

    def _find(self, target: str, source: str) -> Optional[Pose]:
        """Return the newest transform between two frames; says once that there is none."""
        try:
            found = self._buffer.lookup_transform(target, source, rospy.Time(0)).transform
        except tf2_ros.TransformException as error:
            if source not in self._unknown and len(self._unknown) < MOST:
                self._unknown.add(source)
                rospy.logwarn("no transform from %s to %s yet: %s", source, target, error)
            return None
        self._unknown.discard(source)
        shift, turn = found.translation, found.rotation
        return Pose((shift.x, shift.y, shift.z), (turn.x, turn.y, turn.z, turn.w))

    def _work(self, task: Task, now: float) -> None:
        """Send what has changed; nothing is computed for a task that is not read."""
        task.due = max(task.due + task.wanted.period, now)
        if task.listened():
            task.read = now
            transforms = [_message(task.wanted.target, source, pose)
                          for source, pose in task.wanted.changed(self._find)]
            if transforms:
                task.send(transforms)
        elif now - task.read > task.patience:
            with self._lock:
                self._forget([task])
            task.end("not read for %g s" % task.patience)

    def run(self) -> None:
        """Send transforms until ROS ends."""
        while not self._stopping.is_set():
            with self._lock:
                tasks = list(self._tasks)
            now = time.monotonic()
            for task in tasks:
                if task.due <= now:
                    try:
                        self._work(task, now)
                    except rospy.ROSException as error:         # the topic was closed meanwhile
                        rospy.logdebug("subscription: %s", error)
            due = min([task.due for task in tasks], default=now + _LOOK)
            self._stopping.wait(min(_LOOK, max(0.001, due - time.monotonic())))


def _message(target: str, source: str, pose: Pose) -> Any:
    """Return a pose as geometry_msgs/TransformStamped, with the time of now."""
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = rospy.Time.now(), target, source
    shift, turn = message.transform.translation, message.transform.rotation
    shift.x, shift.y, shift.z = pose.position
    turn.x, turn.y, turn.z, turn.w = pose.quaternion
    return message


def main() -> int:
    """Entry point; returns the exit code."""
    start_node("tf2_web_republisher")
    RepublisherNode().run()
    return 0
