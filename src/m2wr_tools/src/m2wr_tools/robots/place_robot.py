# SPDX-License-Identifier: BSD-3-Clause
"""Places a robot at the pose of rviz's tool "2D Pose Estimate": at the same height, upright, at rest.

It also warns if the tool "2D Nav Goal" is used and no node drives to goals.
"""
from __future__ import annotations

import argparse
import math
import sys
from typing import Any, Callable, List, Optional, Sequence, Tuple

import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped

from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import GetModelState, SetModelState
from m2wr_node.ros.starting import start_node
from motion_plan.ros_poses import PoseError, planar_in

_TOPIC, _GOALS = "initialpose", "move_base_simple/goal"
_SERVICE_PATIENCE = 5.0     # s of wall time


def placed(model: str, pose: Sequence[float], height: float) -> ModelState:
    """Return the ModelState of a model, upright and at rest.

    Parameters
    ----------
    model : str
        Its name.
    pose : (3,) floats
        x, y [m] and yaw [rad] in world.
    height : float
        z in world [m].
    """
    state = ModelState(model_name=model, reference_frame="world")
    state.pose.position.x, state.pose.position.y, state.pose.position.z = pose[0], pose[1], height
    state.pose.orientation.z, state.pose.orientation.w = math.sin(pose[2] / 2.0), math.cos(pose[2] / 2.0)
    return state


class PlaceRobot:
    """The node.

    Parameters
    ----------
    model : str
        Name of the robot in the simulation.
    frame : str
        tf frame whose axes are those of the world.
    transform : callable
        As :func:`motion_plan.ros_poses.look_up`.
    """

    def __init__(self, model: str, frame: str, get_state: Callable[[str, str], Any],
                 set_state: Callable[[ModelState], Any],
                 **transform: Callable[[str, str], Tuple[float, float, float]]) -> None:
        self._model, self._frame, self._transform = model, frame, transform
        self._get_state, self._set_state = get_state, set_state

    def take(self, message: PoseWithCovarianceStamped) -> None:
        """Place the robot, and log the result."""
        try:
            pose = planar_in(self._frame, message.header.frame_id, message.pose.pose, **self._transform)
            now = self._get_state(self._model, "")
            if not now.success:
                raise PoseError(now.status_message)
            answer = self._set_state(placed(self._model, pose, now.pose.position.z))
            if not answer.success:
                raise PoseError(answer.status_message)
        except (PoseError, rospy.ServiceException, rospy.ROSException) as error:
            rospy.logwarn("place_robot: the pose from %s is refused: %s; model \"%s\" is not moved",
                          rospy.resolve_name(_TOPIC), error, self._model)
            return
        rospy.loginfo("place_robot: model \"%s\" is at (%.2f, %.2f), heading %.2f rad", self._model, *pose)


def others_at(topic: str, own: str, subscriptions: List[Any]) -> List[str]:
    """Return the nodes that subscribe to a topic, except one.

    Parameters
    ----------
    topic : str
        Resolved name.
    own : str
        Name of the node that is left out.
    subscriptions : list
        Of a master: ``[[topic, [node, ...]], ...]``.
    """
    return [node for name, nodes in subscriptions if name == topic for node in nodes if node != own]


def check_goal(_: PoseStamped, system_state: Optional[Callable[[], Any]] = None) -> None:
    """Warn if no node drives to goals.

    Parameters
    ----------
    _ : geometry_msgs.msg.PoseStamped
        The goal.
    system_state : callable, optional
        As getSystemState of :class:`rosgraph.Master`.
    """
    topic, own = rospy.resolve_name(_GOALS), rospy.get_name()
    try:
        subscriptions = (system_state or rosgraph.Master(own).getSystemState)()[1]
    except (rosgraph.MasterException, OSError):
        return              # the run is ending
    if not others_at(topic, own, subscriptions):
        rospy.logwarn("2D Nav Goal: no node takes goals from %s, so no robot drives there. Bug 2 does, for the model "
                      "m2wr: roslaunch m2wr_sim bug2.launch, or in a simulation that runs: roslaunch motion_plan "
                      "bug2.launch", topic)


def main() -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="place_robot", description=(
        "Place a robot at the pose of rviz's tool \"2D Pose Estimate\"; runs until it is stopped."), epilog=(
        "Parameters: _model:=NAME of the robot (m2wr), _frame:=NAME of the tf frame with the world axes (odom)."))
    parser.parse_args(rospy.myargv(sys.argv)[1:])
    start_node("place_robot", disable_rostime=True)
    services = []
    for name, kind in (("/gazebo/get_model_state", GetModelState), ("/gazebo/set_model_state", SetModelState)):
        while not rospy.is_shutdown():
            try:
                rospy.wait_for_service(name, _SERVICE_PATIENCE)
                break
            except rospy.ROSException:
                rospy.logwarn("place_robot: still waiting for the service %s", name)
        services.append(rospy.ServiceProxy(name, kind))
    node = PlaceRobot(str(rospy.get_param("~model", "m2wr")), str(rospy.get_param("~frame", "odom")), *services)
    rospy.Subscriber(_TOPIC, PoseWithCovarianceStamped, node.take, queue_size=1)
    rospy.Subscriber(_GOALS, PoseStamped, check_goal, queue_size=1)
    rospy.spin()
    return 0
