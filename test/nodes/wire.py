# SPDX-License-Identifier: BSD-3-Clause
"""Subscribers over plain TCPROS sockets: cheap enough for ten of them to subscribe to a simulation at full speed."""
import socket
import struct
import threading
import time
import xmlrpc.client

_PATIENCE = 20.0            # s of wall time for the other side to answer
_PAUSE = 0.2                # s of wall time between two attempts to reach a publisher
_LARGEST = 1 << 26          # bytes of a message; a larger length is wrong


class WireError(Exception):
    """A publisher cannot be reached, or does not follow the protocol."""


def header(**fields):
    """Return a TCPROS connection header."""
    parts = [("%s=%s" % pair).encode() for pair in sorted(fields.items())]
    body = b"".join(struct.pack("<I", len(part)) + part for part in parts)
    return struct.pack("<I", len(body)) + body


def read_exactly(stream, size):
    """Return ``size`` bytes of a socket; WireError if it ends earlier."""
    pieces, left = [], size
    while left:
        piece = stream.recv(min(left, 1 << 16))
        if not piece:
            raise WireError("the connection was closed")
        pieces.append(piece)
        left -= len(piece)
    return b"".join(pieces)


def read_framed(stream):
    """Read a length and return that many bytes."""
    size = struct.unpack("<I", read_exactly(stream, 4))[0]
    if size > _LARGEST:
        raise WireError("a length of %d bytes" % size)
    return read_exactly(stream, size)


def connect(master, topic, publisher, caller="/soak", kind="*", md5="*"):
    """Return a socket that receives the messages of ``topic`` from the node ``publisher``."""
    code, text, uri = xmlrpc.client.ServerProxy(master).lookupNode(caller, publisher)
    if code != 1:
        raise WireError("%s: %s" % (publisher, text))
    code, text, protocol = xmlrpc.client.ServerProxy(uri).requestTopic(caller, topic, [["TCPROS"]])
    if code != 1 or not protocol:
        raise WireError("%s of %s: %s" % (topic, publisher, text))
    stream = socket.create_connection((protocol[1], protocol[2]), _PATIENCE)
    try:
        stream.sendall(header(callerid=caller, topic=topic, type=kind, md5sum=md5, tcp_nodelay="1"))
        answer = read_framed(stream)
        if b"error=" in answer:
            raise WireError("%s: %s" % (topic, answer))
    except BaseException:
        stream.close()
        raise
    return stream


class Listener(threading.Thread):
    """Hands each message of a topic, as bytes, to ``take`` until it is closed; can reconnect."""

    def __init__(self, master, topic, publisher, take, caller):
        super().__init__(daemon=True, name=topic)
        self._where, self._take = (master, topic, publisher, caller), take
        self._closed, self._stream = False, None
        self.messages, self.connections, self.fault = 0, 0, ""

    def run(self):
        while not self._closed:
            try:
                self._stream = connect(*self._where)
                self.connections, self.fault = self.connections + 1, ""
                while not self._closed:
                    self._take(read_framed(self._stream))
                    self.messages += 1
            except (OSError, WireError, xmlrpc.client.Error) as error:
                if not self._closed and self._stream is None:
                    self.fault = "%s: %s" % (self._where[1], error)
                    time.sleep(_PAUSE)
            finally:
                if self._stream is not None:
                    self._stream.close()
                    self._stream = None

    def hang_up(self):
        """Close the connection; the thread reconnects."""
        stream = self._stream
        if stream is not None:
            try:
                stream.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def close(self):
        """End the thread."""
        self._closed = True
        self.hang_up()
