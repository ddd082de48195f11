# SPDX-License-Identifier: BSD-3-Clause
"""What a client may ask for in the protocol of rosbridge, version 2, read with types."""
from __future__ import annotations

from typing import Any, Dict, List, Optional, Union

import msgspec

from m2wr_bridge.errors import BridgeError

Id = Optional[Union[str, int]]


class Request(msgspec.Struct, tag_field="op", kw_only=True):
    """What all requests have; ``id`` comes back in the answers."""

    id: Id = None


class Advertise(Request, tag="advertise", kw_only=True):
    topic: str
    type: str
    latch: bool = False
    queue_size: Optional[int] = None


class Unadvertise(Request, tag="unadvertise", kw_only=True):
    topic: str


class Publish(Request, tag="publish", kw_only=True):
    topic: str
    msg: Dict[str, Any] = msgspec.field(default_factory=dict)
    latch: bool = False
    queue_size: Optional[int] = None


class Subscribe(Request, tag="subscribe", kw_only=True):
    topic: str
    type: Optional[str] = None
    throttle_rate: Optional[float] = None       # ms
    queue_length: Optional[int] = None
    fragment_size: Optional[int] = None
    compression: Optional[str] = None


class Unsubscribe(Request, tag="unsubscribe", kw_only=True):
    topic: str


class CallService(Request, tag="call_service", kw_only=True):
    service: str
    type: Optional[str] = None
    args: Union[Dict[str, Any], List[Any], None] = None
    fragment_size: Optional[int] = None
    compression: Optional[str] = None


class AdvertiseService(Request, tag="advertise_service", kw_only=True):
    service: str
    type: str


class UnadvertiseService(Request, tag="unadvertise_service", kw_only=True):
    service: str


class ServiceResponse(Request, tag="service_response", kw_only=True):
    service: str
    values: Any = None
    result: bool = True


class SetLevel(Request, tag="set_level", kw_only=True):
    level: str


class Fragment(Request, tag="fragment", kw_only=True):
    data: str
    num: int
    total: int


AnyRequest = Union[Advertise, Unadvertise, Publish, Subscribe, Unsubscribe, CallService, AdvertiseService,
                   UnadvertiseService, ServiceResponse, SetLevel, Fragment]
_DECODER = msgspec.json.Decoder(AnyRequest)
_OPERATIONS = ("advertise", "unadvertise", "publish", "subscribe", "unsubscribe", "call_service", "advertise_service",
               "unadvertise_service", "service_response", "set_level", "fragment")


class _Head(msgspec.Struct):
    id: Any = None
    op: Any = None


def read(text: Union[str, bytes]) -> Any:
    """Return the request in a message.

    Parameters
    ----------
    text : str
        JSON.

    Raises
    ------
    BridgeError
        If it is no request; the text says where and what was expected.
    """
    if not isinstance(text, str):
        raise BridgeError("a binary message of %d bytes; expected JSON text (BSON is not supported)" % len(text))
    try:
        return _DECODER.decode(text)
    except RecursionError:
        raise BridgeError("JSON is nested too deep") from None
    except (msgspec.MsgspecError, UnicodeError, ValueError) as error:
        operation = head(text).op
        if isinstance(operation, str) and operation not in _OPERATIONS:
            raise BridgeError("unknown operation %r; expected one of %s" % (
                operation[:60], ", ".join(_OPERATIONS))) from None
        raise BridgeError("%s: %s" % (operation if isinstance(operation, str) else "not a request", error)) from None


def head(text: Union[str, bytes]) -> _Head:
    """Return what can be read of the operation and the id of a message that is no request."""
    try:
        return msgspec.json.decode(text, type=_Head)
    except (msgspec.MsgspecError, UnicodeError, ValueError, RecursionError):
        return _Head()
