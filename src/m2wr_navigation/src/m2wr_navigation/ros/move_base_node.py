# SPDX-License-Identifier: BSD-3-Clause
"""``move_base``: goals in, velocity commands out."""
from __future__ import annotations

import math
import sys
import threading
import time
from typing import TYPE_CHECKING, Any, Dict, List, Optional

import actionlib
import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import (
    MoveBaseAction,
    MoveBaseActionGoal,
    MoveBaseFeedback,
    MoveBaseResult,
    RecoveryStatus,
)
from nav_msgs.msg import Odometry
from std_srvs.srv import Empty, EmptyResponse

from m2wr_maps.se2 import compose, inverse
from m2wr_navigation import registry
from m2wr_navigation.base_velocity import BaseVelocity
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.kernel_warm_up import (
    compile_controller_kernels,
    compile_costmap_kernels,
    compile_planner_kernels,
)
from m2wr_navigation.overruns import OverrunMonitor
from m2wr_navigation.parameters import read, unknown
from m2wr_navigation.planners.planner import Plan
from m2wr_navigation.ros.controller_server import ControllerServer
from m2wr_navigation.ros.costmap_server import CostmapError, CostmapServer, wait_until_ready
from m2wr_navigation.ros.plan_service import PlanService
from m2wr_navigation.ros.planner_server import PlannerServer
from m2wr_navigation.ros.planner_thread import PlannerThread
from m2wr_navigation.ros.poses import GoalError, goal_pose, pose_message
from m2wr_navigation.ros.reconfigure import serve
from m2wr_navigation.ros.recovery_setup import BothCostmaps, make_recoveries
from m2wr_navigation.ros.transforms import TransformError, Transforms
from m2wr_navigation.supervisor import ABORTED, PARAMETERS, Supervisor
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node

if TYPE_CHECKING:
    from m2wr_navigation.supervisor import Outcome
    from m2wr_node.array_types import FloatArray

LOOK = 0.02                 # s of wall time between two looks at the clock
BESIDE = {"global_costmap", "local_costmap", "recovery_behaviors", "clearing_radius", "latch_xy_goal_tolerance",
          "footprint", "footprint_padding", "restore_defaults", "groups"}
KILLED = "Aborting on the goal because the node has been killed"
BAD_QUATERNION = "Aborting on goal because it was sent with an invalid quaternion"


class MoveBase:
    """The node. A control thread follows goals, one thread plans, and each costmap has one for its updates."""

    def __init__(self) -> None:
        given = rospy.get_param("~", {})
        given = given if isinstance(given, dict) else {}
        self._values, warnings = read(PARAMETERS, given, "~")
        known = set(PARAMETERS) | BESIDE | {name for name, value in given.items() if isinstance(value, dict)}
        for sentence in warnings + unknown(given, known, "~"):
            rospy.logwarn("%s", sentence.replace("~/", "~"))
        if self._values["shutdown_costmaps"]:
            rospy.logwarn("parameter ~shutdown_costmaps has no effect: the costmaps are always updated")
        self._velocity, self._moving = BaseVelocity(), False
        self._told = ""                 # why the velocity is that of tf
        self._end = threading.Event()
        self._sending = threading.Lock()    # of commands: none follows the stop at the end
        self.transforms = Transforms()
        self.maps: Dict[str, CostmapServer] = {
            which: CostmapServer(which + "_costmap", self.transforms) for which in ("global", "local")}
        self._commands = rospy.Publisher("cmd_vel", Twist, queue_size=1)
        self._current = rospy.Publisher("~current_goal", PoseStamped, queue_size=1)
        self._recovery = rospy.Publisher("move_base/recovery_status", RecoveryStatus, queue_size=1)
        self._again = rospy.Publisher("move_base/goal", MoveBaseActionGoal, queue_size=1)
        self._service = PlanService(self)
        self.planner = PlannerServer(self._values["base_global_planner"], self._service.answer)
        self._controller = ControllerServer(self._values["base_local_planner"], self._values["controller_frequency"])
        circumscribed = self.maps["local"].costmap.circumscribed
        self._supervisor = Supervisor(self._values, self._controller.controller, make_recoveries(
            self._values, circumscribed, BothCostmaps(self.maps)))
        self._note_drive()
        self._planning = PlannerThread(self._plan)
        self._goal: Optional[FloatArray] = None         # in the frame of the global costmap
        self._plan_in_use: Optional[FloatArray] = None
        odom = rospy.get_param("~%s/odom_topic" % self._controller.name, "odom")
        self._odom = rospy.Subscriber(odom, Odometry, self._on_odometry, queue_size=1, tcp_nodelay=True)
        self._keep: List[Any] = [self._odom]

    # ---- start

    def start(self) -> None:
        """Wait for transforms and maps, then offer services and the action."""
        compile_controller_kernels()
        compile_costmap_kernels()
        compile_planner_kernels(type(self.planner.planner))
        for server in self.maps.values():
            server.start()
        if not wait_until_ready(list(self.maps.values()), "move_base"):
            return
        self.planner.offer()
        self._keep += [rospy.Service("~make_plan", self._service.kind, self._service.answer),
                       rospy.Service("~clear_costmaps", Empty, self._clear_costmaps),
                       serve("~", PARAMETERS, self._values, self._reconfigure)]
        self._server = actionlib.SimpleActionServer("move_base", MoveBaseAction, self._execute, False)
        self._server.start()
        self._keep.append(rospy.Subscriber("move_base_simple/goal", PoseStamped, self._on_simple_goal, queue_size=1))
        at_shutdown(self.close)
        rospy.loginfo("move_base is ready: planner %s, controller %s", self._values["base_global_planner"],
                      self._values["base_local_planner"])

    @property
    def adds_goal(self) -> bool:
        """Whether make_plan appends a goal that cannot be reached to the plan to a place near it."""
        return bool(self._values["make_plan_add_unreachable_goal"])

    # ---- inputs

    def _on_odometry(self, message: Odometry) -> None:
        twist = message.twist.twist
        velocity = np.array([twist.linear.x, twist.linear.y, twist.angular.z])
        if np.isfinite(velocity).all():
            self._velocity.take_message(rospy.get_time(), velocity)
        else:
            rospy.logwarn_throttle(10.0, "a message of odometry has the velocity {}; expected finite numbers".format(
                velocity.tolist()))

    def _on_simple_goal(self, message: PoseStamped) -> None:
        goal = MoveBaseActionGoal()
        goal.header.stamp = rospy.Time.now()
        goal.goal.target_pose = message
        self._again.publish(goal)

    def _clear_costmaps(self, _: Any) -> EmptyResponse:
        for server in self.maps.values():
            server.costmap.reset()
        return EmptyResponse()

    def _reconfigure(self, values: Dict[str, Any]) -> None:
        before = self._values
        try:
            if values["base_global_planner"] != before["base_global_planner"]:
                registry.find(registry.PLANNERS, values["base_global_planner"])
                self.planner.close()
                self.planner = PlannerServer(values["base_global_planner"], self._service.answer)
                self.planner.offer()
            if values["base_local_planner"] != before["base_local_planner"]:
                registry.find(registry.CONTROLLERS, values["base_local_planner"])
                self._controller.close()
                self._controller = ControllerServer(values["base_local_planner"], values["controller_frequency"])
                self._supervisor.controller = self._controller.controller
        except registry.UnknownPluginError as error:
            rospy.logwarn("the planner or controller is not changed: %s", error)
            values = dict(values, base_global_planner=before["base_global_planner"],
                          base_local_planner=before["base_local_planner"])
        self._values = self._supervisor.values = values

    # ---- one goal

    def _execute(self, goal: Any) -> None:
        """Run a goal on the action server's thread; if anything fails, the robot stops and the goal is aborted."""
        try:
            self._follow(goal)
        except Exception:
            self._finish()
            raise

    def _follow(self, goal: Any) -> None:
        """Follow a goal, and those that replace it, until one ends."""
        if not self._begin(goal.target_pose):
            return
        last, monitor = -math.inf, OverrunMonitor()
        while not self._end.is_set() and not rospy.is_shutdown():
            if self._server.is_preempt_requested():
                if not self._server.is_new_goal_available():
                    self._finish()
                    self._server.set_preempted()
                    return
                if not self._begin(self._server.accept_new_goal().target_pose, replaces=True):
                    return
            period, now = 1.0 / self._values["controller_frequency"], rospy.get_time()
            if 0.0 <= now - last < period:
                time.sleep(min(LOOK, max(0.0005, period - (now - last))))
                continue
            last, began = now, time.thread_time()
            outcome = self._cycle(now)
            spent = rospy.get_time() - now
            if monitor.is_due(now, spent, period):
                rospy.logwarn("a control cycle took %.3f s (%.0f ms of CPU, controller %s); expected at most %.3f s "
                              "(controller_frequency %.3g Hz)", spent, 1e3 * (time.thread_time() - began),
                              self._controller.name, period, 1.0 / period)
            if outcome.result:
                self._finish()
                rospy.loginfo("%s %s", outcome.text, " ".join(outcome.messages))
                end = self._server.set_aborted if outcome.result == ABORTED else self._server.set_succeeded
                end(MoveBaseResult(), outcome.text)
                return
        self._finish()
        self._server.set_aborted(MoveBaseResult(), KILLED)

    def _begin(self, target: PoseStamped, replaces: bool = False) -> bool:
        """Start a goal, instead of another one if it replaces that; returns False if it cannot be used."""
        try:
            self._goal = goal_pose(target, self.maps["global"].frame, self.transforms)
        except GoalError as error:
            rospy.logerr("%s", error)
            self._finish()
            self._server.set_aborted(MoveBaseResult(), BAD_QUATERNION if error.quaternion else str(error))
            return False
        now = rospy.get_time()
        number, self._plan_in_use = self._supervisor.begin(now, replaces), None
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = self.maps["global"].frame, rospy.Time.now()
        message.pose = pose_message(self._goal)
        self._current.publish(message)
        self._planning.ask(number)
        return True

    def _finish(self) -> None:
        """Stop the robot and the planner."""
        self._planning.stop()
        self._send(np.zeros(3))
        self._controller.clear(self.maps["local"].frame)

    def _send(self, velocity: FloatArray) -> None:
        message = Twist()
        with self._sending:
            if not self._end.is_set():      # else it is the last command, a stop
                message.linear.x, message.linear.y, message.angular.z = (float(value) for value in velocity)
            self._moving = bool(np.any(velocity))
            self._commands.publish(message)

    def _cycle(self, now: float) -> Outcome:
        for number, plan in self._planning.answers():
            self._tell(self._supervisor.take_plan(number, plan, now))
            if len(plan.poses) and number == self._supervisor.number:
                self._plan_in_use = plan.poses
        situation, missing = self._situation(now)
        outcome = self._supervisor.cycle(now, situation, self.maps["local"].late(), missing)
        rate = self._values["planner_frequency"]
        self._planning.keep(self._supervisor.number, self._supervisor.wants_plan, rate, now)
        self._tell(list(outcome.messages) if not outcome.result else [])
        if outcome.began is not None:
            self._announce(outcome)
        if outcome.command is not None:
            self._controller.show(outcome.command, self.maps["local"].frame)
        if outcome.velocity is not None:
            self._send(outcome.velocity)
        return outcome

    @staticmethod
    def _tell(messages: List[str]) -> None:
        for message in messages:
            rospy.logwarn("%s", message)

    def _announce(self, outcome: Outcome) -> None:
        assert outcome.began is not None
        behaviour, number = outcome.began
        rospy.logwarn("recovery behaviour %s begins", behaviour.name)
        message = RecoveryStatus(current_recovery_number=number, total_number_of_recoveries=len(
            self._supervisor.recoveries), recovery_behavior_name=behaviour.name)
        message.pose_stamped.header.frame_id = self.maps["global"].frame
        message.pose_stamped.header.stamp = rospy.Time.now()
        try:
            message.pose_stamped.pose = pose_message(self.maps["global"].pose())
        except TransformError as error:
            rospy.logwarn("%s", error)
        self._recovery.publish(message)

    def _situation(self, now: float) -> Any:
        """Return the Situation, or None and why there is none; sends the feedback."""
        local, whole = self.maps["local"], self.maps["global"]
        try:
            pose = local.pose()
            velocity = self._measured_velocity(now)
            local_from_global = self.transforms.pose(local.frame, whole.frame) if local.frame != whole.frame \
                else np.zeros(3)
        except TransformError as error:
            return None, str(error)
        if local.fault:
            return None, "the local costmap is not updated: " + local.fault
        feedback = MoveBaseFeedback()
        feedback.base_position.header.frame_id = whole.frame
        feedback.base_position.header.stamp = rospy.Time.now()
        feedback.base_position.pose = pose_message(compose(inverse(local_from_global), pose))
        self._server.publish_feedback(feedback)
        plan = pose[None, :] if self._plan_in_use is None else compose(local_from_global, self._plan_in_use)
        return Situation(now, 1.0 / self._values["controller_frequency"], pose, velocity, plan,
                         local.snapshot(), local.costmap.footprint), ""

    def _measured_velocity(self, now: float) -> FloatArray:
        """Return the velocity of the base (3,), and say once why it is that of tf; raises TransformError."""
        pose, stamp = self.maps["local"].stamped_pose()
        self._velocity.take_pose(stamp, pose)
        velocity = self._velocity.velocity(now)
        why = self._velocity.by_poses
        if why and why != self._told:
            self._told = why
            rospy.logwarn("topic %s %s: the velocity of the base is taken from the transforms from %s to %s",
                          self._odom.resolved_name, why, self.maps["local"].base, self.maps["local"].frame)
        return velocity

    def _plan(self) -> Plan:
        """Return a plan to the present goal. Runs on the planner's thread."""
        whole = self.maps["global"]
        try:
            start = whole.pose()
        except TransformError as error:
            return Plan.none("the pose of the robot is not known: " + str(error))
        assert self._goal is not None
        self._note_drive()
        return self.planner.plan(whole.snapshot(), start, self._goal)

    def _note_drive(self) -> None:
        """Tell the global costmap whether the controller drives to the side; its parameters may have changed."""
        self.maps["global"].costmap.drives_sideways = self._supervisor.controller.drives_sideways

    def close(self) -> None:
        """Stop the robot at shutdown."""
        self._end.set()
        self._planning.close()
        if self._moving:
            self._send(np.zeros(3))


def main() -> int:
    """Run the node; return its exit code."""
    start_node("move_base")
    try:
        node = MoveBase()
    except (CostmapError, registry.UnknownPluginError) as error:
        rospy.logfatal("move_base cannot start: %s", error)
        return 1
    node.start()
    rospy.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
