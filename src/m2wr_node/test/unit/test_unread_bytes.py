# SPDX-License-Identifier: BSD-3-Clause
"""What the kernel reports of the receive queues of connections."""
import socket
from types import SimpleNamespace

import pytest

from m2wr_node.internals.unread_bytes import UnreadBytes, find_ends


@pytest.fixture
def pair():
    """A connection over the loopback interface: (writer, reader)."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(1)
        reader = socket.create_connection(server.getsockname())
        writer, _ = server.accept()
    yield writer, reader
    writer.close()
    reader.close()


def ends_of(writer, reader):
    ports = reader.getsockname()[1], writer.getsockname()[1]
    return find_ends({ports})[ports]


def test_the_bytes_that_the_reader_has_not_read(pair):
    writer, reader = pair
    unread, ends = UnreadBytes(), ends_of(*pair)
    assert unread.of(ends) == 0
    writer.sendall(b"x" * 100)
    assert unread.of(ends) == 100
    reader.recv(40)
    assert unread.of(ends) == 60
    reader.recv(100)
    assert unread.of(ends) == 0
    unread.close()


def test_a_closed_connection_is_none(pair):
    writer, reader = pair
    unread, ends = UnreadBytes(), ends_of(*pair)
    reader.close()
    writer.close()
    assert unread.of(ends) is None
    unread.close()


def test_a_late_answer_of_the_kernel_is_not_taken_for_the_next(pair):
    writer, reader = pair
    unread, ends = UnreadBytes(), ends_of(*pair)
    late = []
    given_up = SimpleNamespace(send=unread._netlink.send, recv=lambda size: late[0])       # the answer is not read
    unread._netlink, real = given_up, unread._netlink
    with pytest.raises(IndexError):
        unread.of(ends)
    unread._netlink = real
    writer.sendall(b"x" * 100)
    assert unread.of(ends) == 100
    unread.close()


def test_a_connection_that_does_not_exist_is_not_found(pair):
    assert find_ends({(1, 2)}) == {}
