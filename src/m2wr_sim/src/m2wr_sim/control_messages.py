# SPDX-License-Identifier: BSD-3-Clause
"""The message classes of ros_control: apart from those of all plugins, because importing them takes time."""
from __future__ import annotations

from typing import Any

from m2wr_sim.messages import JointState, Odometry, Twist, find_message

Header: Any = find_message("std_msgs.msg", "Header")
Bool: Any = find_message("std_msgs.msg", "Bool")
Float64: Any = find_message("std_msgs.msg", "Float64")
Float64MultiArray: Any = find_message("std_msgs.msg", "Float64MultiArray")
TwistStamped: Any = find_message("geometry_msgs.msg", "TwistStamped")
JointTrajectory: Any = find_message("trajectory_msgs.msg", "JointTrajectory")
JointTrajectoryPoint: Any = find_message("trajectory_msgs.msg", "JointTrajectoryPoint")
GoalID: Any = find_message("actionlib_msgs.msg", "GoalID")
GoalStatus: Any = find_message("actionlib_msgs.msg", "GoalStatus")
GoalStatusArray: Any = find_message("actionlib_msgs.msg", "GoalStatusArray")
FollowJointTrajectoryActionGoal: Any = find_message("control_msgs.msg", "FollowJointTrajectoryActionGoal")
FollowJointTrajectoryActionFeedback: Any = find_message("control_msgs.msg", "FollowJointTrajectoryActionFeedback")
FollowJointTrajectoryActionResult: Any = find_message("control_msgs.msg", "FollowJointTrajectoryActionResult")
GripperCommandActionGoal: Any = find_message("control_msgs.msg", "GripperCommandActionGoal")
GripperCommandActionFeedback: Any = find_message("control_msgs.msg", "GripperCommandActionFeedback")
GripperCommandActionResult: Any = find_message("control_msgs.msg", "GripperCommandActionResult")
JointControllerState: Any = find_message("control_msgs.msg", "JointControllerState")
JointTrajectoryControllerState: Any = find_message("control_msgs.msg", "JointTrajectoryControllerState")
QueryTrajectoryState: Any = find_message("control_msgs.srv", "QueryTrajectoryState")
QueryTrajectoryStateResponse: Any = find_message("control_msgs.srv", "QueryTrajectoryStateResponse")
FourWheelSteering: Any = find_message("four_wheel_steering_msgs.msg", "FourWheelSteering")
FourWheelSteeringStamped: Any = find_message("four_wheel_steering_msgs.msg", "FourWheelSteeringStamped")
ControllerState: Any = find_message("controller_manager_msgs.msg", "ControllerState")
HardwareInterfaceResources: Any = find_message("controller_manager_msgs.msg", "HardwareInterfaceResources")
ListControllers: Any = find_message("controller_manager_msgs.srv", "ListControllers")
ListControllersResponse: Any = find_message("controller_manager_msgs.srv", "ListControllersResponse")
ListControllerTypes: Any = find_message("controller_manager_msgs.srv", "ListControllerTypes")
ListControllerTypesResponse: Any = find_message("controller_manager_msgs.srv", "ListControllerTypesResponse")
LoadController: Any = find_message("controller_manager_msgs.srv", "LoadController")
LoadControllerResponse: Any = find_message("controller_manager_msgs.srv", "LoadControllerResponse")
ReloadControllerLibraries: Any = find_message("controller_manager_msgs.srv", "ReloadControllerLibraries")
ReloadControllerLibrariesResponse: Any = find_message("controller_manager_msgs.srv",
                                                      "ReloadControllerLibrariesResponse")
SwitchController: Any = find_message("controller_manager_msgs.srv", "SwitchController")
SwitchControllerResponse: Any = find_message("controller_manager_msgs.srv", "SwitchControllerResponse")
UnloadController: Any = find_message("controller_manager_msgs.srv", "UnloadController")
UnloadControllerResponse: Any = find_message("controller_manager_msgs.srv", "UnloadControllerResponse")

__all__ = [name for name in dir() if name[0].isupper() and name != "Any"]
assert JointState and Odometry and Twist        # also of this module
