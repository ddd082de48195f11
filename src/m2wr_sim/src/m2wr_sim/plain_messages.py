# SPDX-License-Identifier: BSD-3-Clause
"""Message classes with the fields and defaults of ROS's own, for where ROS is not installed.

They have no serialisation.  The fields are those of the ``.msg`` files of ROS Noetic.
"""
from __future__ import annotations

import re
from typing import Any, Callable, Dict, Iterator, List, Optional, Tuple

_FIELDS = {
    "Time": "int32 secs, int32 nsecs",
    "Header": "uint32 seq, Time stamp, string frame_id",
    "Vector3": "float64 x, float64 y, float64 z",
    "Point": "float64 x, float64 y, float64 z",
    "Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "Pose": "Point position, Quaternion orientation",
    "PoseWithCovariance": "Pose pose, float64[36] covariance",
    "Twist": "Vector3 linear, Vector3 angular",
    "TwistWithCovariance": "Twist twist, float64[36] covariance",
    "Wrench": "Vector3 force, Vector3 torque",
    "WrenchStamped": "Header header, Wrench wrench",
    "Odometry": "Header header, string child_frame_id, PoseWithCovariance pose, TwistWithCovariance twist",
    "JointState": "Header header, string[] name, float64[] position, float64[] velocity, float64[] effort",
    "LaserScan": "Header header, float32 angle_min, float32 angle_max, float32 angle_increment,"
                 " float32 time_increment, float32 scan_time, float32 range_min, float32 range_max,"
                 " float32[] ranges, float32[] intensities",
    "Imu": "Header header, Quaternion orientation, float64[9] orientation_covariance, Vector3 angular_velocity,"
           " float64[9] angular_velocity_covariance, Vector3 linear_acceleration,"
           " float64[9] linear_acceleration_covariance",
    "Range": "Header header, uint8 radiation_type, float32 field_of_view, float32 min_range, float32 max_range,"
             " float32 range",
    "Vector3Stamped": "Header header, Vector3 vector",
    "Point32": "float32 x, float32 y, float32 z",
    "RegionOfInterest": "uint32 x_offset, uint32 y_offset, uint32 height, uint32 width, bool do_rectify",
    "CameraInfo": "Header header, uint32 height, uint32 width, string distortion_model, float64[] D, float64[9] K,"
                  " float64[9] R, float64[12] P, uint32 binning_x, uint32 binning_y, RegionOfInterest roi",
    "Image": "Header header, uint32 height, uint32 width, string encoding, uint8 is_bigendian, uint32 step,"
             " uint8[] data",
    "PointField": "string name, uint32 offset, uint8 datatype, uint32 count",
    "PointCloud2": "Header header, uint32 height, uint32 width, PointField[] fields, bool is_bigendian,"
                   " uint32 point_step, uint32 row_step, uint8[] data, bool is_dense",
    "ChannelFloat32": "string name, float32[] values",
    "PointCloud": "Header header, Point32[] points, ChannelFloat32[] channels",
    "NavSatStatus": "int8 status, uint16 service",
    "NavSatFix": "Header header, NavSatStatus status, float64 latitude, float64 longitude, float64 altitude,"
                 " float64[9] position_covariance, uint8 position_covariance_type",
    "MagneticField": "Header header, Vector3 magnetic_field, float64[9] magnetic_field_covariance",
    "SetCameraInfo": "",
    "SetCameraInfoResponse": "bool success, string status_message",
    "ContactState": "string info, string collision1_name, string collision2_name, Wrench[] wrenches,"
                    " Wrench total_wrench, Vector3[] contact_positions, Vector3[] contact_normals, float64[] depths",
    "ContactsState": "Header header, ContactState[] states",
    "Empty": "",
    "EmptyMessage": "",
    "EmptyResponse": "",
    "Bool": "bool data",
    "Float64": "float64 data",
    "Float32": "float32 data",
    "MultiArrayDimension": "string label, uint32 size, uint32 stride",
    "MultiArrayLayout": "MultiArrayDimension[] dim, uint32 data_offset",
    "Float64MultiArray": "MultiArrayLayout layout, float64[] data",
    "TwistStamped": "Header header, Twist twist",
    "Duration": "int32 secs, int32 nsecs",
    "JointTrajectoryPoint": "float64[] positions, float64[] velocities, float64[] accelerations, float64[] effort,"
                            " Duration time_from_start",
    "JointTrajectory": "Header header, string[] joint_names, JointTrajectoryPoint[] points",
    "GoalID": "Time stamp, string id",
    "GoalStatus": "GoalID goal_id, uint8 status, string text",
    "GoalStatusArray": "Header header, GoalStatus[] status_list",
    "JointTolerance": "string name, float64 position, float64 velocity, float64 acceleration",
    "FollowJointTrajectoryGoal": "JointTrajectory trajectory, JointTolerance[] path_tolerance,"
                                 " JointTolerance[] goal_tolerance, Duration goal_time_tolerance",
    "FollowJointTrajectoryResult": "int32 error_code, string error_string",
    "FollowJointTrajectoryFeedback": "Header header, string[] joint_names, JointTrajectoryPoint desired,"
                                     " JointTrajectoryPoint actual, JointTrajectoryPoint error",
    "FollowJointTrajectoryActionGoal": "Header header, GoalID goal_id, FollowJointTrajectoryGoal goal",
    "FollowJointTrajectoryActionFeedback": "Header header, GoalStatus status, FollowJointTrajectoryFeedback feedback",
    "FollowJointTrajectoryActionResult": "Header header, GoalStatus status, FollowJointTrajectoryResult result",
    "JointControllerState": "Header header, float64 set_point, float64 process_value, float64 process_value_dot,"
                            " float64 error, float64 time_step, float64 command, float64 p, float64 i, float64 d,"
                            " float64 i_clamp, bool antiwindup",
    "JointTrajectoryControllerState": "Header header, string[] joint_names, JointTrajectoryPoint desired,"
                                      " JointTrajectoryPoint actual, JointTrajectoryPoint error",
    "QueryTrajectoryState": "Time time",
    "QueryTrajectoryStateResponse": "string[] name, float64[] position, float64[] velocity, float64[] acceleration",
    "FourWheelSteering": "float32 front_steering_angle, float32 rear_steering_angle,"
                         " float32 front_steering_angle_velocity, float32 rear_steering_angle_velocity, float32 speed,"
                         " float32 acceleration, float32 jerk",
    "FourWheelSteeringStamped": "Header header, FourWheelSteering data",
    "GripperCommand": "float64 position, float64 max_effort",
    "GripperCommandGoal": "GripperCommand command",
    "GripperCommandResult": "float64 position, float64 effort, bool stalled, bool reached_goal",
    "GripperCommandFeedback": "float64 position, float64 effort, bool stalled, bool reached_goal",
    "GripperCommandActionGoal": "Header header, GoalID goal_id, GripperCommandGoal goal",
    "GripperCommandActionFeedback": "Header header, GoalStatus status, GripperCommandFeedback feedback",
    "GripperCommandActionResult": "Header header, GoalStatus status, GripperCommandResult result",
    "BumperEvent": "uint8 bumper, uint8 state",
    "CliffEvent": "uint8 sensor, uint8 state, uint16 bottom",
    "MotorPower": "uint8 state",
    "WheelDropEvent": "uint8 wheel, uint8 state",
    "SensorState": "Header header, uint16 time_stamp, uint8 bumper, uint8 wheel_drop, uint8 cliff, uint16 left_encoder,"
                   " uint16 right_encoder, int8 left_pwm, int8 right_pwm, uint8 buttons, uint8 charger, uint8 battery,"
                   " uint16[] bottom, uint8[] current, uint8 over_current, uint16 digital_input, uint16[] analog_input",
    "HardwareInterfaceResources": "string hardware_interface, string[] resources",
    "ControllerState": "string name, string state, string type, HardwareInterfaceResources[] claimed_resources",
    "ListControllers": "",
    "ListControllersResponse": "ControllerState[] controller",
    "ListControllerTypes": "",
    "ListControllerTypesResponse": "string[] types, string[] base_classes",
    "LoadController": "string name",
    "LoadControllerResponse": "bool ok",
    "ReloadControllerLibraries": "bool force_kill",
    "ReloadControllerLibrariesResponse": "bool ok",
    "SwitchController": "string[] start_controllers, string[] stop_controllers, int32 strictness, bool start_asap,"
                        " float64 timeout",
    "SwitchControllerResponse": "bool ok",
    "UnloadController": "string name",
    "UnloadControllerResponse": "bool ok",
}
_CONSTANTS = {"Range": {"ULTRASOUND": 0, "INFRARED": 1}, "PointField": {"UINT16": 4, "FLOAT32": 7},
              "NavSatFix": {"COVARIANCE_TYPE_DIAGONAL_KNOWN": 2},
              "BumperEvent": {"LEFT": 0, "CENTER": 1, "RIGHT": 2}, "CliffEvent": {"FLOOR": 0, "CLIFF": 1},
              "MotorPower": {"OFF": 0, "ON": 1},
              "SensorState": {"CLIFF_RIGHT": 1, "CLIFF_CENTRE": 2, "CLIFF_LEFT": 4, "WHEEL_DROP_RIGHT": 1,
                              "WHEEL_DROP_LEFT": 2}}
_FIELD = re.compile(r"(\w+?)(\d*)(\[(\d*)\])? (\w+)")
_PLAIN: Dict[str, Callable[[], Any]] = {"int": int, "uint": int, "float": float, "string": str,
                                        "bool": bool}


class PlainMessage:
    """A record of a ROS message; made from values by position, or by name."""

    __slots__: Tuple[str, ...] = ()
    _makers: Tuple[Callable[[], Any], ...] = ()

    def __init__(self, *values: Any, **named: Any) -> None:
        unknown = sorted(set(named) - set(self.__slots__))
        if unknown or len(values) not in (0, len(self.__slots__)):
            raise TypeError("%s has the fields %s; got %s" % (
                type(self).__name__, ", ".join(self.__slots__), ", ".join(unknown) or "%d values" % len(values)))
        for index, (name, maker) in enumerate(zip(self.__slots__, self._makers)):
            setattr(self, name, values[index] if values else named[name] if name in named else maker())

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and all(getattr(self, name) == getattr(other, name) for name in self.__slots__)

    __hash__ = None     # type: ignore[assignment]

    def __repr__(self) -> str:
        return "%s(%s)" % (type(self).__name__, ", ".join("%s=%r" % (name, getattr(self, name))
                                                          for name in self.__slots__))


def _maker(kind: str, array: bool, count: str, classes: Dict[str, type]) -> Callable[[], Any]:
    element = _PLAIN.get("uint" if kind == "uint8" else kind) or classes[kind]
    if not array:
        return element
    if kind == "uint8" and not count:
        return bytes
    size = int(count or 0)
    return lambda: [element() for _ in range(size)]


def _fields(text: str, classes: Dict[str, type]) -> Iterator[Tuple[str, Callable[[], Any]]]:
    for field in filter(None, map(str.strip, text.split(","))):
        found: Optional[re.Match[str]] = _FIELD.fullmatch(field)
        assert found is not None, field
        kind, bits, array, count, name = found.groups()
        known = kind in _PLAIN and kind + bits != "uint8"        # arrays of uint8 are bytes
        yield name, _maker(kind if known else kind + bits, array is not None, count, classes)


def _make_classes() -> Dict[str, type]:
    classes: Dict[str, type] = {}
    for message, text in _FIELDS.items():       # a message comes after those that it contains
        fields: List[Tuple[str, Callable[[], Any]]] = list(_fields(text, classes))
        body: Dict[str, Any] = {"__slots__": tuple(name for name, _ in fields), "__doc__": "See ROS's %s." % message,
                                "_makers": tuple(maker for _, maker in fields), "__module__": __name__}
        body.update(_CONSTANTS.get(message, {}))
        classes[message] = type(message, (PlainMessage,), body)
    return classes


#: The classes by name, without the package: ``Odometry``.
CLASSES = _make_classes()
