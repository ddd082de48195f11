# SPDX-License-Identifier: BSD-3-Clause
"""What one client has subscribed to."""
from __future__ import annotations

from typing import Any, Dict, List, NamedTuple, Optional

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.messages.plain import Reader
from m2wr_bridge.messages.received import Received
from m2wr_bridge.rosbridge.encodings import COMPRESSIONS, cbor_bytes, json_text, png_text
from m2wr_bridge.rosbridge.fragments import split
from m2wr_bridge.rosbridge.requests import Id, Subscribe
from m2wr_bridge.web.outbox import Frame, Stream

DEFAULT_DEPTH = 100         # messages that wait where the client gives no length
MOST_DEPTH = 10_000


class Readers(NamedTuple):
    """Converters of messages for the two encodings."""

    json: Reader
    cbor: Reader


class Options(NamedTuple):
    """Of a subscription: ``period`` in s, ``depth`` in messages, ``fragment`` in characters."""

    period: float
    depth: int
    fragment: Optional[int]
    compression: str


def options_of(request: Subscribe) -> Options:
    """Return the options of a request.

    Raises
    ------
    BridgeError
        If one is out of range.
    """
    throttle, depth = request.throttle_rate or 0.0, request.queue_length or 0
    compression = request.compression or "none"
    if not 0.0 <= throttle <= 1e9:
        raise BridgeError("subscribe: throttle_rate is %g; expected 0 to 1e9 ms" % throttle)
    if not 0 <= depth:
        raise BridgeError("subscribe: queue_length is %d; expected 0 or more" % depth)
    if compression not in COMPRESSIONS:
        raise BridgeError("subscribe: compression is %r; expected %s" % (compression[:60], ", ".join(COMPRESSIONS)))
    if depth == 0:
        depth = 1 if throttle else DEFAULT_DEPTH
    return Options(throttle / 1e3, min(depth, MOST_DEPTH), request.fragment_size, compression)


class Subscription:
    """All subscriptions of one client to one topic, sent as one stream.

    Parameters
    ----------
    topic : str
    readers : Readers
    complain : callable
        Takes the text of an error.
    """

    def __init__(self, topic: str, readers: Readers, complain: Any) -> None:
        self.topic, self._readers, self._complain = topic, readers, complain
        self.stream = Stream(self.frames, DEFAULT_DEPTH)
        self._wanted: Dict[Id, Options] = {}
        self._merged = Options(0.0, DEFAULT_DEPTH, None, "none")
        self.listener: Any = None

    def want(self, name: Id, options: Options) -> None:
        """Add or replace the subscription with an id.

        Parameters
        ----------
        name : str, int or None
        options : Options
        """
        self._wanted[name] = options
        self._merge()

    def drop(self, name: Id) -> bool:
        """Remove the subscription with an id, all of them for None; return whether none is left."""
        if name is None:
            self._wanted.clear()
        self._wanted.pop(name, None)
        self._merge()
        return not self._wanted

    def _merge(self) -> None:
        """Give the most that one of the subscriptions asks for, in the smallest form that one asks for."""
        every = list(self._wanted.values())
        if not every:
            return
        sizes = [one.fragment for one in every if one.fragment]
        strongest = max((one.compression for one in every), key=COMPRESSIONS.index)
        self._merged = Options(min(one.period for one in every), max(one.depth for one in every),
                               min(sizes) if sizes else None, strongest)
        self.stream.period, self.stream.depth = self._merged.period, self._merged.depth

    def frames(self, received: Received) -> List[Frame]:
        """Return the frames of a message; none, and a complaint, if it cannot be sent."""
        try:
            return self._encode(received)
        except BridgeError as error:
            self._complain("%s: %s" % (self.topic, error))
            return []

    def _encode(self, received: Received) -> List[Frame]:
        kind = self._merged.compression
        if kind == "cbor-raw":
            return [cbor_bytes({"op": "publish", "topic": self.topic, "msg": {
                "secs": received.secs, "nsecs": received.nsecs, "bytes": received.raw}})]
        if kind == "cbor":
            return [received.encoded("cbor", lambda message: cbor_bytes(
                {"op": "publish", "topic": self.topic, "msg": self._readers.cbor.plain(message)}))]
        text = received.encoded("json", lambda message: json_text(
            {"op": "publish", "topic": self.topic, "msg": self._readers.json.plain(message)}))
        name = next(iter(self._wanted), None)
        if kind == "png":
            text = png_text(text)
        return list(split(text, self._merged.fragment, self.topic if name is None else name))
