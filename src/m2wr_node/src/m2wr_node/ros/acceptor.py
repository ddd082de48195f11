# SPDX-License-Identifier: BSD-3-Clause
"""Lets the node take in newcomers side by side.

rospy reads what a newcomer says who it is in the very thread that accepts connections.  One that connects and says
nothing, or half of it, keeps everybody else out for a minute: no topic and no service can be had meanwhile.
"""
from __future__ import annotations

import select
import socket
import struct
import threading
from typing import Any

from rospy.impl import tcpros_base

# Connections that may wait to be accepted.  With rospy's 5, some answers to eight clients that call services came after
# 1.0 s, when the kernel repeats the SYN that it has dropped; with 128 the longest took 0.03 s.
_BACKLOG = 128
_LONGEST = 1 << 16          # bytes: a header that is longer is read in a thread of its own too


def accept_side_by_side(server: Any = None) -> bool:
    """Let each newcomer whose header is not there yet speak to a thread of its own.

    Parameters
    ----------
    server : rospy.impl.tcpros_base.TCPServer, optional
        Whose newcomers; those of this node, which must be initialised, where None.

    Returns
    -------
    bool
        False if rospy has no such server, and then all is as it was.
    """
    server = server or getattr(getattr(tcpros_base, "_tcpros_server", None), "tcp_ros_server", None)
    receive = getattr(server, "inbound_handler", None)
    if receive is None:
        return False

    def take_in(connection: socket.socket, address: Any) -> None:
        if header_is_there(connection):
            receive(connection, address)
        else:
            threading.Thread(target=receive, args=(connection, address), name="newcomer", daemon=True).start()

    server.inbound_handler = take_in
    if getattr(server, "server_sock", None) is not None:
        try:
            server.server_sock.listen(_BACKLOG)
        except OSError:         # a shutdown on another thread has closed it
            pass
    return True


def header_is_there(connection: socket.socket) -> bool:
    """Tell whether the whole header of a connection, its length in front, can be read without waiting."""
    poll = select.poll()        # a socket with a time-out waits before it reads, whatever the flags
    poll.register(connection, select.POLLIN)
    try:
        begun = connection.recv(_LONGEST, socket.MSG_PEEK) if poll.poll(0) else b""
    except OSError:
        return False
    return len(begun) > 4 and len(begun) - 4 >= struct.unpack_from("<I", begun)[0]      # rospy reads more than four
