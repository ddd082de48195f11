# SPDX-License-Identifier: BSD-3-Clause
"""Plain messages have the fields and defaults of ROS's."""
import importlib

import pytest

from m2wr_sim import messages, plain_messages

MODULES = ("geometry_msgs.msg", "gazebo_msgs.msg", "nav_msgs.msg", "sensor_msgs.msg", "std_msgs.msg", "std_srvs.srv",
           "actionlib_msgs.msg", "control_msgs.msg", "control_msgs.srv", "controller_manager_msgs.msg",
           "controller_manager_msgs.srv", "four_wheel_steering_msgs.msg", "kobuki_msgs.msg", "sensor_msgs.srv",
           "trajectory_msgs.msg")


def of_ros(name):
    """Return ROS's class of this name."""
    found = [getattr(importlib.import_module(module), name) for module in MODULES
             if hasattr(importlib.import_module(module), name)]
    chosen = [one for one in found if name != "Empty" or one.__module__.startswith("std_srvs")][0]
    return getattr(chosen, "_request_class", chosen)            # a service stands for its request


def values_of(message):
    """Return the fields of a message and of those in it, with their values."""
    if not hasattr(message, "__slots__"):
        return message
    return [(name, values_of(getattr(message, name))) for name in message.__slots__]


@pytest.mark.parametrize("name", sorted(set(plain_messages.CLASSES) - {
    "Time", "Duration", "Empty", "EmptyMessage", "SetCameraInfo"}))
def test_fields_and_defaults_are_those_of_ros(name):
    real, plain = of_ros(name)(), plain_messages.CLASSES[name]()
    assert values_of(plain) == values_of(real)


def test_all_classes_of_plugins_are_there():
    names = {name for name in vars(messages) if name[0].isupper() and name not in ("Any", "CLASSES", "WITH_ROS")}
    assert len(names) == 27
    assert names <= set(plain_messages.CLASSES)


def test_constants_are_those_of_ros():
    for name in ("ULTRASOUND", "INFRARED"):
        assert getattr(plain_messages.CLASSES["Range"], name) == getattr(messages.Range, name)


def test_a_message_is_made_by_name_or_by_position():
    vector = plain_messages.CLASSES["Vector3"]
    assert vector(1.0, 2.0, 3.0) == vector(x=1.0, y=2.0, z=3.0)
    assert vector() != vector(x=1.0)
    assert repr(vector(z=0.5)) == "Vector3(x=0.0, y=0.0, z=0.5)"


@pytest.mark.parametrize("values, named", [((1.0,), {}), ((), {"w": 1.0})])
def test_unknown_fields_are_refused(values, named):
    with pytest.raises(TypeError, match="Vector3 has the fields x, y, z; got"):
        plain_messages.CLASSES["Vector3"](*values, **named)


def test_defaults_are_not_shared():
    scan = plain_messages.CLASSES["LaserScan"]
    one = scan()
    one.ranges.append(1.0)
    assert scan().ranges == []
