# SPDX-License-Identifier: BSD-3-Clause
"""Subscribers that ask for fewer messages: over a socket pair, without a master."""
import socket
from unittest import mock

import pytest
import rospy
from rospy.impl import tcpros_base, tcpros_pubsub

from m2wr_node.internals import paced_subscription, subscriber_connections, subscriber_link
from m2wr_node.internals.subscriber_connections import Channel
from m2wr_node.internals.subscriber_link import LONGEST_PERIOD, PERIOD_FIELD, period_of


class Transport(tcpros_base.TCPROSTransport):
    """A connection of rospy to the other end of a socket pair."""

    def __init__(self):
        protocol = mock.Mock(buff_size=100, direction=None)
        super().__init__(protocol, "/topic")
        here, self.peer = socket.socketpair()
        self.peer.settimeout(0.0)
        self.set_socket(here, "/viewer")

    def received(self):
        try:
            return self.peer.recv(1000)
        except BlockingIOError:
            return b""


@pytest.fixture
def clock(monkeypatch):
    """The wall time [s] of the channels, as a list with one number."""
    now = [100.0]
    monkeypatch.setattr(subscriber_connections.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def link_up(monkeypatch):
    """A function that returns a channel and its connections, of which the first one asks for the given period [s]."""
    def make(period, others=0):
        connections = [Transport() for _ in range(1 + others)]
        asked = [period] + [0.0] * others
        monkeypatch.setattr(subscriber_link, "_period_asked", lambda _: asked.pop(0))
        impl = mock.Mock(connections=connections, closed=False, is_latch=False, seq=0, message_data_sent=0,
                         c_lock=mock.MagicMock(), resolved_name="/topic")
        made.append(connections)
        return Channel(impl, lambda _, message: message), connections

    made = []
    yield make
    for transport in (entry for connections in made for entry in connections):
        getattr(transport, "_connection", transport).peer.close()
        transport.close()


def test_a_paced_subscriber_gets_fewer_and_others_get_all(clock, link_up):
    channel, (paced, other) = link_up(0.1, others=1)
    for number in range(10):
        channel.publish(b"%d" % number)
        clock[0] += 0.0251
    assert other.received() == b"0123456789" and paced.received() == b"048"
    assert channel.dropped() == []


def test_nothing_is_made_while_no_subscriber_takes_it(clock, link_up):
    channel, _ = link_up(0.1)
    channel.publish(b"first")
    assert channel.connected() and not channel.due()
    channel._serialise = lambda *_: pytest.fail("a message is made that no subscriber takes")
    channel.publish(b"second")
    clock[0] += 0.2
    assert channel.due()


def test_the_newest_message_comes_at_last(clock, link_up):
    channel, (paced,) = link_up(0.1)
    for number in range(3):
        channel.publish(b"%d" % number)
    channel.flush()
    assert paced.received() == b"0"
    clock[0] += 0.2
    channel.flush()
    channel.flush()
    assert paced.received() == b"2"


def test_a_latched_topic_is_not_paced(clock, link_up):
    channel, (paced,) = link_up(0.1)
    channel.latch()
    for number in range(3):
        channel.publish(b"%d" % number)
    assert paced.received() == b"012"


@pytest.mark.parametrize("text, period", [("0.1", 0.1), ("0", 0.0), ("-1", 0.0), ("nan", 0.0), ("inf", 0.0),
                                          (str(2 * LONGEST_PERIOD), 0.0), ("no number", 0.0), (None, 0.0)])
def test_only_a_sensible_period_is_taken(text, period):
    assert period_of({} if text is None else {PERIOD_FIELD: text}) == period


def test_the_wish_is_in_the_header_of_the_subscriber_only(monkeypatch):
    monkeypatch.setattr(tcpros_pubsub.TCPROSSub, "get_header_fields", tcpros_pubsub.TCPROSSub.get_header_fields)
    monkeypatch.setattr(paced_subscription, "_periods", {})
    monkeypatch.setattr(rospy, "Subscriber", mock.Mock())
    paced_subscription.subscribe_paced("/paced", 0.04, rospy.AnyMsg, print)
    fields = {topic: tcpros_pubsub.TCPROSSub(topic, rospy.AnyMsg).get_header_fields() for topic in ("/paced", "/other")}
    assert fields["/paced"][PERIOD_FIELD] == "0.04" and PERIOD_FIELD not in fields["/other"]


def test_the_publisher_reads_the_wish_from_the_header(monkeypatch):
    handled = []
    server = mock.Mock(topic_connection_handler=lambda *parts: handled.append(parts))
    monkeypatch.setattr(tcpros_base, "_tcpros_server", server)
    monkeypatch.setattr(subscriber_link, "_asked", {})
    subscriber_link.read_periods()
    subscriber_link.read_periods()      # once is enough
    server.topic_connection_handler("socket", ("::1", 5), {PERIOD_FIELD: "0.5"})
    server.topic_connection_handler("socket", ("::1", 6), {})
    assert len(handled) == 2 and subscriber_link._asked == {("::1", 5): 0.5}
    assert subscriber_link._period_asked(mock.Mock(getpeername=lambda: ("::1", 5))) == 0.5
    assert subscriber_link._asked == {}
