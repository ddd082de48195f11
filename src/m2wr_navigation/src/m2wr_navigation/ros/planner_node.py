# SPDX-License-Identifier: BSD-3-Clause
"""``navfn_node`` and ``planner``: a planner with a costmap of its own, and services that ask for plans."""
from __future__ import annotations

from typing import Any, Dict, Type

import rospy
from geometry_msgs.msg import PoseStamped

from m2wr_maps.ros.message_conversion import pose_message
from m2wr_navigation.kernel_warm_up import compile_costmap_kernels, compile_planner_kernels
from m2wr_navigation.planners.planner import Plan
from m2wr_navigation.ros.costmap_server import CostmapError, CostmapServer, wait_until_ready
from m2wr_navigation.ros.plan_service import PlanService
from m2wr_navigation.ros.planner_server import PlannerServer
from m2wr_navigation.ros.poses import GoalError, goal_pose
from m2wr_navigation.ros.transforms import TransformError, Transforms
from m2wr_node.ros.starting import start_node


class PlannerNode:
    """Plans from the robot to each goal of the topic ``~goal``, and for the service ``~make_plan``.

    Parameters
    ----------
    planner : str
        As in ``base_global_planner``.
    place : str
        Namespace of the planner below that of the node.
    service : type
        Of ``~make_plan``: navfn/MakeNavPlan.
    """

    adds_goal = False

    def __init__(self, planner: str, place: str, service: Type[Any]) -> None:
        self.transforms = Transforms()
        self.maps: Dict[str, CostmapServer] = {"global": CostmapServer("costmap", self.transforms)}
        self.planner = PlannerServer(planner, PlanService(self).answer, place)
        self._service = service

    def start(self) -> None:
        """Wait for transform and map, then take requests."""
        whole = self.maps["global"]
        whole.start()
        if not wait_until_ready([whole], rospy.get_name()):
            return
        self.planner.offer()
        rospy.Service("~make_plan", self._service, self._answer)
        rospy.Subscriber("~goal", PoseStamped, self._on_goal, queue_size=1)
        rospy.loginfo("ready, planner %s", self.planner.name)

    def _on_goal(self, message: PoseStamped) -> None:
        whole = self.maps["global"]
        try:
            plan = self._plan(whole.pose(), message)
        except (GoalError, TransformError) as error:
            rospy.logwarn("the goal on %s is not used: %s", rospy.resolve_name("~goal"), error)
            return
        if plan.reason:
            rospy.logwarn("no plan: %s", plan.reason)

    def _plan(self, start: Any, goal: PoseStamped) -> Plan:
        whole = self.maps["global"]
        return self.planner.plan(whole.snapshot(), start, goal_pose(goal, whole.frame, self.transforms))

    def _answer(self, request: Any) -> Any:
        """Answer a request; poses without a frame are in that of the costmap."""
        whole = self.maps["global"]
        for pose in (request.start, request.goal):
            pose.header.frame_id = pose.header.frame_id or whole.frame
        response = self._service._response_class()
        try:
            plan = self._plan(goal_pose(request.start, whole.frame, self.transforms), request.goal)
        except GoalError as error:
            plan = Plan.none(str(error))
        response.plan_found, response.error_message = bool(len(plan.poses)), plan.reason
        for pose in plan.poses:
            stamped = PoseStamped(pose=pose_message(pose))
            stamped.header.frame_id, stamped.header.stamp = whole.frame, rospy.Time.now()
            response.path.append(stamped)
        return response


def main(planner: str, place: str, service: Type[Any]) -> int:
    """Run the node; return its exit code.

    Parameters
    ----------
    planner, place, service
        As for :class:`PlannerNode`.

    Returns
    -------
    int
    """
    start_node("global_planner")
    try:
        node = PlannerNode(planner, place, service)
    except CostmapError as error:
        rospy.logfatal("the costmap cannot be made: %s", error)
        return 1
    compile_costmap_kernels()
    compile_planner_kernels(type(node.planner.planner))
    node.start()
    rospy.spin()
    return 0
