# SPDX-License-Identifier: BSD-3-Clause
"""Whether other processes of this machine have read what was sent to them, asked of the Linux kernel.

A recorder has no way to say that it has taken a message.  The kernel knows, though, how many bytes lie unread in a
socket: when there are none, what is sent from now on will be read later than everything before.
"""
import errno
import socket
import struct
from collections import namedtuple

_NETLINK_SOCK_DIAG, _SOCK_DIAG_BY_FAMILY, _NLMSG_ERROR, _REQUEST = 4, 20, 2, 1
_HEADER, _QUERY, _ADDRESS = struct.Struct("=IHHII"), struct.Struct("=BBBBI"), struct.Struct("!HH16s16s")
_COOKIE = struct.pack("=III", 0, 0xffffffff, 0xffffffff)        # any interface, any cookie
_UNREAD_AT = _HEADER.size + 4 + 48 + 4                          # behind state, identity and timer of inet_diag_msg
_STATE_AT = _HEADER.size + 1
_ESTABLISHED = "01"
_OPEN_STATES = (1, 8)                                           # established; or the publisher alone has closed it

Link = namedtuple("Link", "publisher reader topic ends")
"""A connection on which ``reader`` hears ``publisher``; ``ends`` are (address, port) of reader and publisher."""


def find_ends(pairs):
    """Return the ends of connections of this machine, ``{(reader's port, publisher's port): ends}``, as far as known.

    Parameters
    ----------
    pairs : set of (int, int)
        Ports of the reader and of the publisher.
    """
    found = {}
    try:
        with open("/proc/net/tcp", encoding="ascii") as stream:
            next(stream)
            rows = [line.split()[1:4] for line in stream]
    except OSError:
        return found
    for local, remote, state in rows:
        ends = tuple((bytes.fromhex(address)[::-1], int(port, 16))
                     for address, port in (local.split(":"), remote.split(":")))
        key = (ends[0][1], ends[1][1])
        if state == _ESTABLISHED and key in pairs:
            found[key] = ends
    return found


class UnreadBytes:
    """Asks for single connections, some ten microseconds each.

    Raises
    ------
    OSError
        If this system cannot be asked.
    """

    def __init__(self):
        self._netlink = socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, _NETLINK_SOCK_DIAG)
        self._netlink.settimeout(1.0)
        self._sequence = 0

    def of(self, ends):
        """Return how many bytes the reader has not read; None if the connection is no more.

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
        while _HEADER.unpack_from(answer)[3] != self._sequence:     # a late one, to a query that was given up
            answer = self._netlink.recv(4096)
        if _HEADER.unpack_from(answer)[1] == _NLMSG_ERROR:
            number = -struct.unpack_from("=i", answer, _HEADER.size)[0]
            if number == errno.ENOENT:
                return None
            raise OSError(number, "the kernel does not tell of sockets")
        return struct.unpack_from("=I", answer, _UNREAD_AT)[0] if answer[_STATE_AT] in _OPEN_STATES else None

    def close(self):
        """Ask no more."""
        self._netlink.close()
