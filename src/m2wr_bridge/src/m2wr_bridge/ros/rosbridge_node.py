# SPDX-License-Identifier: BSD-3-Clause
"""The node ``rosbridge_websocket``."""
from __future__ import annotations

import logging
import threading
import time
from typing import Any, Dict

import rospy
from rosbridge_msgs.msg import ConnectedClient, ConnectedClients
from std_msgs.msg import Int32

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.ros import settings
from m2wr_bridge.ros.bridge_node import BridgeNode, run_node
from m2wr_bridge.ros.graph import RosGraph
from m2wr_bridge.rosbridge.globs import Globs
from m2wr_bridge.rosbridge.session import RosbridgeSession, Rules
from m2wr_bridge.web.server import Client, Settings
from m2wr_node.listening import AddressError, free_port

log = logging.getLogger("m2wr_bridge")

PORT = 9090
LARGEST = 10_000_000        # bytes of a message, as in rosbridge
NULL_ORIGIN = "null"        # of pages opened as files, and of frames that a foreign page has locked in
#: Parameters of the original that have no effect here, and the value that says so.
_WITHOUT_EFFECT = {"websocket_external_port": ("None", "", -1), "bson_only_mode": (False,),
                   "binary_encoder": ("default", "")}


def _warn_of_ignored() -> None:
    """Name once what was asked for and is not there."""
    for name, usual in _WITHOUT_EFFECT.items():
        value = rospy.get_param("~" + name, usual[0])
        if value not in usual:
            log.warning("parameter ~%s has no effect here (it is %r)", name, value)


def _wait_for_port(host: str, port: int, pause: float, stopping: threading.Event) -> None:
    """Wait until a port is free; while it is not, say once who has it, and look every ``pause`` s."""
    said = False
    while not stopping.is_set():
        try:
            free_port(host, port)
            return
        except AddressError as error:
            if not pause or "expected" in str(error):
                raise BridgeError(str(error)) from error
            if not said:
                log.warning("%s; looking again every %g s", error, pause)
            said = True
        stopping.wait(pause)


class ClientTopics:
    """Tells who is connected on the topics ``client_count`` and ``connected_clients``; used by one thread only."""

    def __init__(self) -> None:
        self._connected: Dict[Client, Any] = {}
        self._count = rospy.Publisher("client_count", Int32, latch=True, queue_size=10)
        self._clients = rospy.Publisher("connected_clients", ConnectedClients, latch=True, queue_size=10)
        self._publish()

    def change(self, client: Client, here: bool) -> None:
        """Take that a client has come or left.

        Parameters
        ----------
        client : Client
        here : bool
            Whether it has come.
        """
        if here:
            self._connected[client] = ConnectedClient(client.host, rospy.get_rostime())
        else:
            self._connected.pop(client, None)
        self._publish()

    def _publish(self) -> None:
        self._clients.publish(list(self._connected.values()))
        self._count.publish(len(self._connected))


class RosbridgeNode(BridgeNode):
    """Serves clients of rosbridge's protocol."""

    def __init__(self) -> None:
        super().__init__(PORT, "")
        if settings.flag("websocket_null_origin", False):
            self.origins.append(NULL_ORIGIN)
        if settings.flag("authenticate", False):
            raise BridgeError("authenticate is true, and rosauth is not supported; use the parameter ~token, "
                              "with links such as ws://HOST:9090/?token=WORD")
        _warn_of_ignored()
        self._rules = Rules(
            Globs(settings.text("topics_glob", ""), "topics_glob"),
            Globs(settings.text("services_glob", ""), "services_glob"),
            settings.amount("fragment_timeout", 600.0), settings.whole("max_message_size", LARGEST, 1 << 31))
        self._graph = RosGraph(settings.amount("unregister_timeout", 10.0))
        self._client_topics = ClientTopics()

    def _open(self, client: Client) -> RosbridgeSession:
        return RosbridgeSession(client, self._graph, self._rules, self._graph.readers, time.monotonic)

    def run(self) -> None:
        """Serve until ROS ends."""
        ping = settings.amount("websocket_ping_interval", 0.0)
        wanted = Settings(
            self.host, self.port, largest=self._rules.largest,
            pause=settings.amount("delay_between_messages", 0.0, 60.0),
            ping=ping or None, ping_patience=settings.amount("websocket_ping_timeout", 30.0) or None,
            deflate=settings.flag("use_compression", False), tls=self.tls)
        _wait_for_port(self.host, self.port, settings.amount("retry_startup_delay", 5.0), self.stopping)
        if self.stopping.is_set():
            return
        server = self.serve(wanted, self._open, "Rosbridge WebSocket", self._client_topics.change)
        rospy.set_param("~actual_port", server.port)        # as rosbridge does, for programs that asked for port 0
        self.stopping.wait()
        server.stop()


def main() -> int:
    """Entry point; returns the exit code."""
    return run_node("rosbridge_websocket", RosbridgeNode)
