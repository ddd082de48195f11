# SPDX-License-Identifier: BSD-3-Clause
"""The message classes that plugins use: those of ROS, or plain ones with the same fields where ROS is not installed."""
from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from m2wr_sim.plain_messages import CLASSES

#: Whether the classes are those of ROS.
WITH_ROS = importlib.util.find_spec("genpy") is not None


def _find(module: str, name: str) -> Any:
    return getattr(importlib.import_module(module), name) if WITH_ROS else CLASSES[name]


Pose: Any = _find("geometry_msgs.msg", "Pose")
Twist: Any = _find("geometry_msgs.msg", "Twist")
Vector3: Any = _find("geometry_msgs.msg", "Vector3")
Wrench: Any = _find("geometry_msgs.msg", "Wrench")
WrenchStamped: Any = _find("geometry_msgs.msg", "WrenchStamped")
ContactState: Any = _find("gazebo_msgs.msg", "ContactState")
ContactsState: Any = _find("gazebo_msgs.msg", "ContactsState")
Odometry: Any = _find("nav_msgs.msg", "Odometry")
Imu: Any = _find("sensor_msgs.msg", "Imu")
JointState: Any = _find("sensor_msgs.msg", "JointState")
LaserScan: Any = _find("sensor_msgs.msg", "LaserScan")
Range: Any = _find("sensor_msgs.msg", "Range")
Empty: Any = _find("std_srvs.srv", "Empty")
EmptyResponse: Any = _find("std_srvs.srv", "EmptyResponse")
