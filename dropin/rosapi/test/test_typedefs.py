# SPDX-License-Identifier: BSD-3-Clause
"""Definitions of types: fields, lengths of arrays, constants, types in types."""
import roslib.message

from rosapi_services.typedefs import definitions

FIND = roslib.message.get_message_class


def of(name):
    return definitions(FIND(name), FIND)


def test_types_in_a_type_are_listed_once_after_it():
    assert [one.type for one in of("geometry_msgs/PoseStamped")] == [
        "geometry_msgs/PoseStamped", "std_msgs/Header", "time", "geometry_msgs/Pose", "geometry_msgs/Point",
        "geometry_msgs/Quaternion"]


def test_arrays_have_their_length():
    first = of("sensor_msgs/CameraInfo")[0]
    found = dict(zip(first.fieldnames, zip(first.fieldtypes, first.fieldarraylen, first.examples)))
    assert found["K"] == ("float64", 9, "[]") and found["D"] == ("float64", 0, "[]")
    assert found["height"] == ("uint32", -1, "0") and found["roi"] == ("sensor_msgs/RegionOfInterest", -1, "{}")


def test_constants_are_listed():
    first = of("diagnostic_msgs/DiagnosticStatus")[0]
    assert dict(zip(first.constnames, first.constvalues))["ERROR"] == "2"
