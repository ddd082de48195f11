# SPDX-License-Identifier: BSD-3-Clause
"""Peers that send no header do not block other peers."""
import socket
import struct
import threading

import pytest
from rospy.impl.tcpros_base import TCPServer

from m2wr_node.internals.server_acceptor import accept_concurrently, is_header_complete


@pytest.fixture
def server():
    """Return a server as rospy's that reads two bytes of each peer, with what it has read."""
    read, arrived = [], threading.Event()

    def receive(connection, _):
        connection.settimeout(20.0)
        read.append(connection.recv(2))
        arrived.set()

    server = TCPServer(receive)
    server.start()
    server.read, server.arrived = read, arrived
    yield server
    server.shutdown()


def connect(server, data=b""):
    """Return a connection to a server that has sent some bytes."""
    connection = socket.create_connection(("127.0.0.1", server.port), timeout=20.0)
    connection.sendall(data)
    return connection


def test_a_silent_peer_does_not_block_others(server):
    assert accept_concurrently(server)
    silent = [connect(server), connect(server)]
    talker = connect(server, b"hi")
    assert server.arrived.wait(10.0) and server.read == [b"hi"]
    for connection in silent + [talker]:
        connection.close()


def test_twenty_clients_may_wait_to_be_accepted(server):
    """A full queue makes the kernel drop the SYN, which comes again after 1 s."""
    server.server_sock.close()
    listening = server.server_sock = socket.socket()
    listening.bind(("127.0.0.1", 0))
    listening.listen(5)                                 # as rospy does; none is accepted
    accept_concurrently(server)
    waiting = [socket.create_connection(listening.getsockname(), timeout=0.5) for _ in range(20)]
    for connection in waiting + [listening]:
        connection.close()


def test_a_server_that_a_shutdown_has_closed_is_no_error(server):
    server.server_sock.close()
    assert accept_concurrently(server)


def test_a_silent_peer_is_read_when_it_sends(server):
    accept_concurrently(server)
    late = connect(server)
    connect(server, b"on").close()
    assert server.arrived.wait(10.0)
    server.arrived.clear()
    late.sendall(b"at")
    assert server.arrived.wait(10.0) and server.read == [b"on", b"at"]
    late.close()


@pytest.mark.parametrize("sent, whole", [(b"", False), (b"\x05\0\0", False), (b"\x05\0\0\0abcd", False),
                                         (b"\x05\0\0\0abcde", True), (b"\x05\0\0\0abcdefgh", True),
                                         (struct.pack("<I", 0xffffffff) + b"abc", False), (b"\0\0\0\0", False),
                                         (b"\0\0\0\0x", True)])
def test_a_header_is_complete_when_all_of_it_is(sent, whole):
    here, there = socket.socketpair()
    with here, there:
        here.settimeout(20.0)
        there.sendall(sent)
        assert is_header_complete(here) is whole
        assert here.recv(99) == sent if sent else True      # nothing was taken


def test_a_closed_connection_has_no_header():
    here, there = socket.socketpair()
    there.close()
    with here:
        assert is_header_complete(here) is False


def test_without_a_server_nothing_is_changed():
    assert accept_concurrently(object()) is False
