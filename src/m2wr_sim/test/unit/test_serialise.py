# SPDX-License-Identifier: BSD-3-Clause
"""Bytes on the wire: the fast ways give what genpy gives, for every message that has one."""
import math
import struct

import genpy
import numpy as np
import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan
from tf2_msgs.msg import TFMessage

from gazebo_msgs.msg import LinkStates, ModelStates
from m2wr_sim.plugins.world_states import StateTable
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.ros.serialise import _FAST, serialise_by_genpy, serialiser_of

STAMP = stamp_of(1234567890123)
ODD = [0.1, -0.0, math.inf, -math.inf, 1e-310, 1.7e308]


def headed(message, frame="odom"):
    message.header.stamp, message.header.frame_id = STAMP, frame
    return message


def fill(message, start=0.1):
    """Give every number of a message made of numbers a value of its own."""
    for name in message.__slots__:
        value = getattr(message, name)
        if isinstance(value, float):
            start += 0.37
            setattr(message, name, start)
        elif isinstance(value, genpy.Message) and name != "header":
            start = fill(value, start)
    return start


def clock():
    return Clock(STAMP)


def scan(ranges=(1.5, math.inf, 0.1), intensities=()):
    message = headed(LaserScan(ranges=list(ranges), intensities=list(intensities)), "läser")
    fill(message)
    return message


def odometry():
    message = headed(Odometry(child_frame_id="link_chassis"))
    fill(message)
    message.pose.covariance = [0.1 * index for index in range(36)]
    message.twist.covariance = [math.nan] * 36
    return message


def joint_state():
    return headed(JointState(name=["left", "räd"], position=ODD[:2], velocity=[], effort=ODD), "")


def transforms():
    entries = []
    for index in range(3):
        entries.append(headed(TransformStamped(child_frame_id="child%d" % index), "parent"))
        entries[-1].header.seq = index
        fill(entries[-1], index)
    return TFMessage(entries)


def table():
    made = StateTable(["ground_plane", "röbot", ""])
    made.poses[:] = np.arange(21.0).reshape(3, 7) / 7.0
    made.twists[:] = np.array(ODD * 3).reshape(3, 6)
    return made


MESSAGES = [clock(), scan(), scan([], []), scan(ODD[:4], [5.0] * 4), headed(LaserScan()), odometry(), Odometry(),
            joint_state(), JointState(), transforms(), TFMessage(), Clock()]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message._type.split("/")[1])
def test_a_message_becomes_the_bytes_that_genpy_makes(message):
    serialise, expected = serialiser_of(type(message)), serialise_by_genpy(4000000000, message)
    if type(message)._has_header:
        message.header.seq = 0
    assert serialise(4000000000, message) == expected
    if type(message)._has_header:
        assert message.header.seq == 4000000000         # as rospy leaves it


@pytest.mark.parametrize("kind", [ModelStates, LinkStates])
@pytest.mark.parametrize("states", [table(), StateTable([])])
def test_tables_of_states_become_the_bytes_of_their_message(kind, states):
    message = states.message(kind)
    assert [pose.orientation.w for pose in message.pose] == states.poses[:, 6].tolist()
    assert [twist.angular.z for twist in message.twist] == states.twists[:, 5].tolist()
    assert serialiser_of(kind)(1, states) == serialiser_of(kind)(1, message) == serialise_by_genpy(1, message)


def test_every_fast_way_is_compared():
    compared = {message._type for message in MESSAGES} | {ModelStates._type, LinkStates._type}
    pictures = {"sensor_msgs/Image", "sensor_msgs/PointCloud", "sensor_msgs/PointCloud2"}   # with their plugins
    assert compared | pictures == set(_FAST)


@pytest.mark.parametrize("dtype, order", [(np.float32, "C"), (np.float64, "C"), (">f4", "C"), (np.float32, "strided")])
def test_arrays_serve_as_lists(dtype, order):
    ranges = np.array([1.5, math.inf, 0.1, 7.25], dtype)
    if order == "strided":
        ranges = np.repeat(ranges, 3)[::3]
    arrays, lists = scan(), scan(np.asarray(ranges, np.float32).tolist())
    arrays.ranges = ranges
    assert serialiser_of(LaserScan)(7, arrays) == serialise_by_genpy(7, lists)
    states, again = joint_state(), joint_state()
    states.position, again.position = np.array(ODD), ODD
    assert serialiser_of(JointState)(7, states) == serialise_by_genpy(7, again)


def test_what_is_read_back_is_what_was_sent():
    sent = scan(np.linspace(0.1, 9.9, 720).astype(np.float32))
    sent.ranges = np.array(sent.ranges, np.float32)
    data = serialiser_of(LaserScan)(3, sent)
    assert struct.unpack("<I", data[:4])[0] == len(data) - 4
    read = LaserScan().deserialize(data[4:])
    assert read.ranges == tuple(sent.ranges.tolist()) and read.header.seq == 3
    assert read.header.stamp == rospy.Time(1234, 567890123) and read.header.frame_id == "läser"


def test_odd_values_are_judged_by_genpy():
    message = odometry()
    message.pose.covariance = [0.0] * 35
    with pytest.raises((genpy.SerializationError, rospy.ROSSerializationException)):
        serialiser_of(Odometry)(1, message)
    message = headed(JointState(name=["left"], position=["far"]))
    with pytest.raises((genpy.SerializationError, rospy.ROSSerializationException)):
        serialiser_of(JointState)(1, message)
    message = scan()
    message.header.frame_id = None              # rospy writes "0"
    assert serialiser_of(LaserScan)(1, message) == serialise_by_genpy(1, message)


def test_other_messages_go_the_plain_way():
    message = DiagnosticArray(status=[DiagnosticStatus(name="a", message="b")])
    assert serialiser_of(DiagnosticArray) is serialise_by_genpy
    assert serialise_by_genpy(9, message)[4:8] == struct.pack("<I", 9)


@pytest.mark.parametrize("now_ns", [0, 1, 999999999, 10 ** 9, 4 * 10 ** 18])
def test_stamps_are_exact(now_ns):
    assert stamp_of(now_ns) == rospy.Time(now_ns // 10 ** 9, now_ns % 10 ** 9)
    assert stamp_of(now_ns).to_nsec() == now_ns
