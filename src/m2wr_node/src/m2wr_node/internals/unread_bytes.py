# SPDX-License-Identifier: BSD-3-Clause
"""How many bytes another process of this machine has not read yet from a TCP connection, asked of the Linux kernel.

Need: a bag that is recorded in lockstep holds the same messages in the same order in every run.  A recorder cannot tell
when it has received a message, but the kernel knows the bytes that are left in its socket.  How often the order
differs without it is not measured yet.

Uses: the columns local_address, rem_address and st of ``/proc/net/tcp`` (proc(5)) to find the two addresses of a
connection, once for each; ``NETLINK_SOCK_DIAG`` (sock_diag(7)) for its receive queue.
Checked: Linux 6.18; both are documented kernel interfaces.
Without it: connections are not found, or OSError; the caller continues without waiting, with one line in the log.
"""
from __future__ import annotations

import errno
import socket
import struct
from typing import Collection, Dict, Optional, Tuple

_NETLINK_SOCK_DIAG, _SOCK_DIAG_BY_FAMILY, _NLMSG_ERROR, _REQUEST = 4, 20, 2, 1
_HEADER, _QUERY, _ADDRESS = struct.Struct("=IHHII"), struct.Struct("=BBBBI"), struct.Struct("!HH16s16s")
_COOKIE = struct.pack("=III", 0, 0xffffffff, 0xffffffff)        # any interface, any cookie
_UNREAD_AT = _HEADER.size + 4 + 48 + 4                          # behind state, identity and timer of inet_diag_msg
_STATE_AT = _HEADER.size + 1
_ESTABLISHED = "01"
_OPEN_STATES = (1, 8)                                           # established; or the publisher alone has closed it

Address = Tuple[bytes, int]                                     # IPv4 address in network order, port
Ends = Tuple[Address, Address]                                  # of the reader and of the publisher


def find_ends(pairs: Collection[Tuple[int, int]]) -> Dict[Tuple[int, int], Ends]:
    """Return the ends of this machine's connections as ``{(reader's port, publisher's port): ends}``, where known.

    Parameters
    ----------
    pairs : set of (int, int)
        Ports of the reader and of the publisher.
    """
    found: Dict[Tuple[int, int], Ends] = {}
    try:
        with open("/proc/net/tcp", encoding="ascii") as stream:
            next(stream)
            rows = [line.split()[1:4] for line in stream]
    except OSError:
        return found
    for local, remote, state in rows:
        ends = (_read_address(local), _read_address(remote))
        key = (ends[0][1], ends[1][1])
        if state == _ESTABLISHED and key in pairs:
            found[key] = ends
    return found


def _read_address(text: str) -> Address:
    """Return an address of /proc/net/tcp, ``0100007F:2C2F``; the kernel writes it in the byte order of the machine."""
    address, port = text.split(":")
    return bytes.fromhex(address)[::-1], int(port, 16)


class UnreadBytes:
    """Asks for the unread bytes of single connections.

    Raises
    ------
    OSError
        If this system cannot be asked.
    """

    def __init__(self) -> None:
        self._netlink = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, _NETLINK_SOCK_DIAG)
        self._netlink.settimeout(1.0)
        self._sequence = 0

    def of(self, ends: Ends) -> Optional[int]:
        """Return how many bytes the reader has not read; None if the connection is closed.

        Raises
        ------
        OSError
            If the kernel does not answer, or refuses.
        """
        (own, own_port), (peer, peer_port) = ends
        query = (_QUERY.pack(socket.AF_INET, socket.IPPROTO_TCP, 0, 0, 0xffffffff)
                 + _ADDRESS.pack(own_port, peer_port, own.ljust(16, b"\0"), peer.ljust(16, b"\0")) + _COOKIE)
        self._sequence = (self._sequence + 1) & 0xffffffff
        self._netlink.send(_HEADER.pack(_HEADER.size + len(query), _SOCK_DIAG_BY_FAMILY, _REQUEST, self._sequence, 0)
                           + query)
        answer = self._netlink.recv(4096)
        while _HEADER.unpack_from(answer)[3] != self._sequence:     # the answer to an earlier query that timed out
            answer = self._netlink.recv(4096)
        if _HEADER.unpack_from(answer)[1] == _NLMSG_ERROR:
            number = -struct.unpack_from("=i", answer, _HEADER.size)[0]
            if number == errno.ENOENT:
                return None
            raise OSError(number, "the kernel refuses information on sockets")
        return struct.unpack_from("=I", answer, _UNREAD_AT)[0] if answer[_STATE_AT] in _OPEN_STATES else None

    def close(self) -> None:
        """Close the socket to the kernel."""
        self._netlink.close()
