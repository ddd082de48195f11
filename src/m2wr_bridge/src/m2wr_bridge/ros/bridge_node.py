# SPDX-License-Identifier: BSD-3-Clause
"""What the nodes of the bridges share: parameters of the connection, the server, start and end."""
from __future__ import annotations

import abc
import logging
import ssl
import threading
from typing import Callable, List, Optional

import rospy

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.ros import settings
from m2wr_bridge.web.server import Client, Session, Settings, WebSocketServer
from m2wr_node.listening import AddressError, free_port
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node

log = logging.getLogger("m2wr_bridge")

TRIES = 10                  # for a free port: another program may take one before the server listens


class BridgeNode(abc.ABC):
    """A node that serves websockets until ROS ends.

    Parameters
    ----------
    port : int
        At which it listens where ~port is not set.
    origins : str
        Pages of other sites that may connect where ~allowed_origins is not set.

    Raises
    ------
    BridgeError
        If a parameter is wrong.
    """

    def __init__(self, port: int, origins: str) -> None:
        self.stopping = threading.Event()
        at_shutdown(self.stopping.set)
        self.host: str = settings.text("address", "127.0.0.1") or "0.0.0.0"
        self.port: int = settings.whole("port", port, 65535)
        self.origins: List[str] = settings.text("allowed_origins", origins).replace(",", " ").split()
        self.tls: Optional[ssl.SSLContext] = settings.tls_of()

    def serve(self, wanted: Settings, open_session: Callable[[Client], Session], title: str,
              changed: Optional[Callable[[Client, bool], None]] = None) -> WebSocketServer:
        """Return a server that is started; its address is logged.

        Parameters
        ----------
        wanted : Settings
            With port 0 it is a free one.
        open_session : callable
            Takes a Client, returns its Session.
        title : str
            Of the server, for the log.
        changed : callable, optional
            Called with a Client after it has come (true) or left (false).

        Raises
        ------
        BridgeError
            If the address cannot be used.
        """
        tries = 1 if wanted.port else TRIES
        while True:
            tries -= 1
            try:
                port = free_port(wanted.host, wanted.port)
                access = settings.access_of(wanted.host, port, self.origins)
                server = WebSocketServer(wanted._replace(port=port), access, open_session, changed)
            except AddressError as error:
                raise BridgeError(str(error)) from error
            except OSError as error:        # another program has taken the port in between
                if tries <= 0:
                    raise BridgeError("address %s:%d cannot be used: %s" % (wanted.host, port, error)) from error
                continue
            log.info("%s server started: %s", title,
                     settings.link("wss" if wanted.tls else "ws", wanted.host, port, access))
            return server

    @abc.abstractmethod
    def run(self) -> None:
        """Serve until ROS ends.

        Raises
        ------
        BridgeError
            If the address cannot be used.
        """


def run_node(name: str, make: Callable[[], BridgeNode]) -> int:
    """Run a node until ROS ends.

    Parameters
    ----------
    name : str
    make : callable
        Returns the node.

    Returns
    -------
    int
        Exit code of the program.
    """
    start_node(name)
    settings.log_through_ros()
    try:
        make().run()
    except BridgeError as error:
        rospy.logfatal("%s: %s", name, error)
        return 1
    return 0
