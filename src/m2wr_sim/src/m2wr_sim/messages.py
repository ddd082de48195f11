# SPDX-License-Identifier: BSD-3-Clause
"""The message classes that plugins use: those of ROS, or plain ones with the same fields where ROS is not installed."""
from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from m2wr_sim.plain_messages import CLASSES

#: Whether the classes are those of ROS.
WITH_ROS = importlib.util.find_spec("genpy") is not None


def find_message(module: str, name: str) -> Any:
    """Return the class of a message or service.

    Parameters
    ----------
    module : str
        Module of ROS, such as ``std_msgs.msg``.
    name : str
        Name of the class.
    """
    return getattr(importlib.import_module(module), name) if WITH_ROS else CLASSES[name]


Pose: Any = find_message("geometry_msgs.msg", "Pose")
Twist: Any = find_message("geometry_msgs.msg", "Twist")
Vector3: Any = find_message("geometry_msgs.msg", "Vector3")
Wrench: Any = find_message("geometry_msgs.msg", "Wrench")
WrenchStamped: Any = find_message("geometry_msgs.msg", "WrenchStamped")
ContactState: Any = find_message("gazebo_msgs.msg", "ContactState")
ContactsState: Any = find_message("gazebo_msgs.msg", "ContactsState")
Odometry: Any = find_message("nav_msgs.msg", "Odometry")
Imu: Any = find_message("sensor_msgs.msg", "Imu")
JointState: Any = find_message("sensor_msgs.msg", "JointState")
LaserScan: Any = find_message("sensor_msgs.msg", "LaserScan")
Range: Any = find_message("sensor_msgs.msg", "Range")
Empty: Any = find_message("std_srvs.srv", "Empty")
EmptyResponse: Any = find_message("std_srvs.srv", "EmptyResponse")
CameraInfo: Any = find_message("sensor_msgs.msg", "CameraInfo")
ChannelFloat32: Any = find_message("sensor_msgs.msg", "ChannelFloat32")
Image: Any = find_message("sensor_msgs.msg", "Image")
MagneticField: Any = find_message("sensor_msgs.msg", "MagneticField")
NavSatFix: Any = find_message("sensor_msgs.msg", "NavSatFix")
PointCloud: Any = find_message("sensor_msgs.msg", "PointCloud")
PointCloud2: Any = find_message("sensor_msgs.msg", "PointCloud2")
PointField: Any = find_message("sensor_msgs.msg", "PointField")
Point32: Any = find_message("geometry_msgs.msg", "Point32")
Vector3Stamped: Any = find_message("geometry_msgs.msg", "Vector3Stamped")
SetCameraInfo: Any = find_message("sensor_msgs.srv", "SetCameraInfo")
SetCameraInfoResponse: Any = find_message("sensor_msgs.srv", "SetCameraInfoResponse")
EmptyMessage: Any = find_message("std_msgs.msg", "Empty")
