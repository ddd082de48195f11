# SPDX-License-Identifier: BSD-3-Clause
"""An address at which a server can listen, and which program has one that is taken."""
from __future__ import annotations

import glob
import os
import socket
from typing import Optional

FIRST_PORT, PORTS = 8080, 100       # those tried where none is asked for
_LISTENING = "0A"                   # state of a TCP socket in /proc/net/tcp


class AddressError(Exception):
    """An address cannot be used; the text says why, and which program has it."""


def _problem(host: str, port: int) -> Optional[OSError]:
    """Return why an address cannot be listened at, or None."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as attempt:
            attempt.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            attempt.bind((host, port))
            attempt.listen(1)
    except OSError as error:
        return error
    return None


def owner_of(port: int) -> str:
    """Return which program of this machine listens at a TCP port, as far as the system tells."""
    inodes = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        try:
            with open(table, encoding="ascii") as stream:
                rows = [line.split() for line in stream.readlines()[1:]]
        except OSError:
            continue
        inodes |= {row[9] for row in rows if row[3] == _LISTENING and int(row[1].rpartition(":")[2], 16) == port}
    wanted = {"socket:[%s]" % inode for inode in inodes}
    for link in glob.glob("/proc/[0-9]*/fd/*") if wanted else []:
        try:
            if os.readlink(link) in wanted:
                with open(os.path.join(link.rsplit("/fd/", 1)[0], "comm"), encoding="utf-8") as stream:
                    return "%s (process %s)" % (stream.read().strip(), link.split("/")[2])
        except OSError:                 # it has ended, or belongs to another user
            continue
    return "another program"


def free_port(host: str, port: int) -> int:
    """Return a port at which a server can listen.

    Parameters
    ----------
    host : str
        Address to listen at.
    port : int
        0: the first free one from ``FIRST_PORT`` on.

    Raises
    ------
    AddressError
        If the port asked for is taken, or the address is not one of this machine; the text says by whom.
    """
    if not 0 <= port <= 65535:
        raise AddressError("port %d; expected 0 to 65535" % port)
    error: Optional[OSError] = None
    for candidate in [port] if port else range(FIRST_PORT, FIRST_PORT + PORTS):
        error = _problem(host, candidate)
        if error is None:
            return candidate
    if port:
        raise AddressError("address %s:%d cannot be used (%s): %s has it; give another port, or 0 for a free one" % (
            host, port, error and error.strerror or error, owner_of(port)))
    raise AddressError("address %s: %s; expected an address of this machine with a free port from %d to %d" % (
        host, error and error.strerror or error, FIRST_PORT, FIRST_PORT + PORTS - 1))
