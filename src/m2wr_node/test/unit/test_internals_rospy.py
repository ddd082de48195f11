# SPDX-License-Identifier: BSD-3-Clause
"""rospy still has the private parts that m2wr_node.internals uses, and they behave as those files assume.

A failure names the file of ours that has to be revised.
"""
import inspect
import logging
import socket
import threading

import pytest
import rospy
from rospy import core, rostime, topics
from rospy.impl import registration, simtime, tcpros_base, tcpros_service
from std_msgs.msg import String

from m2wr_node.internals import subscriber_connections, subscriber_link
from m2wr_node.internals.connections import published

INTERNALS = "m2wr_node/internals/"
ATTRIBUTES = (
    ("ros_time.py", rostime, ("_rostime_current", "get_rostime_cond", "set_rostime_initialized")),
    ("connections.py", topics, ("get_topic_manager",)),
    ("connections.py", topics._TopicManager, ("get_pub_sub_info", "get_subscriber_impl")),
    ("service_connection.py", core, ("parse_rosrpc_uri",)),
    ("service_connection.py", tcpros_base.TCPROSTransport, ("set_socket", "write_header", "read_header", "close")),
    ("server_acceptor.py", tcpros_base, ("_tcpros_server",)),
    ("server_acceptor.py", tcpros_base.TCPROSServer(), ("tcp_ros_server",)),
    ("registration_shutdown.py", registration, ("is_shutdown",)),
)
SIGNATURES = (
    ("ros_time.py", rostime.set_rostime_initialized, ["val"]),
    ("connections.py", topics._TopicManager.get_subscriber_impl, ["self", "resolved_name"]),
    ("service_connection.py", core.parse_rosrpc_uri, ["uri"]),
    ("service_connection.py", tcpros_base.TCPROSTransport.__init__, ["self", "protocol", "name", "header"]),
    ("service_connection.py", tcpros_base.TCPROSTransport.set_socket, ["self", "sock", "endpoint_id"]),
    ("service_connection.py", tcpros_base.TCPROSTransport.write_header, ["self"]),
    ("service_connection.py", tcpros_base.TCPROSTransport.read_header, ["self"]),
    ("server_acceptor.py", tcpros_base.TCPServer.__init__, ["self", "inbound_handler", "port"]),
    ("server_acceptor.py", tcpros_base.TCPROSServer._tcp_server_callback, ["self", "sock", "client_addr"]),
    ("registration_shutdown.py", registration.is_shutdown, []),
    ("subscriber_connections.py", topics._PublisherImpl.add_headers, ["self", "headers"]),
    ("subscriber_connections.py", topics._PublisherImpl.add_subscriber_listener, ["self", "l"]),
    ("subscriber_connections.py", topics._PublisherImpl.remove_connection, ["self", "c"]),
    ("subscriber_connections.py", rospy.SubscribeListener.peer_subscribe,
     ["self", "topic_name", "topic_publish", "peer_publish"]),
    ("subscriber_link.py", tcpros_base.TCPROSTransport.set_cleanup_callback, ["self", "cleanup_callback"]),
    ("subscriber_link.py", tcpros_base.TCPROSTransport.close, ["self"]),
)


CONNECTIONS, LINK = "subscriber_connections.py", "subscriber_link.py"


def used_by(name):
    """Return the message of a failure."""
    return "rospy has changed; revise %s%s" % (INTERNALS, name)


@pytest.mark.parametrize("file, owner, names", ATTRIBUTES)
def test_the_attributes_exist(file, owner, names):
    missing = [name for name in names if not hasattr(owner, name)]
    assert not missing, "%s: %s" % (used_by(file), missing)


@pytest.mark.parametrize("file, function, arguments", SIGNATURES)
def test_the_signatures_are_as_expected(file, function, arguments):
    assert list(inspect.signature(function).parameters) == arguments, used_by(file)


@pytest.fixture
def topic():
    """The rospy part of a topic that is published, without a master."""
    made = topics._PublisherImpl("/topic", String)
    yield made
    made.close()


@pytest.fixture
def connection():
    """A connection as rospy makes it, with an open socket."""
    near, far = socket.socketpair()
    made = tcpros_base.TCPROSTransport(tcpros_base.TCPROSTransportProtocol("/topic", None), "/topic")
    made.set_socket(near, "/peer")
    yield made
    made.close()
    far.close()


def test_a_topic_has_the_attributes(topic):
    assert subscriber_connections.missing_parts(topic) == [], used_by(CONNECTIONS)
    assert hasattr(topic.connection_poll.poller, "close"), used_by(CONNECTIONS)
    assert "self.impl = " in inspect.getsource(topics.Topic.__init__), used_by(CONNECTIONS)


def test_a_connection_has_the_attributes(connection):
    missing = [name for name in subscriber_link.USED if not hasattr(connection, name)]
    assert not missing, "%s: %s" % (used_by(LINK), missing)


def test_the_list_of_connections_is_replaced_on_change(topic, connection):
    before = topic.connections
    topic.add_connection(connection)
    added = topic.connections
    assert before == [] and added == [connection] and added is not before, used_by(CONNECTIONS)
    topic.remove_connection(connection)
    assert topic.connections == [] and topic.connections is not added, used_by(CONNECTIONS)


def test_a_listener_is_called_when_the_connection_is_listed(topic, connection):
    seen = []

    class Listener(rospy.SubscribeListener):
        """Notes the connections of the topic."""

        def peer_subscribe(self, topic_name, topic_publish, peer_publish):
            seen.append(list(topic.connections))

    topic.add_subscriber_listener(Listener())
    topic.add_connection(connection)
    assert seen == [[connection]], used_by(CONNECTIONS)


def test_a_publisher_without_a_queue_leaves_the_connection(topic, connection):
    assert topic.queue_size is None, used_by(CONNECTIONS)
    topic.add_connection(connection)
    assert topic.connections[0] is connection, used_by(CONNECTIONS)


def test_closing_a_connection_calls_its_callback_once(connection):
    closed = []
    connection.set_cleanup_callback(closed.append)
    assert connection.cleanup_cb == closed.append, used_by(LINK)
    connection.close()
    connection.close()
    assert closed == [connection] and connection.done, used_by(LINK)


def test_ros_time_is_the_module_global(monkeypatch):
    monkeypatch.setattr(rostime, "_rostime_current", rospy.Time(12, 5))
    monkeypatch.setattr(rostime, "_rostime_initialized", True)
    assert rospy.get_rostime() == rospy.Time(12, 5), used_by("ros_time.py")


def test_the_clock_is_subscribed_in_a_module_global():
    assert "_clock_sub = rospy.topics.Subscriber(" in inspect.getsource(simtime.init_simtime), used_by("ros_time.py")


def test_a_sleep_waits_for_the_condition_of_ros_time():
    assert rostime.get_rostime_cond() is rostime.get_rostime_cond(), used_by("ros_time.py")
    assert "get_rostime_cond()" in inspect.getsource(rospy.timer.sleep), used_by("ros_time.py")


def test_a_connection_tells_its_ports():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen(1)
        near = socket.create_connection(listener.getsockname())
        far = listener.accept()[0]
    with far:
        transport = tcpros_base.TCPROSTransport(tcpros_base.TCPROSTransportProtocol("/topic", None), "/topic")
        transport.set_socket(near, "/peer")
        transport.remote_endpoint = near.getpeername()
        entry = [1, "/peer", "o", "TCPROS", "/topic", True, transport.get_transport_info()]
        found, = published("/node", [entry])
        assert found.ports == (near.getpeername()[1], near.getsockname()[1]), used_by("connections.py")
        transport.close()


def test_a_service_proxy_connects_only_without_a_transport():
    assert rospy.ServiceProxy is tcpros_service.ServiceProxy
    source = inspect.getsource(tcpros_service.ServiceProxy.call)
    assert "if self.transport is None:" in source and "transport = self.transport\n" in source, \
        used_by("service_connection.py")
    made = inspect.getsource(tcpros_service.ServiceProxy.__init__)
    assert all("self.%s = " % name in made for name in ("transport", "protocol", "buff_size")), \
        used_by("service_connection.py")


def test_the_server_looks_up_its_handler_for_each_connection():
    started, received = threading.Event(), threading.Event()
    server = tcpros_base.TCPServer(lambda connection, address: (connection.close(), started.set()))
    server.start()
    try:
        socket.create_connection(("127.0.0.1", server.port), timeout=20.0).close()
        assert started.wait(20.0), used_by("server_acceptor.py")
        server.inbound_handler = lambda connection, address: (connection.close(), received.set())
        socket.create_connection(("127.0.0.1", server.port), timeout=20.0).close()
        assert received.wait(20.0), used_by("server_acceptor.py")
        assert isinstance(server.server_sock, socket.socket), used_by("server_acceptor.py")
    finally:
        server.shutdown()


class LostMaster:
    """Every call fails."""

    def __getattr__(self, name):
        raise ConnectionRefusedError(name)


def test_the_registration_asks_the_module_global(monkeypatch):
    monkeypatch.setattr(registration, "is_shutdown", lambda: len(calls) > 0)
    calls, manager = [], registration.RegManager.__new__(registration.RegManager)
    manager.master_uri, manager.uri = "http://127.0.0.1:1", "http://127.0.0.1:2"
    manager.logger = logging.getLogger(__name__)
    monkeypatch.setattr(registration, "xmlrpcapi", lambda uri: calls.append(uri) or LostMaster())
    thread = threading.Thread(target=manager.reg_added, daemon=True,
                              args=("/topic", "std_msgs/String", registration.Registration.PUB))
    thread.start()
    thread.join(20.0)
    assert calls and not thread.is_alive(), used_by("registration_shutdown.py")
    assert "not registered and not is_shutdown()" in inspect.getsource(registration.RegManager.start), \
        used_by("registration_shutdown.py")
