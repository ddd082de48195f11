# SPDX-License-Identifier: BSD-3-Clause
"""Calls to a controller's service over real sockets, without a master."""
import socket
import struct
import threading
from io import BytesIO
from types import SimpleNamespace

import pytest
from m2wr_lockstep.srv import Turn, TurnResponse
from rosgraph.network import encode_ros_handshake_header, read_ros_handshake_header

from m2wr_lockstep.server.conductor import TurnFailed, TurnRequest
from m2wr_lockstep.server.ros.caller import Caller
from m2wr_node.internals import service_connection


def set_service(monkeypatch, address):
    """Let a master know all services at one address."""
    master = SimpleNamespace(lookupService=lambda name: address)
    monkeypatch.setattr(service_connection.rosgraph, "Master", lambda _: master)


def test_a_connection_that_is_not_accepted_is_made_again(monkeypatch):
    answer = encode_ros_handshake_header({"callerid": "/first", "type": Turn._type, "md5sum": Turn._md5sum})
    seen, said = [], BytesIO()
    TurnResponse(note="here").serialize(said)

    def serve(server):
        silent, _ = server.accept()         # as if it had been lost on its way
        taken, _ = server.accept()
        seen.append(read_ros_handshake_header(taken, BytesIO(), 4096))
        taken.sendall(answer)
        seen.append(struct.unpack("<I", taken.recv(4))[0] > 0)
        taken.sendall(b"\1" + struct.pack("<I", len(said.getvalue())) + said.getvalue())
        silent.close()
        taken.close()

    with socket.create_server(("127.0.0.1", 0)) as server:
        address = "rosrpc://127.0.0.1:%d" % server.getsockname()[1]
        set_service(monkeypatch, address)
        monkeypatch.setattr(service_connection, "ANSWERED", 0.2)
        threading.Thread(target=serve, args=(server,), daemon=True).start()
        came = threading.Event()
        caller = Caller("/first", came.set)
        pending = caller.ask(TurnRequest(1, 0, 0, {}))
        assert came.wait(20.0) and pending.result().note == "here" and caller.idle()
        caller.close()
    assert seen[0]["service"] == "/first/lockstep_turn" and seen[0]["persistent"] == "1" and seen[1]


def test_a_controller_that_is_gone_is_not_waited_for(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = "rosrpc://127.0.0.1:%d" % server.getsockname()[1]
    set_service(monkeypatch, address)
    came = threading.Event()
    caller = Caller("/first", came.set)
    pending = caller.ask(TurnRequest(1, 0, 0, {}))
    assert came.wait(20.0)
    with pytest.raises(TurnFailed, match="refused"):
        pending.result()
    caller.close()
