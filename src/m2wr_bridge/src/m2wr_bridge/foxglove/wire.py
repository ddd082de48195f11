# SPDX-License-Identifier: BSD-3-Clause
"""Messages of the Foxglove websocket protocol, version 1: binary ones, and those of JSON that a client sends."""
from __future__ import annotations

import struct
from typing import Any, Dict, List, NamedTuple, Optional, Union

import msgspec

from m2wr_bridge.errors import BridgeError

SUBPROTOCOL = "foxglove.websocket.v1"
_REAL, _REALS = "float64", "float64_array"      # types of a parameter and of a list of them; else JSON says the type
_MESSAGE = struct.Struct("<BIQ")
_TIME = struct.Struct("<BQ")
_CLOCK = struct.Struct("<II")     # secs, nsecs
_CALL = struct.Struct("<BIII")
_ASSET = struct.Struct("<BIBI")
_CLIENT_MESSAGE = struct.Struct("<BI")


class Call(NamedTuple):
    """A service that a client calls."""

    service: int
    call: int
    encoding: str
    payload: bytes


class ClientMessage(NamedTuple):
    """A message that a client publishes."""

    channel: int
    payload: bytes


class Request(msgspec.Struct, tag_field="op", rename="camel"):
    """What all requests of JSON have: the operation."""


class Wanted(msgspec.Struct, rename="camel"):
    id: int
    channel_id: int


class Subscribe(Request, tag="subscribe", rename="camel"):
    subscriptions: List[Wanted]


class Unsubscribe(Request, tag="unsubscribe", rename="camel"):
    subscription_ids: List[int]


class ClientChannel(msgspec.Struct, rename="camel"):
    id: int
    topic: str
    encoding: str
    schema_name: str


class Advertise(Request, tag="advertise", rename="camel"):
    channels: List[ClientChannel]


class Unadvertise(Request, tag="unadvertise", rename="camel"):
    channel_ids: List[int]


class GetParameters(Request, tag="getParameters", rename="camel"):
    parameter_names: List[str]
    id: Optional[str] = None


class Parameter(msgspec.Struct):
    name: str
    value: Any = None
    type: Optional[str] = None


class SetParameters(Request, tag="setParameters", rename="camel"):
    parameters: List[Parameter]
    id: Optional[str] = None


class SubscribeParameters(Request, tag="subscribeParameterUpdates", rename="camel"):
    parameter_names: List[str]


class UnsubscribeParameters(Request, tag="unsubscribeParameterUpdates", rename="camel"):
    parameter_names: List[str]


class SubscribeGraph(Request, tag="subscribeConnectionGraph"):
    """Send the connection graph from now on."""


class UnsubscribeGraph(Request, tag="unsubscribeConnectionGraph"):
    """Stop sending it."""


class FetchAsset(Request, tag="fetchAsset", rename="camel"):
    uri: str
    request_id: int


_DECODER = msgspec.json.Decoder(Union[
    Subscribe, Unsubscribe, Advertise, Unadvertise, GetParameters, SetParameters, SubscribeParameters,
    UnsubscribeParameters, SubscribeGraph, UnsubscribeGraph, FetchAsset])


def read(message: Union[str, bytes]) -> Any:
    """Return the request in a message.

    Parameters
    ----------
    message : str or bytes

    Raises
    ------
    BridgeError
        If it is no request; the text says where and what was expected.
    """
    if isinstance(message, str):
        try:
            return _DECODER.decode(message)
        except RecursionError:
            raise BridgeError("JSON is nested too deep") from None
        except (msgspec.MsgspecError, UnicodeError, ValueError) as error:
            raise BridgeError("not a request: %s" % error) from None
    operation = message[0] if message else 0
    if operation == 1 and len(message) >= _CLIENT_MESSAGE.size:
        return ClientMessage(_CLIENT_MESSAGE.unpack_from(message)[1], message[_CLIENT_MESSAGE.size:])
    if operation == 2 and len(message) >= _CALL.size:
        _, service, call, length = _CALL.unpack_from(message)
        end = _CALL.size + length
        if length <= len(message) - _CALL.size:
            return Call(service, call, message[_CALL.size:end].decode("utf-8", "replace"), message[end:])
    raise BridgeError("a binary message of %d bytes with operation %d; expected a message (1) or a call (2)" % (
        len(message), operation))


def parameter_value(parameter: Parameter) -> Any:
    """Return the value to set; JSON of a browser writes 1.0 as 1, and the type says what was meant.

    Raises
    ------
    BridgeError
        If a number is too large for its type.
    """
    def real(value: Any) -> Any:
        return float(value) if isinstance(value, int) and not isinstance(value, bool) else value

    try:
        if parameter.type == _REAL:
            return real(parameter.value)
        if parameter.type == _REALS and isinstance(parameter.value, list):
            return [real(one) for one in parameter.value]
    except OverflowError as error:
        raise BridgeError("parameter %s: %s; expected a number of the type %s" % (
            parameter.name[:200], error, parameter.type)) from None
    return parameter.value


def parameter_fields(name: str, value: Any) -> Dict[str, Any]:
    """Return what a client is told of a parameter.

    Parameters
    ----------
    name : str
    value : object
    """
    fields = {"name": name, "value": value}
    if isinstance(value, float):
        fields["type"] = _REAL
    elif isinstance(value, list) and value and all(isinstance(one, float) for one in value):
        fields["type"] = _REALS
    return fields


def message_data(subscription: int, nanoseconds: int, payload: bytes) -> bytes:
    """Return the frame of a topic's message.

    Parameters
    ----------
    subscription : int
        Id that the client has chosen.
    nanoseconds : int
        ROS time at which the message came.
    payload : bytes
    """
    return _MESSAGE.pack(1, subscription, nanoseconds) + payload


def clock_data(raw: bytes) -> bytes:
    """Return the frame of the time in a serialised rosgraph_msgs/Clock."""
    secs, nsecs = _CLOCK.unpack_from(raw)
    return _TIME.pack(2, secs * 10**9 + nsecs)


def response_data(call: Call, payload: bytes) -> bytes:
    """Return the frame of a service's answer.

    Parameters
    ----------
    call : Call
    payload : bytes
    """
    name = call.encoding.encode("utf-8")
    return _CALL.pack(3, call.service, call.call, len(name)) + name + payload


def asset_data(request: int, error: str, content: bytes) -> bytes:
    """Return the frame of a file.

    Parameters
    ----------
    request : int
    error : str
        Empty: none.
    content : bytes
    """
    text = error.encode("utf-8")
    return _ASSET.pack(4, request, 1 if error else 0, len(text)) + text + content
