# SPDX-License-Identifier: BSD-3-Clause
"""Messages as plain values, and back, with each value checked."""
import base64
import math

import cbor2
import pytest
import roslib.message
from geometry_msgs.msg import Pose, PoseStamped, Twist
from sensor_msgs.msg import Image, LaserScan
from std_msgs.msg import Bool, Byte, Char, ColorRGBA, Header, Int8, Int64, String, Time, UInt8MultiArray, UInt64
from tf2_msgs.msg import TFMessage

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.messages.build import Builder
from m2wr_bridge.messages.field_types import FieldType, parse
from m2wr_bridge.messages.plain import Reader, typed_array
from m2wr_bridge.rosbridge.encodings import json_text

READER, CBOR = Reader(roslib.message.get_message_class), Reader(roslib.message.get_message_class, typed_array)
BUILDER = Builder(roslib.message.get_message_class, lambda: (7, 8))


@pytest.mark.parametrize("text, expected", [
    ("float64", FieldType("float64", None)), ("float64[]", FieldType("float64", 0)),
    ("float64[36]", FieldType("float64", 36)), ("geometry_msgs/Pose[]", FieldType("geometry_msgs/Pose", 0))])
def test_field_types_are_read(text, expected):
    assert parse(text) == expected


@pytest.mark.parametrize("message", [
    Twist(), Pose(), LaserScan(ranges=[1.0, 2.5], header=Header(seq=3, frame_id="laser")),
    TFMessage(transforms=[roslib.message.get_message_class("geometry_msgs/TransformStamped")()] * 2),
    Image(data=b"\x00\xff", encoding="mono8"), String("ä\"<b>\n"), Int64(-2**63), UInt64(2**64 - 1), Byte(-128),
    Char(255), Bool(True)])
def test_a_message_survives_json(message):
    import msgspec
    text = json_text(READER.plain(message))
    assert BUILDER.build(type(message), msgspec.json.decode(text)) == message


def test_numbers_not_finite_are_null_and_come_back_as_nan():
    text = json_text(READER.plain(LaserScan(ranges=[1.0, math.nan, math.inf, -math.inf])))
    assert '"ranges":[1.0,null,null,null]' in text
    back = BUILDER.build(LaserScan, {"ranges": [1, None], "range_max": None})
    assert back.ranges[0] == 1.0 and math.isnan(back.ranges[1]) and math.isnan(back.range_max)


def test_octets_are_base64_in_json_and_read_from_numbers_too():
    plain = READER.plain(UInt8MultiArray(data=b"\x01\x02"))
    assert base64.b64encode(b"\x01\x02").decode() in json_text(plain)
    assert BUILDER.build(UInt8MultiArray, {"data": [1, 2]}).data == b"\x01\x02"


def test_cbor_has_typed_arrays():
    plain = cbor2.loads(cbor2.dumps(CBOR.plain(LaserScan(ranges=[1.5, math.nan]))))
    assert plain["ranges"].tag == 85 and plain["ranges"].value.hex() == "0000c03f0000c07f"
    assert cbor2.loads(cbor2.dumps(CBOR.plain(Image(data=b"ab"))))["data"] == b"ab"


def test_a_header_without_stamp_gets_the_present_time():
    assert BUILDER.build(PoseStamped, {"header": {"frame_id": "map"}}).header.stamp.nsecs == 8
    assert BUILDER.build(PoseStamped, {"header": {"stamp": {"secs": 1, "nsecs": 2}}}).header.stamp.secs == 1
    assert BUILDER.build(PoseStamped, {}).header.stamp.secs == 0
    assert BUILDER.build(Time, {"data": "now"}).data.secs == 7
    assert BUILDER.build(Time, {"data": {"sec": 4, "nanosec": 5}}).data.nsecs == 5


@pytest.mark.parametrize("kind, values, where", [
    (Twist, {"linear": {"x": "1"}}, "msg.linear.x: expected float64"), (Twist, {"linear": [1]}, "msg.linear: expected"),
    (Twist, {"speed": 1}, "has no field 'speed'"), (Twist, [], "expected an object"),
    (Twist, None, "expected an object"),
    (Twist, {"linear": {"x": True}}, "expected float64"), (Bool, {"data": 1}, "expected bool"),
    (Bool, {"data": None}, "expected bool"), (String, {"data": 5}, "expected string"),
    (Int8, {"data": 128}, "from -128 to 127"), (Int8, {"data": 1.5}, "whole number"), (Int8, {"data": None}, "whole"),
    (Int8, {"data": True}, "whole number"), (UInt64, {"data": -1}, "from 0"), (UInt64, {"data": 2**64}, "from 0"),
    (ColorRGBA, {"r": 1e39}, "float32, at most"), (ColorRGBA, {"r": 10**400}, "float32, at most"),
    (Twist, {"linear": {"x": 10**400}}, "float64, at most"),
    (LaserScan, {"ranges": 3}, "expected float32[]"), (LaserScan, {"ranges": [1, "2"]}, "expected float32"),
    (UInt8MultiArray, {"data": "no base64!"}, "base64"), (UInt8MultiArray, {"data": [256]}, "0 to 255"),
    (UInt8MultiArray, {"data": 5}, "base64"), (TFMessage, {"transforms": [{"header": {"seq": -1}}]}, "transforms[0]"),
    (Time, {"data": 5}, "expected a time"), (Time, {"data": {"secs": -1}}, "secs"),
    (Time, {"data": {"secs": 1, "x": 2}}, "expected a time"), (Time, {"data": "later"}, "expected a time")])
def test_a_value_that_does_not_fit_is_refused(kind, values, where):
    with pytest.raises(BridgeError) as caught:
        BUILDER.build(kind, values)
    assert where in str(caught.value)


def test_fixed_arrays_need_their_length():
    kind = roslib.message.get_message_class("geometry_msgs/PoseWithCovariance")
    assert BUILDER.build(kind, {"covariance": [1.0] * 36}).covariance == [1.0] * 36
    with pytest.raises(BridgeError, match="got 3 elements"):
        BUILDER.build(kind, {"covariance": [1.0] * 3})


def test_arguments_of_a_service_may_be_a_list():
    kind = roslib.message.get_service_class("std_srvs/SetBool")._request_class
    assert BUILDER.from_arguments(kind, [True]).data is True
    assert BUILDER.from_arguments(kind, {"data": True}).data is True
    assert BUILDER.from_arguments(kind, None).data is False
    with pytest.raises(BridgeError, match="at most 1 value"):
        BUILDER.from_arguments(kind, [True, False])
