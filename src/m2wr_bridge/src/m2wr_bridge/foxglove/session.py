# SPDX-License-Identifier: BSD-3-Clause
"""One client of the Foxglove websocket protocol."""
from __future__ import annotations

import logging
import threading
from typing import Any, Callable, Dict, List, Optional, Protocol, Set

from m2wr_bridge.errors import BridgeError, unexpected
from m2wr_bridge.foxglove import wire
from m2wr_bridge.foxglove.catalogue import Catalogue, Changes
from m2wr_bridge.messages.received import Received
from m2wr_bridge.rosbridge.encodings import json_text
from m2wr_bridge.web.outbox import Frame, Stream
from m2wr_bridge.web.server import Client, Session

log = logging.getLogger("m2wr_bridge")

MOST = 1000                 # subscriptions, and channels, of a client
MOST_CALLS = 32             # services that a client calls at the same time
DEPTH = 100                 # messages of a topic that wait for a client
_MOST_COMPLAINTS = 50       # different errors of a client that are logged
_CLOCK_PERIOD = 1.0 / 60.0  # s between two times that are sent: one a picture
_ERROR = 2                  # level of a status
CAPABILITIES = ["clientPublish", "services", "parameters", "parametersSubscribe", "connectionGraph", "assets"]


class Graph(Protocol):
    """What a session needs of ROS; each method may wait for the master and raises BridgeError."""

    def subscribe(self, topic: str, type_name: Optional[str], listener: Callable[[Received], None]) -> None: ...

    def unsubscribe(self, topic: str, listener: Callable[[Received], None]) -> None: ...

    # Publish a topic for a holder.
    def offer(self, topic: str, type_name: str, holder: object) -> None: ...

    def unadvertise(self, topic: str, holder: object) -> None: ...

    # Publish a serialised message.
    def publish_raw(self, topic: str, payload: bytes) -> None: ...

    # Return the serialised answer to a serialised request.
    def call_raw(self, service: str, type_name: str, payload: bytes) -> bytes: ...

    # Return {name: value} of parameters, of all for no names.
    def parameters(self, names: List[str]) -> Dict[str, Any]: ...

    def set_parameter(self, name: str, value: Any) -> None: ...

    # Return the content of a file.
    def asset(self, uri: str) -> bytes: ...


class _Subscription:
    """One subscription of a client."""

    def __init__(self, topic: str, stream: Stream, listener: Callable[[Received], None]) -> None:
        self.topic, self.stream, self.listener = topic, stream, listener


class FoxgloveSession(Session):
    """Does what a client asks.

    Parameters
    ----------
    client : Client
    graph : Graph
    catalogue : Catalogue
    simulated : bool
        Whether time is simulated; then the client is sent the time.
    """

    def __init__(self, client: Client, graph: Graph, catalogue: Catalogue, simulated: bool) -> None:
        self._client, self._graph, self._catalogue = client, graph, catalogue
        self._subscriptions: Dict[int, _Subscription] = {}
        self._published: Dict[int, str] = {}
        self._calls = threading.BoundedSemaphore(MOST_CALLS)
        self._complaints: Set[str] = set()
        self.watched: Set[str] = set()          # parameters
        self.wants_graph = False
        self._clock = Stream(lambda received: [wire.clock_data(received.raw)], 1, _CLOCK_PERIOD)
        self._operations: Dict[Any, Callable[[Any], None]] = {
            wire.Subscribe: self._subscribe, wire.Unsubscribe: self._unsubscribe, wire.Advertise: self._advertise,
            wire.Unadvertise: self._unadvertise, wire.GetParameters: self._get_parameters,
            wire.SetParameters: self._set_parameters, wire.SubscribeParameters: self._watch,
            wire.UnsubscribeParameters: self._unwatch, wire.SubscribeGraph: lambda _: self._want_graph(True),
            wire.UnsubscribeGraph: lambda _: self._want_graph(False), wire.FetchAsset: self._fetch,
            wire.ClientMessage: self._publish, wire.Call: self._call}
        self._send({"op": "serverInfo", "name": "m2wr_bridge", "supportedEncodings": ["ros1"],
                    "metadata": {"ROS_DISTRO": "noetic"},       # else Foxglove's 3-D panel publishes no goals
                    "capabilities": CAPABILITIES + (["time"] if simulated else [])})

    def _send(self, fields: Dict[str, Any]) -> None:
        self._client.answer(json_text(fields))

    def tell(self, changes: Changes) -> None:
        """Tell the client what has appeared and gone; in any thread."""
        for name, key, values in (("unadvertise", "channelIds", changes.lost_channels),
                                  ("unadvertiseServices", "serviceIds", changes.lost_services),
                                  ("advertise", "channels", changes.channels),
                                  ("advertiseServices", "services", changes.services)):
            if values:
                self._send({"op": name, key: values})

    def tell_time(self, received: Received) -> None:
        """Send the simulated time of a message of /clock, as often as a picture needs it."""
        self._client.offer(self._clock, received, len(received.raw))

    def tell_parameters(self, values: Dict[str, Any], name: Optional[str] = None) -> None:
        """Send parameters.

        Parameters
        ----------
        values : dict
        name : str, optional
            Id of the request.
        """
        fields: Dict[str, Any] = {"op": "parameterValues", "parameters": [
            wire.parameter_fields(key, value) for key, value in values.items()]}
        if name is not None:
            fields["id"] = name
        self._send(fields)

    def tell_graph(self, fields: Dict[str, Any]) -> None:
        """Send the connection graph if the client wants it."""
        if self.wants_graph:
            self._send(dict(fields, op="connectionGraphUpdate"))

    def handle(self, message: Frame) -> None:
        """Do what a message asks; an error goes to the client and to the log."""
        try:
            request = wire.read(message)
            self._operations[type(request)](request)
        except BridgeError as error:
            self._complain(str(error))
        except Exception as error:      # of one request; the client and its other requests continue
            self._complain(unexpected(error), error)

    def close(self) -> None:
        """Release topics of the client."""
        for number in list(self._subscriptions):
            self._end(number)
        for topic in set(self._published.values()):
            self._graph.unadvertise(topic, self)

    def _complain(self, text: str, cause: Optional[Exception] = None) -> None:
        if text not in self._complaints and len(self._complaints) < _MOST_COMPLAINTS:
            self._complaints.add(text)
            log.warning("client %s: %s (said once)", self._client.name, text, exc_info=cause)
        self._send({"op": "status", "level": _ERROR, "message": text})

    # ---- topics ------------------------------------------------------------------------------------------------

    def _subscribe(self, request: wire.Subscribe) -> None:
        for wanted in request.subscriptions:
            channel = self._catalogue.channels.get(wanted.channel_id)
            if channel is None or wanted.id in self._subscriptions or not 0 <= wanted.id < 2**32:
                raise BridgeError("subscribe: channel %d with id %d; expected a channel that is advertised and a new id"
                                  % (wanted.channel_id, wanted.id))
            if len(self._subscriptions) >= MOST:
                raise BridgeError("subscribe: a client may have %d; this would be one more" % MOST)
            self._begin(wanted.id, channel.topic, channel.type_name)

    def _begin(self, number: int, topic: str, type_name: str) -> None:
        def encode(received: Received) -> List[Frame]:
            return [wire.message_data(number, _nanoseconds(received), received.raw)]

        stream = Stream(encode, DEPTH)

        def listener(received: Received) -> None:
            if received.type_name == type_name:
                self._client.offer(stream, received, len(received.raw))

        self._graph.subscribe(topic, type_name, listener)
        self._subscriptions[number] = _Subscription(topic, stream, listener)

    def _unsubscribe(self, request: wire.Unsubscribe) -> None:
        for number in request.subscription_ids:
            if number in self._subscriptions:
                self._end(number)

    def _end(self, number: int) -> None:
        found = self._subscriptions.pop(number)
        self._graph.unsubscribe(found.topic, found.listener)
        self._client.remove(found.stream)

    def _advertise(self, request: wire.Advertise) -> None:
        for channel in request.channels:
            if channel.encoding != "ros1":
                raise BridgeError("advertise %s: encoding %r; expected ros1" % (
                    channel.topic[:200], channel.encoding[:60]))
            if channel.id in self._published or len(self._published) >= MOST:
                raise BridgeError("advertise %s: channel %d is in use, or %d are" % (
                    channel.topic[:200], channel.id, MOST))
            self._graph.offer(channel.topic, channel.schema_name, self)
            self._published[channel.id] = channel.topic

    def _unadvertise(self, request: wire.Unadvertise) -> None:
        for number in request.channel_ids:
            topic = self._published.pop(number, None)
            if topic is None:
                raise BridgeError("unadvertise: channel %d was not advertised" % number)
            if topic not in self._published.values():
                self._graph.unadvertise(topic, self)

    def _publish(self, message: wire.ClientMessage) -> None:
        topic = self._published.get(message.channel)
        if topic is None:
            raise BridgeError("a message of channel %d, which was not advertised" % message.channel)
        self._graph.publish_raw(topic, message.payload)

    # ---- services, parameters, graph, files --------------------------------------------------------------------

    def _call(self, call: wire.Call) -> None:
        if not self._calls.acquire(False):
            self._fail(call, "%d services are being called already" % MOST_CALLS)
            return
        threading.Thread(target=self._run_call, args=(call,), daemon=True).start()

    def _run_call(self, call: wire.Call) -> None:
        service = self._catalogue.services.get(call.service)
        try:
            if service is None or call.encoding != "ros1":
                raise BridgeError("service %d, encoding %r; expected an advertised service and ros1" % (
                    call.service, call.encoding[:60]))
            payload = self._graph.call_raw(service.name, service.type_name, call.payload)
            self._client.answer(wire.response_data(call, payload))
        except BridgeError as error:
            self._fail(call, str(error))
        except Exception as error:          # a client waits for an answer, of whatever kind the error is
            log.error("service %s: %s", service and service.name, error, exc_info=error)
            self._fail(call, "%s: %s" % (type(error).__name__, error))
        finally:
            self._calls.release()

    def _fail(self, call: wire.Call, text: str) -> None:
        self._send({"op": "serviceCallFailure", "serviceId": call.service, "callId": call.call, "message": text})

    def _get_parameters(self, request: wire.GetParameters) -> None:
        self.tell_parameters(self._graph.parameters(request.parameter_names), request.id)

    def _set_parameters(self, request: wire.SetParameters) -> None:
        for parameter in request.parameters:
            self._graph.set_parameter(parameter.name, wire.parameter_value(parameter))
        if request.id is not None:
            self.tell_parameters(self._graph.parameters([one.name for one in request.parameters]), request.id)

    def _watch(self, request: wire.SubscribeParameters) -> None:
        names = set(request.parameter_names or self._graph.parameters([]))
        if len(self.watched | names) > 10 * MOST:
            raise BridgeError("subscribeParameterUpdates: expected at most %d names" % (10 * MOST))
        self.watched = self.watched | names

    def _unwatch(self, request: wire.UnsubscribeParameters) -> None:
        self.watched = self.watched - set(request.parameter_names) if request.parameter_names else set()

    def _want_graph(self, wanted: bool) -> None:
        self.wants_graph = wanted

    def _fetch(self, request: wire.FetchAsset) -> None:
        number = request.request_id & 0xffffffff
        try:
            self._client.answer(wire.asset_data(number, "", self._graph.asset(request.uri)))
        except BridgeError as error:
            self._client.answer(wire.asset_data(number, str(error), b""))


def _nanoseconds(received: Received) -> int:
    return received.secs * 10**9 + received.nsecs
