# SPDX-License-Identifier: BSD-3-Clause
"""The node ``foxglove_bridge``."""
from __future__ import annotations

import logging
import threading
from typing import Any, Dict, List, Set, Tuple

import rosgraph
import rospy
import rosservice

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.foxglove.catalogue import Catalogue
from m2wr_bridge.foxglove.session import FoxgloveSession
from m2wr_bridge.foxglove.wire import SUBPROTOCOL
from m2wr_bridge.messages.received import Received
from m2wr_bridge.ros.bridge_node import BridgeNode, run_node
from m2wr_bridge.ros.foxglove_graph import FoxgloveGraph, fits, patterns
from m2wr_bridge.web.server import Client, Settings

log = logging.getLogger("m2wr_bridge")

PORT = 8765
LOOK = 1.0                  # s between two looks for topics, services and parameters
ORIGINS = "https://app.foxglove.dev file://"    # pages that may connect: Foxglove's, and programs built on Electron
_MOST_COMPLAINTS = 100
_SIMULATED = "/use_sim_time"
#: Parameters of the original that have no effect here.
_WITHOUT_EFFECT = ("send_buffer_limit", "nodelet_manager", "num_threads", "capabilities", "asset_uri_allowlist",
                   "service_type_retrieval_timeout_ms", "use_compression")


class FoxgloveNode(BridgeNode):
    """Serves clients of the Foxglove protocol."""

    def __init__(self) -> None:
        super().__init__(PORT, ORIGINS)
        for name in _WITHOUT_EFFECT:
            if rospy.has_param("~" + name):
                log.warning("parameter ~%s has no effect here", name)
        self._topics, self._services = patterns("topic_whitelist"), patterns("service_whitelist")
        self._graph, self._catalogue = FoxgloveGraph(), Catalogue()
        self._lock = threading.Lock()               # of sessions and catalogue: a new client misses no change
        self._sessions: Set[_Tracked] = set()
        self._types: Dict[str, str] = {}            # of the services that have answered
        self._complaints: Set[str] = set()
        self._values: Dict[str, Any] = {}
        self._shown: Dict[str, Any] = {}
        self._simulated = rospy.get_param(_SIMULATED, False) is True
        self._master = rosgraph.Master(rospy.get_name())

    def run(self) -> None:
        """Serve until ROS ends."""
        server = self.serve(Settings(self.host, self.port, subprotocols=[SUBPROTOCOL], tls=self.tls), self._open,
                            "Foxglove")
        if self._simulated:
            self._graph.subscribe("/clock", "rosgraph_msgs/Clock", self._take_clock)
        while not self.stopping.is_set():
            try:
                self._look()
            except (OSError, rosgraph.MasterException, BridgeError) as error:
                self._complain("the master does not answer: %s" % error)
            except Exception as error:      # of one look; the node and the next looks continue
                self._complain("topics and services could not be read: %s: %s" % (type(error).__name__, error))
            self.stopping.wait(LOOK)
        server.stop()

    def _open(self, client: Client) -> FoxgloveSession:
        session = _Tracked(client, self._graph, self._catalogue, self._simulated)
        session.left = self._forget
        with self._lock:
            session.tell(self._catalogue.everything())
            self._sessions.add(session)
        return session

    def _forget(self, session: "_Tracked") -> None:
        with self._lock:
            self._sessions.discard(session)

    def _take_clock(self, received: Received) -> None:
        with self._lock:
            for session in self._sessions:
                session.tell_time(received)

    def _complain(self, text: str) -> None:
        if text not in self._complaints and len(self._complaints) < _MOST_COMPLAINTS:
            self._complaints.add(text)
            log.warning("%s (said once)", text)

    # ---- what there is -----------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Tell the clients what has changed since the last look."""
        published, subscribed, served = self._master.getSystemState()
        topics = self._find_topics({name for name, _ in published})
        services = self._find_services([name for name, _ in served])
        graph = {"publishedTopics": [{"name": name, "publisherIds": nodes} for name, nodes in published],
                 "subscribedTopics": [{"name": name, "subscriberIds": nodes} for name, nodes in subscribed],
                 "advertisedServices": [{"name": name, "providerIds": nodes} for name, nodes in served]}
        with self._lock:
            changes = self._catalogue.update(topics, services)
            sessions = list(self._sessions)
            for session in sessions:
                session.tell(changes)
        self._tell_graph(sessions, graph)
        self._tell_parameters(sessions)

    def _find_topics(self, published: Set[str]) -> Dict[str, Tuple[str, str]]:
        """Return {topic: (type, definition)} of the published topics that can be read."""
        found = {}
        for topic, type_name in self._master.getTopicTypes():
            if topic not in published or type_name == "*" or not fits(topic, self._topics):  # types outlive topics
                continue
            try:
                found[topic] = (type_name, self._graph.classes.message(type_name)._full_text)
            except BridgeError as error:
                self._complain("topic %s is left out: %s" % (topic, error))
        return found

    def _find_services(self, names: List[str]) -> Dict[str, Tuple[str, str, str]]:
        """Return {service: (type, request, response)} of the services that answer; each is asked once."""
        found = {}
        self._types = {name: value for name, value in self._types.items() if name in names}
        for name in names:
            if not fits(name, self._services):
                continue
            try:
                if name not in self._types:
                    answer = rosservice.get_service_type(name)
                    if not answer:          # it has just ended
                        continue
                    self._types[name] = answer
                kind = self._graph.classes.service(self._types[name])
                found[name] = (kind._type, kind._request_class._full_text, kind._response_class._full_text)
            except Exception as error:      # of one service: what listens at its address may be anything
                self._complain("service %s is left out: %s: %s" % (name, type(error).__name__, error))
        return found

    def _tell_graph(self, sessions: List["_Tracked"], graph: Dict[str, Any]) -> None:
        topics = {one["name"] for key in ("publishedTopics", "subscribedTopics") for one in self._shown.get(key, [])}
        now = {one["name"] for key in ("publishedTopics", "subscribedTopics") for one in graph[key]}
        services = {one["name"] for one in self._shown.get("advertisedServices", [])}
        removed = {"removedTopics": sorted(topics - now),
                   "removedServices": sorted(services - {one["name"] for one in graph["advertisedServices"]})}
        changed = graph != self._shown
        for session in sessions:
            if changed or session.wants_graph and not session.has_graph:
                session.tell_graph(dict(graph, **removed))
                session.has_graph = session.wants_graph
        self._shown = graph

    def _tell_parameters(self, sessions: List["_Tracked"]) -> None:
        """Send watched parameters that have changed."""
        watched = sorted(set().union(*(session.watched for session in sessions)))
        values = self._graph.parameters(watched) if watched else {}
        for session in sessions:
            changed = {name: value for name, value in values.items() if name in session.watched and (
                name not in self._values or self._values[name] != value)}
            if changed:
                session.tell_parameters(changed)
        self._values = values


class _Tracked(FoxgloveSession):
    """A session that says when it ends."""

    left: Any = None
    has_graph = False

    def close(self) -> None:
        """Release topics of the client."""
        if self.left is not None:
            self.left(self)
        super().close()


def main() -> int:
    """Entry point; returns the exit code."""
    return run_node("foxglove_bridge", FoxgloveNode)
