# SPDX-License-Identifier: BSD-3-Clause
"""Frames of the Foxglove protocol, byte by byte, and what is no frame."""
import pytest

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.foxglove import wire


def test_frames_have_the_bytes_of_the_protocol():
    assert wire.message_data(1, 2, b"ab") == bytes([1, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0]) + b"ab"
    assert wire.clock_data(bytes([0, 0, 0, 0, 0, 1, 0, 0])) == bytes([2, 0, 1, 0, 0, 0, 0, 0, 0])
    call = wire.Call(3, 4, "ros1", b"")
    assert wire.response_data(call, b"x") == bytes([3, 3, 0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0]) + b"ros1x"
    assert wire.asset_data(5, "", b"x") == bytes([4, 5, 0, 0, 0, 0, 0, 0, 0, 0]) + b"x"
    assert wire.asset_data(5, "no", b"") == bytes([4, 5, 0, 0, 0, 1, 2, 0, 0, 0]) + b"no"


def test_requests_are_read():
    assert wire.read(bytes([1, 7, 0, 0, 0]) + b"ab") == wire.ClientMessage(7, b"ab")
    assert wire.read(bytes([2, 3, 0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0]) + b"ros1x") == wire.Call(3, 4, "ros1", b"x")
    request = wire.read('{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 2}], "more": 1}')
    assert (request.subscriptions[0].id, request.subscriptions[0].channel_id) == (1, 2)


@pytest.mark.parametrize("kind, value, expected", [
    ("float64", 2, 2.0), ("float64", True, True), ("float64", None, None), ("float64", "2", "2"), (None, 2, 2),
    ("float64_array", [1, 2.5], [1.0, 2.5]), (None, [1, 2], [1, 2]), ("no_such_type", 2, 2)])
def test_the_type_of_a_parameter_makes_numbers_real(kind, value, expected):
    found = wire.parameter_value(wire.Parameter("/a", value, kind))
    assert found == expected and repr(found) == repr(expected)


def test_a_number_too_large_for_its_type_is_refused():
    with pytest.raises(BridgeError, match="parameter /a"):
        wire.parameter_value(wire.Parameter("/a", 10**400, "float64"))


@pytest.mark.parametrize("value, kind", [
    (2.0, "float64"), (2, None), (True, None), ([1.0, 2.0], "float64_array"), ([1.0, 2], None), ([], None)])
def test_real_parameters_are_told_with_their_type(value, kind):
    assert wire.parameter_fields("/a", value).get("type") == kind


@pytest.mark.parametrize("message", [
    b"", b"\x00", b"\x01\x00", b"\x02" + bytes(11), b"\x02" + bytes(8) + b"\xff\xff\xff\xff", b"\x03" + bytes(20), "",
    "[]", "{}", '{"op": 1}', '{"op": "subscribe"}', '{"op": "fetchAsset", "uri": "x", "requestId": "1"}', "\ud800",
    '{"op": "setParameters", "parameters": [{"name": "a", "value": ' + "[" * 100000], ids=range(14))
def test_anything_else_is_refused(message):
    with pytest.raises(BridgeError):
        wire.read(message)
