# SPDX-License-Identifier: BSD-3-Clause
import socket
from unittest import mock

import pytest

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.ros import bridge_node
from m2wr_bridge.web.server import Settings
from m2wr_node.listening import free_port
from m2wr_node.web_access import Access


class Node(bridge_node.BridgeNode):
    def __init__(self):         # without a master
        self.origins = []

    def run(self):
        raise AssertionError("not used")


@pytest.fixture(autouse=True)
def without_parameters(monkeypatch):
    monkeypatch.setattr(bridge_node.settings, "access_of", lambda host, port, origins: Access("", "bridge"))
    monkeypatch.setattr(bridge_node.settings, "link", lambda *_: "")


@pytest.fixture
def taken():
    """Port at which another program listens."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen(1)
        yield other.getsockname()[1]


def serve(port):
    return Node().serve(Settings("127.0.0.1", port), mock.Mock(), "Test")


def test_a_port_that_is_taken_in_between_is_left(monkeypatch, taken):
    found = iter([taken, free_port("127.0.0.1", 0)])
    monkeypatch.setattr(bridge_node, "free_port", lambda host, port: next(found))
    server = serve(0)
    try:
        assert server.port not in (0, taken)
        with socket.create_connection(("127.0.0.1", server.port), 10.0):
            pass
    finally:
        server.stop()


def test_the_search_for_a_free_port_ends(monkeypatch, taken):
    monkeypatch.setattr(bridge_node, "free_port", lambda host, port: taken)
    with pytest.raises(BridgeError, match="127.0.0.1:{} cannot be used".format(taken)):
        serve(0)


def test_a_port_that_was_asked_for_is_not_replaced(taken):
    with pytest.raises(BridgeError, match="give another port"):
        serve(taken)
