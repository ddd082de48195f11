# SPDX-License-Identifier: BSD-3-Clause
"""Table of the controller types: a new one is a module and a line here."""
from __future__ import annotations

import difflib
import importlib
from typing import Callable, Optional

from m2wr_sim.ros_control.controllers.base import Controller

_HERE = "m2wr_sim.ros_control.controllers."

CONTROLLERS = {
    "joint_state_controller/JointStateController": _HERE + "joint_state:JointState",
    "diff_drive_controller/DiffDriveController": _HERE + "diff_drive:DiffDrive",
    "ackermann_steering_controller/AckermannSteeringController": _HERE + "steering:Ackermann",
    "four_wheel_steering_controller/FourWheelSteeringController": _HERE + "four_wheel_steering:FourWheelSteering",
    "position_controllers/JointPositionController": _HERE + "forward:PositionForward",
    "position_controllers/JointGroupPositionController": _HERE + "forward:PositionGroup",
    "velocity_controllers/JointVelocityController": _HERE + "forward:VelocityForward",
    "velocity_controllers/JointGroupVelocityController": _HERE + "forward:VelocityGroup",
    "velocity_controllers/JointPositionController": _HERE + "joint_pid:PositionByVelocity",
    "effort_controllers/JointEffortController": _HERE + "forward:EffortForward",
    "effort_controllers/JointGroupEffortController": _HERE + "forward:EffortGroup",
    "effort_controllers/JointPositionController": _HERE + "joint_pid:PositionByEffort",
    "effort_controllers/JointVelocityController": _HERE + "joint_pid:VelocityByEffort",
    "effort_controllers/JointGroupPositionController": _HERE + "joint_pid:PositionGroupByEffort",
    "position_controllers/JointTrajectoryController": _HERE + "trajectory:PositionTrajectory",
    "velocity_controllers/JointTrajectoryController": _HERE + "trajectory:VelocityTrajectory",
    "effort_controllers/JointTrajectoryController": _HERE + "trajectory:EffortTrajectory",
    "position_controllers/GripperActionController": _HERE + "gripper:PositionGripper",
    "effort_controllers/GripperActionController": _HERE + "gripper:EffortGripper",
}


def find_controller(name: str) -> Optional[Callable[[], Controller]]:
    """Return the class of a controller type, or None."""
    target = CONTROLLERS.get(name)
    if target is None:
        return None
    module, _, attribute = target.partition(":")
    return getattr(importlib.import_module(module), attribute)


def nearest(name: str) -> str:
    """Return the known type whose name is most similar, or an empty text."""
    return next(iter(difflib.get_close_matches(name, CONTROLLERS, 1)), "")
