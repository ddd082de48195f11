# SPDX-License-Identifier: BSD-3-Clause
"""Calls of services without a node.

A command that makes one call need not register with the master, serve XML-RPC and subscribe to the clock. These and the
import of rospy take most of the time of a short command.
"""
import io
import socket
import struct
import time
from typing import Any, List, Optional, Tuple

import rosgraph
import rosgraph.names

from m2wr_sim.errors import SimError

PATIENCE = 5.0              # s of wall time to wait for a service
ANSWER_PATIENCE = 60.0      # s of wall time for an answer: the step ends first, and the machine may be overloaded
_LOOK = 0.05                # s between two queries of the master
_LARGEST = 1 << 26          # bytes of an answer


class CallError(SimError):
    """A service is missing, does not answer or reports an error; one sentence."""


class Connection:
    """A persistent connection to a service; call it with the fields of the request.

    Parameters
    ----------
    service : str
        Name of the service; relative ones are in the namespace of the environment.
    kind : type
        Service class, as of ``gazebo_msgs.srv``.
    patience : float
        Wall time to wait for the service to appear [s].

    Raises
    ------
    CallError
        If the service is missing; also raised by a call that fails.
    """

    def __init__(self, service: str, kind: Any, patience: float = PATIENCE) -> None:
        self._kind = kind
        caller = rosgraph.names.make_caller_id("m2wr_command")
        self._service = rosgraph.names.resolve_name(service, caller)
        try:
            self._socket = socket.create_connection(self._address(caller, patience), patience)
            self._socket.settimeout(ANSWER_PATIENCE)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._shake_hands(caller)
        except OSError as error:
            raise CallError("service %s does not answer: %s" % (self._service, error)) from error

    def _address(self, caller: str, patience: float) -> Tuple[str, int]:
        """Return (host, port) of the service when the master knows it."""
        master, end = rosgraph.Master(caller), time.monotonic() + patience
        while True:
            try:
                uri = master.lookupService(self._service)
                break
            except rosgraph.MasterException:
                if time.monotonic() >= end:
                    raise CallError("no service %s within %g s" % (self._service, patience)) from None
            time.sleep(_LOOK)
        try:
            host, port = uri[len("rosrpc://"):].rsplit(":", 1)
            return host, int(port)
        except ValueError:
            raise CallError("the master gives %r as address of service %s; expected rosrpc://HOST:PORT" % (
                uri, self._service)) from None

    def _shake_hands(self, caller: str) -> None:
        fields = {"callerid": caller, "service": self._service, "md5sum": self._kind._md5sum, "persistent": "1"}
        lines = [("%s=%s" % field).encode() for field in fields.items()]
        header = b"".join(struct.pack("<I", len(line)) + line for line in lines)
        self._socket.sendall(struct.pack("<I", len(header)) + header)
        answer = self._read_block()
        while len(answer) >= 4:
            size, = struct.unpack("<I", answer[:4])
            name, _, value = answer[4:4 + size].partition(b"=")
            if name == b"error":
                raise CallError("service %s refuses: %s" % (self._service, value.decode("utf-8", "replace")))
            answer = answer[4 + size:]

    def _read(self, size: int) -> bytes:
        parts = []
        while size:
            part = self._socket.recv(min(size, 1 << 16))
            if not part:
                raise OSError("it closed the connection")
            parts.append(part)
            size -= len(part)
        return b"".join(parts)

    def _read_block(self) -> bytes:
        size, = struct.unpack("<I", self._read(4))
        if size > _LARGEST:
            raise OSError("it sends %d bytes; expected at most %d" % (size, _LARGEST))
        return self._read(size)

    def __call__(self, *fields: Any) -> Any:
        """Return the response to a request of these fields."""
        body = io.BytesIO()
        self._kind._request_class(*fields).serialize(body)
        try:
            self._socket.sendall(struct.pack("<I", body.tell()) + body.getvalue())
            good, text = self._read(1), self._read_block()
        except OSError as error:
            raise CallError("service %s does not answer: %s" % (self._service, error)) from error
        if good != b"\x01":
            raise CallError("service %s: %s" % (self._service, text.decode("utf-8", "replace")))
        return self._kind._response_class().deserialize(text)

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def without_remappings(words: List[str]) -> List[str]:
    """Return a command line without the remappings of roslaunch (``name:=value``)."""
    return [word for word in words if ":=" not in word]


def no_master() -> Optional[str]:
    """Return a sentence if no master answers, else None."""
    if rosgraph.is_master_online():
        return None
    return ("no ROS master at %s: start a simulation first, for example with \"roslaunch m2wr_sim bug2.launch\", or "
            "set ROS_MASTER_URI" % rosgraph.get_master_uri())
