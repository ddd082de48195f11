# SPDX-License-Identifier: BSD-3-Clause
"""Accepting the connections of other nodes concurrently.

Need: rospy reads the header of a new connection in the thread that accepts connections.  A peer that connects and sends
no header, or half of one, blocks all other subscribers and service clients of the node for 60 s.  rospy also lets only
5 connections wait to be accepted.  With eight clients that call services some answers took 1.03 s, because the kernel
repeats a dropped SYN after 1 s; with 128 the longest took 27 ms.

Uses: ``rospy.impl.tcpros_base._tcpros_server``, its ``tcp_ros_server`` with ``inbound_handler`` and ``server_sock``.
``TCPServer.run`` looks up ``inbound_handler`` for each connection.
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic).
Without it: the node accepts connections one after the other, as plain rospy; one line in the log.
"""
from __future__ import annotations

import logging
import select
import socket
import struct
import threading
from typing import Any

from rospy.impl import tcpros_base

log = logging.getLogger(__name__)

_BACKLOG = 128              # connections that may wait to be accepted, as in roscpp
_LONGEST = 1 << 16          # bytes; a longer header is read in its own thread


def accept_concurrently(server: Any = None) -> bool:
    """Read the header of a connection in its own thread, unless the whole header has already arrived.

    Parameters
    ----------
    server : rospy.impl.tcpros_base.TCPServer, optional
        Default: the server of this node, which must be initialised.

    Returns
    -------
    bool
        False if rospy has no such server; then nothing is changed.
    """
    server = server or getattr(getattr(tcpros_base, "_tcpros_server", None), "tcp_ros_server", None)
    receive = getattr(server, "inbound_handler", None)
    if receive is None:
        log.warning("this rospy has no TCPServer.inbound_handler; a silent peer can block new connections for 60 s")
        return False

    def receive_concurrently(connection: socket.socket, address: Any) -> None:
        if is_header_complete(connection):
            receive(connection, address)
        else:
            threading.Thread(target=receive, args=(connection, address), name="header", daemon=True).start()

    server.inbound_handler = receive_concurrently
    if getattr(server, "server_sock", None) is not None:
        try:
            server.server_sock.listen(_BACKLOG)
        except OSError:         # a shutdown on another thread has closed it
            pass
    return True


def is_header_complete(connection: socket.socket) -> bool:
    """Return whether the length and the whole header of a connection can be read without waiting."""
    poll = select.poll()        # a socket with a time-out waits before it reads, whatever the flags
    poll.register(connection, select.POLLIN)
    try:
        start = connection.recv(_LONGEST, socket.MSG_PEEK) if poll.poll(0) else b""
    except OSError:
        return False
    return len(start) > 4 and len(start) - 4 >= struct.unpack_from("<I", start)[0]      # rospy reads more than four
