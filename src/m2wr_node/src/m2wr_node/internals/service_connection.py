# SPDX-License-Identifier: BSD-3-Clause
"""A lasting connection to a service that is made within a limited time.

Need: ``rospy.ServiceProxy`` connects and reads the header without a time limit.  A call to a server that never accepted
the connection, for instance because its queue (5 with plain rospy) was full, was still waiting after 300 s, and in
lockstep simulated time waits with it.  Here the connection is made again after 1.5 s.

Uses: ``ServiceProxy.transport``, ``.protocol``, ``.buff_size``; ``TCPROSTransport`` with ``set_socket``,
``write_header`` and ``read_header``; ``rospy.core.parse_rosrpc_uri``.
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic).
Without it: the proxy connects by itself, as plain rospy; one line in the log.
"""
from __future__ import annotations

import logging
import select
import socket
from typing import Any

import rosgraph
import rospy
from rospy.impl import tcpros_base

log = logging.getLogger(__name__)

ANSWERED = 1.5      # s of wall time in which a server has to accept a connection and answer its header
TRIES = 6           # connections that are made until one is answered


def connect(proxy: Any) -> None:
    """Connect a persistent service proxy, unless it is connected.

    Parameters
    ----------
    proxy : rospy.ServiceProxy
        Made with ``persistent=True``.

    Raises
    ------
    socket.timeout
        If the server has accepted none of :data:`TRIES` connections.
    OSError, rosgraph.MasterException, rospy.ROSException
        If there is no such server, or it refuses.
    """
    if getattr(proxy, "transport", None) is not None:
        return
    transport_class = getattr(tcpros_base, "TCPROSTransport", None)
    parse = getattr(rospy.core, "parse_rosrpc_uri", None)
    if transport_class is None or parse is None or not hasattr(proxy, "transport"):
        log.warning("this rospy has no TCPROSTransport to connect to %s with; it connects without a time limit",
                    proxy.resolved_name)
        return
    late = socket.timeout()
    for _ in range(TRIES):
        transport = transport_class(proxy.protocol, proxy.resolved_name)
        transport.buff_size = proxy.buff_size
        try:
            uri = rosgraph.Master(rospy.get_name()).lookupService(proxy.resolved_name)
            _handshake(transport, uri, socket.create_connection(parse(uri), ANSWERED))
            proxy.transport = transport
            return
        except socket.timeout as error:
            transport.close()
            late = error
            log.warning("%s has not accepted a connection within %g s; connecting again", proxy.resolved_name, ANSWERED)
        except Exception:
            transport.close()
            raise
    raise late


def _handshake(transport: Any, uri: str, connection: socket.socket) -> None:
    """Exchange the headers of a service connection over a connected socket."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    transport.set_socket(connection, uri)
    transport.write_header()
    waiting = select.poll()             # rospy removes the socket's time-out
    waiting.register(connection, select.POLLIN)
    if not waiting.poll(1e3 * ANSWERED):
        raise socket.timeout("no answer within %g s" % ANSWERED)
    transport.read_header()
