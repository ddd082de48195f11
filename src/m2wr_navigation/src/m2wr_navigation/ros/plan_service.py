# SPDX-License-Identifier: BSD-3-Clause
"""The service ``make_plan``: a plan on a copy of the costmap, at any time, without side effects."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, Protocol

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.srv import GetPlan, GetPlanResponse
from std_msgs.msg import Header

from m2wr_maps.ros.message_conversion import pose_message
from m2wr_navigation.ros.poses import GoalError, goal_pose
from m2wr_navigation.ros.transforms import TransformError

if TYPE_CHECKING:
    from m2wr_navigation.ros.costmap_server import CostmapServer
    from m2wr_navigation.ros.planner_server import PlannerServer
    from m2wr_navigation.ros.transforms import Transforms

WIDEST = 100.0              # m: greatest tolerance of a request


class PlanningNode(Protocol):
    """A node with a global costmap and a planner.

    Attributes
    ----------
    maps : dict of str to CostmapServer
        One of them is ``global``.
    planner : PlannerServer
    transforms : Transforms
    """

    maps: Dict[str, CostmapServer]
    planner: PlannerServer
    transforms: Transforms

    @property
    def adds_goal(self) -> bool:
        """Whether a goal that cannot be reached is appended to the plan to a place near it."""


class PlanService:
    """Answers requests of ``~make_plan`` and of ``~PLANNER/make_plan``.

    Parameters
    ----------
    node : PlanningNode
    """

    kind = GetPlan

    def __init__(self, node: PlanningNode) -> None:
        self._node = node

    def answer(self, request: Any) -> GetPlanResponse:
        """Return a plan; an empty one if there is none, with the reason in the log."""
        whole = self._node.maps["global"]
        response = GetPlanResponse()
        response.plan.header = Header(stamp=rospy.Time.now(), frame_id=whole.frame)
        try:
            goal = goal_pose(request.goal, whole.frame, self._node.transforms)
            start = goal_pose(request.start, whole.frame, self._node.transforms) if request.start.header.frame_id \
                else whole.pose()
        except (GoalError, TransformError) as error:
            rospy.logwarn("make_plan: %s", error)
            return response
        tolerance = request.tolerance if 0.0 <= request.tolerance <= WIDEST else 0.0
        plan = self._node.planner.plan(whole.snapshot(), start, goal, tolerance)
        if plan.reason:
            rospy.logwarn("make_plan: %s", plan.reason)
            return response
        poses = plan.poses
        if self._node.adds_goal and np.hypot(*(poses[-1, :2] - goal[:2])) > 1e-6:
            poses = np.concatenate([poses, goal[None]])
        response.plan.poses = [PoseStamped(response.plan.header, pose_message(pose)) for pose in poses]
        return response
