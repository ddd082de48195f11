# SPDX-License-Identifier: BSD-3-Clause
"""Topics of m2wr_node.internals.subscriber_connections where rospy lacks a private part that it uses."""
import logging
from unittest import mock

import pytest
import rospy
from std_msgs.msg import String

from m2wr_node.internals import subscriber_connections
from m2wr_node.internals.subscriber_connections import Channels, PlainChannel


class Record:
    """Makes a message when it is asked for one."""

    def message(self, message_class):
        return message_class(data="record")


@pytest.fixture
def channels(monkeypatch):
    """Channels over a rospy without a master, whose topics lack an attribute."""
    manager = rospy.topics._TopicManager()
    monkeypatch.setattr(rospy.topics, "get_topic_manager", lambda: manager)
    monkeypatch.setattr(rospy.topics, "get_registration_listeners", mock.Mock)
    monkeypatch.setattr(rospy.topics, "is_initialized", lambda: True)
    monkeypatch.setattr(subscriber_connections, "USED", ("connections", "no_such_part"))
    made = Channels(lambda message_class: pytest.fail("rospy serialises"))
    made.manager = manager
    return made


def test_without_a_private_part_rospy_publishes(channels, caplog):
    with caplog.at_level(logging.WARNING):
        first, channel = channels.open("/first", String)
        channels.open("/second", String)
    assert isinstance(channel, PlainChannel) and not channel.connected() and not channel.impl.connections
    warnings = [record.message for record in caplog.records if record.name == subscriber_connections.__name__]
    assert len(warnings) == 1 and "no_such_part" in warnings[0]
    impl, sent = channels.manager.pubs["/first"], []
    impl.publish = sent.append
    channel.publish(String(data="message"))
    channel.publish(Record())
    assert [message.data for message in sent] == ["message", "record"]
    assert channels.traffic()["/first"] == (2, 0) and channels.dropped() == []


def test_a_plain_topic_latches_and_closes(channels):
    (first, channel), (second, same) = channels.open("/topic", String), channels.open("/topic", String)
    channel.latch()
    impl = channels.manager.pubs["/topic"]
    assert same is channel and impl.is_latch and impl.queue_size == subscriber_connections.PLAIN_QUEUE
    channels.close(first, channel)
    assert not impl.closed and "/topic" in channels.traffic()
    channels.close(second, channel)
    assert impl.closed and channels.traffic() == {}


def test_a_topic_may_lose_a_private_part(channels, monkeypatch):
    monkeypatch.setattr(subscriber_connections, "USED", ("connections",))
    channels._serialiser_of = mock.Mock()
    (first, full), missing = channels.open("/topic", String), ("connections", "no_such_part")
    monkeypatch.setattr(subscriber_connections, "USED", missing)
    second, plain = channels.open("/topic", String)
    assert not isinstance(full, PlainChannel) and isinstance(plain, PlainChannel)
    channels.close(second, plain)
    channels.close(first, full)
    assert channels.traffic() == {}
