# SPDX-License-Identifier: BSD-3-Clause
"""One client of the protocol of rosbridge, version 2."""
from __future__ import annotations

import logging
import threading
from typing import Any, Callable, Dict, NamedTuple, Optional, Set

from m2wr_bridge.errors import BridgeError, unexpected
from m2wr_bridge.messages.received import Received
from m2wr_bridge.rosbridge import requests
from m2wr_bridge.rosbridge.encodings import COMPRESSIONS, cbor_bytes, json_text, png_text
from m2wr_bridge.rosbridge.fragments import Assembly, split
from m2wr_bridge.rosbridge.globs import Globs
from m2wr_bridge.rosbridge.graph import Graph
from m2wr_bridge.rosbridge.served import ServedByClient
from m2wr_bridge.rosbridge.topics import Readers, Subscription, options_of
from m2wr_bridge.web.outbox import Frame
from m2wr_bridge.web.server import Client, Session

log = logging.getLogger("m2wr_bridge")

LEVELS = ("none", "error", "warning", "info")
MOST_TOPICS = 1000          # topics and services of a client, of each kind
MOST_CALLS = 32             # services that a client calls at the same time
QUEUE = 100                 # messages that wait for a subscriber of a topic that a client publishes
_MOST_COMPLAINTS = 50       # different errors of a client that are logged and sent from streams
_PARTS = 10                 # greatest messages that may be in parts


class Rules(NamedTuple):
    """For all clients: names they may use, s for the parts of a message, greatest message in bytes."""

    topics: Globs
    services: Globs
    patience: float
    largest: int


class RosbridgeSession(Session):
    """Does what a client asks.

    Parameters
    ----------
    client : Client
    graph : Graph
    rules : Rules
    readers : Readers
    clock : callable
        Returns the time of a clock that never goes back [s].
    """

    def __init__(self, client: Client, graph: Graph, rules: Rules, readers: Readers,
                 clock: Callable[[], float]) -> None:
        self._client, self._graph, self._rules, self._readers = client, graph, rules, readers
        self._clock = clock
        self._parts = Assembly(rules.patience, _PARTS * rules.largest)
        self._level = LEVELS.index("error")
        self._subscriptions: Dict[str, Subscription] = {}
        self._published: Dict[str, Set[requests.Id]] = {}
        self._served: Dict[str, ServedByClient] = {}
        self._calls = threading.BoundedSemaphore(MOST_CALLS)
        self._complaints: Set[str] = set()
        self._operations: Dict[Any, Callable[[Any], None]] = {
            requests.Advertise: self._advertise, requests.Unadvertise: self._unadvertise,
            requests.Publish: self._publish, requests.Subscribe: self._subscribe,
            requests.Unsubscribe: self._unsubscribe, requests.CallService: self._call_service,
            requests.AdvertiseService: self._advertise_service,
            requests.UnadvertiseService: self._unadvertise_service,
            requests.ServiceResponse: self._service_response, requests.SetLevel: self._set_level,
            requests.Fragment: self._fragment}

    def handle(self, message: Frame) -> None:
        """Do what a message asks; an error goes to the client and to the log."""
        name: requests.Id = None
        try:
            request = requests.read(message)
            name = request.id
            self._operations[type(request)](request)
        except BridgeError as error:
            self._status("error", str(error), _id_of(message) if name is None else name)
        except Exception as error:      # of one request; the client and its other requests continue
            self._status("error", unexpected(error), _id_of(message) if name is None else name, error)

    def close(self) -> None:
        """Release topics and services of the client."""
        for topic in list(self._subscriptions):
            self._end(topic)
        for topic in self._published:
            self._graph.unadvertise(topic, self)
        for service in list(self._served):
            self._withdraw(service)

    def _status(self, level: str, text: str, name: requests.Id = None, cause: Optional[Exception] = None) -> None:
        log_text = "client %s: %s" % (self._client.name, text)
        if text not in self._complaints and len(self._complaints) < _MOST_COMPLAINTS:
            self._complaints.add(text)
            (log.warning if level == "error" else log.info)("%s (said once)", log_text, exc_info=cause)
        if LEVELS.index(level) <= self._level:
            fields: Dict[str, Any] = {"op": "status", "level": level, "msg": text}
            if name is not None:
                fields["id"] = name
            self._client.answer(json_text(fields))

    def _complain(self, text: str) -> None:
        """Report an error of a stream, each text once: it may come with every message."""
        if text not in self._complaints and len(self._complaints) < _MOST_COMPLAINTS:
            self._status("error", text)

    @staticmethod
    def _check(kind: str, name: str, allowed: Globs, used: Dict[str, Any]) -> None:
        if not allowed.allow(name):
            raise BridgeError("%s: %s is not among the names that the parameter ~%ss_glob allows" % (
                kind, name[:200], "service" if "service" in kind else "topic"))
        if name not in used and len(used) >= MOST_TOPICS:
            raise BridgeError("%s: a client may have %d; this would be one more" % (kind, MOST_TOPICS))

    # ---- topics ------------------------------------------------------------------------------------------------

    def _advertise(self, request: requests.Advertise) -> None:
        self._check("advertise", request.topic, self._rules.topics, self._published)
        self._graph.advertise(request.topic, request.type, self, request.latch, _depth(request.queue_size))
        self._published.setdefault(request.topic, set()).add(request.id)

    def _unadvertise(self, request: requests.Unadvertise) -> None:
        names = self._published.get(request.topic)
        if names is None or (request.id is not None and request.id not in names):
            raise BridgeError("unadvertise: %s was not advertised%s" % (
                request.topic[:200], "" if request.id is None else " with id %r" % request.id))
        names.discard(request.id)
        if request.id is None or not names:
            del self._published[request.topic]
            self._graph.unadvertise(request.topic, self)

    def _publish(self, request: requests.Publish) -> None:
        if request.topic not in self._published:
            self._check("publish", request.topic, self._rules.topics, self._published)
            self._graph.advertise(request.topic, None, self, request.latch, _depth(request.queue_size))
            self._published[request.topic] = {None}
        self._graph.publish(request.topic, request.msg)

    def _subscribe(self, request: requests.Subscribe) -> None:
        self._check("subscribe", request.topic, self._rules.topics, self._subscriptions)
        options = options_of(request)
        found = self._subscriptions.get(request.topic)
        if found is not None:
            found.want(request.id, options)
            self._graph.repeat_latched(request.topic, found.listener)
            return
        made = Subscription(request.topic, self._readers, self._complain)
        made.want(request.id, options)

        def listener(received: Received) -> None:
            self._client.offer(made.stream, received, len(received.raw))

        made.listener = listener
        self._graph.subscribe(request.topic, request.type, listener)
        self._subscriptions[request.topic] = made

    def _unsubscribe(self, request: requests.Unsubscribe) -> None:
        found = self._subscriptions.get(request.topic)
        if found is not None and found.drop(request.id):
            self._end(request.topic)

    def _end(self, topic: str) -> None:
        found = self._subscriptions.pop(topic)
        self._graph.unsubscribe(topic, found.listener)
        self._client.remove(found.stream)

    # ---- services ----------------------------------------------------------------------------------------------

    def _call_service(self, request: requests.CallService) -> None:
        compression = request.compression or "none"
        if compression not in COMPRESSIONS:
            raise BridgeError("call_service: compression is %r; expected %s" % (
                compression[:60], ", ".join(COMPRESSIONS)))
        self._check("call_service", request.service, self._rules.services, {})
        if not self._calls.acquire(False):
            self._respond(request, "%d services are being called already" % MOST_CALLS, False)
            return
        threading.Thread(target=self._call, args=(request,), daemon=True).start()

    def _call(self, request: requests.CallService) -> None:
        try:
            values, good = self._graph.call(request.service, request.type, request.args), True
        except BridgeError as error:
            values, good = str(error), False
            self._status("error", "call_service %s: %s" % (request.service[:200], error), request.id)
        except Exception as error:          # a client waits for an answer, of whatever kind the error is
            log.error("call_service %s: %s", request.service, error, exc_info=error)
            values, good = "%s: %s" % (type(error).__name__, error), False
        finally:
            self._calls.release()
        try:
            self._respond(request, values, good)
        except BridgeError as error:
            self._respond(request, str(error), False)

    def _respond(self, request: requests.CallService, answer: Any, good: bool) -> None:
        binary = request.compression in ("cbor", "cbor-raw")
        reader = self._readers.cbor if binary else self._readers.json
        fields: Dict[str, Any] = {"op": "service_response", "service": request.service, "result": good,
                                  "values": reader.plain(answer) if good else answer}
        if request.id is not None:
            fields["id"] = request.id
        if binary:
            self._client.answer(cbor_bytes(fields))
            return
        text = json_text(fields)
        if request.compression == "png":
            text = png_text(text, request.id)
        for part in split(text, request.fragment_size, request.id):
            self._client.answer(part)

    def _advertise_service(self, request: requests.AdvertiseService) -> None:
        self._check("advertise_service", request.service, self._rules.services, self._served)
        if request.service in self._served:
            self._withdraw(request.service)
        served = ServedByClient(request.service, lambda fields: self._client.answer(json_text(fields)))
        self._graph.offer_service(request.service, request.type, served.handle)
        self._served[request.service] = served

    def _unadvertise_service(self, request: requests.UnadvertiseService) -> None:
        if request.service not in self._served:
            raise BridgeError("unadvertise_service: %s was not advertised" % request.service[:200])
        self._withdraw(request.service)

    def _withdraw(self, service: str) -> None:
        self._served.pop(service).close()
        self._graph.withdraw_service(service)

    def _service_response(self, request: requests.ServiceResponse) -> None:
        served = self._served.get(request.service)
        if served is None or not served.answer(request.id, request.values, request.result):
            raise BridgeError("service_response: no call of %s with id %r waits" % (
                request.service[:200], request.id))

    # ---- the connection ----------------------------------------------------------------------------------------

    def _set_level(self, request: requests.SetLevel) -> None:
        if request.level not in LEVELS:
            raise BridgeError("set_level: level is %r; expected %s" % (request.level[:60], ", ".join(LEVELS)))
        self._level = LEVELS.index(request.level)

    def _fragment(self, request: requests.Fragment) -> None:
        text = self._parts.add(request, self._clock())
        if text is not None:
            whole = requests.read(text)
            if isinstance(whole, requests.Fragment):
                raise BridgeError("fragment: the parts make another fragment; expected a message")
            self._operations[type(whole)](whole)


def _id_of(message: Frame) -> requests.Id:
    """Return the id of a message that is no request, as far as it can be read."""
    found = requests.head(message).id
    return found if isinstance(found, (str, int)) else None


def _depth(wanted: Optional[int]) -> int:
    """Return the messages that wait for a subscriber."""
    return QUEUE if wanted is None or wanted < 1 else min(wanted, 10 * QUEUE)
