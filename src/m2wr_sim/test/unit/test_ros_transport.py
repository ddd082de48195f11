# SPDX-License-Identifier: BSD-3-Clause
"""Messages to subscribers over real sockets and rospy's own connections, without a master."""
import gc
import logging
import os
import queue
import socket
import struct
import threading
import time
from unittest import mock

import pytest
import rospy
from rosgraph_msgs.msg import Clock
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSPub
from rospy.impl.transport import Transport
from rospy.topics import _PublisherImpl
from sensor_msgs.msg import JointState

from m2wr_node.internals import subscriber_connections, subscriber_link
from m2wr_node.internals.subscriber_connections import Channels, Dropped
from m2wr_node.internals.subscriber_link import Link
from m2wr_sim.ros import ports
from m2wr_sim.ros.serialise import serialiser_of

PATIENCE = 30.0
BIG = 2000                              # names in a message that fills buffers quickly
MANY = 1000                             # such messages are 10 MB, of which the system's buffers may take up 4


def channel_of(impl):
    return subscriber_connections.Channel(impl, serialiser_of(impl.data_class))


def wait_until(condition, what):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "waited %g s for %s" % (PATIENCE, what)
        time.sleep(0.002)


class Peer:
    """A subscriber: the far end of a connection."""

    def __init__(self, impl, name="/peer"):
        with socket.socket() as listener:
            listener.bind(("127.0.0.1", 0))
            listener.listen(1)
            self.socket = socket.socket()
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
            self.socket.connect(listener.getsockname())
            near, _ = listener.accept()
        near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 8192)
        self.socket.settimeout(PATIENCE)
        self.transport = TCPROSTransport(TCPROSPub(impl.resolved_name, impl.data_class), impl.resolved_name)
        self.transport.set_socket(near, name)
        impl.add_connection(self.transport)

    def read(self, size):
        data = b""
        while len(data) < size:
            more = self.socket.recv(size - len(data))
            assert more, "the connection ended after %d of %d bytes" % (len(data), size)
            data += more
        return data

    def read_message(self):
        return self.read(struct.unpack("<I", self.read(4))[0])

    def read_seqs(self, last):
        """Read messages up to the one with the number ``last``; returns all numbers."""
        seqs = []
        while not seqs or seqs[-1] != last:
            message = JointState().deserialize(self.read_message())
            assert message.name == ["n"] * BIG and message.position == ()      # nothing is torn
            seqs.append(message.header.seq)
        return seqs

    def close(self):
        self.socket.close()


@pytest.fixture
def impl():
    made = _PublisherImpl("/topic", JointState)
    yield made
    made.close()


@pytest.fixture
def peers(impl):
    made = []

    def connect(name="/peer"):
        made.append(Peer(impl, name))
        return made[-1]

    yield connect
    for peer in made:
        peer.close()


@pytest.fixture
def channel(impl):
    return channel_of(impl)


def big():
    return JointState(name=["n"] * BIG)


def test_without_subscribers_nothing_is_counted(impl, channel):
    channel.publish(big())
    assert not channel.connected() and impl.seq == 0 and channel.dropped() == []


def test_everyone_gets_everything_in_order(impl, channel, peers):
    one, two = peers("/one"), peers("/two")
    assert channel.connected()
    for index in range(5):
        channel.publish(JointState(name=[str(index)]))
    for peer in (one, two):
        read = [JointState().deserialize(peer.read_message()) for _ in range(5)]
        assert [message.name[0] for message in read] == list("01234")
        assert [message.header.seq for message in read] == [1, 2, 3, 4, 5]
    topic, sent, connections = impl.get_stats()
    assert (topic, sent) == ("/topic", 5 * 41)
    assert [entry[1:] for entry in connections] == [(5 * 41, 5, True)] * 2
    assert {entry[1] for entry in impl.get_stats_info()} == {"/one", "/two"}


def test_no_thread_is_started_for_a_subscriber(channel, peers):
    before = threading.active_count()
    for index in range(5):
        peers("/peer%d" % index)
    channel.publish(big())
    assert threading.active_count() <= before + 1       # the one that drains


def test_a_slow_subscriber_delays_no_other_and_loses_the_oldest(channel, peers, monkeypatch, caplog):
    monkeypatch.setattr(subscriber_link, "BACKLOG_MESSAGES", 50)
    stuck, healthy = peers("/stuck"), peers("/healthy")
    seen = []
    reader = threading.Thread(target=lambda: seen.extend(healthy.read_seqs(MANY)), daemon=True)
    reader.start()
    with caplog.at_level(logging.WARNING, subscriber_link.__name__):
        for _ in range(MANY):
            channel.publish(big())      # would never come back if it waited for the stuck one
            wait_until(lambda: not channel._links[1].waiting, "the healthy one to be served")
    reader.join(PATIENCE)
    assert seen == list(range(1, MANY + 1))
    lost, = channel.dropped()
    assert (lost.topic, lost.peer) == ("/topic", "/stuck") and lost.messages > 300
    assert len([entry for entry in caplog.records if "/stuck does not read /topic" in entry.getMessage()]) == 1
    got = stuck.read_seqs(MANY)                         # whole messages: what was begun, then the newest
    assert got == sorted(set(got)) and got[-50:] == list(range(MANY - 49, MANY + 1)) and got[0] == 1
    assert len(got) == MANY - lost.messages
    wait_until(lambda: not channel._links[0].waiting, "the backlog to be gone")
    channel.publish(big())
    assert stuck.read_seqs(MANY + 1) == [MANY + 1] and channel.dropped() == [lost]


def test_a_backlog_is_bounded_in_bytes_too(channel, peers, monkeypatch):
    monkeypatch.setattr(subscriber_link, "BACKLOG_BYTES", 100000)
    peers()
    for _ in range(200):
        channel.publish(big())
    link, = channel._links
    assert link._bytes <= 100000 and link._bytes == sum(map(len, link._backlog))


def test_a_backlog_goes_out_without_further_messages(channel, peers):
    peer = peers()
    for _ in range(100):
        channel.publish(big())
    assert channel._links[0].waiting
    assert peer.read_seqs(100) == list(range(1, 101))
    wait_until(lambda: not channel._links[0].waiting, "the backlog to be gone")
    assert channel._links[0].stat_num_msg == 100


def test_it_says_so_again_only_after_a_recovery_and_a_while(channel, peers, monkeypatch, caplog):
    monkeypatch.setattr(subscriber_link, "BACKLOG_MESSAGES", 1)
    peer, total = peers(), 0
    for quiet, lines in ((10.0, 1), (10.0, 1), (0.0, 2)):
        monkeypatch.setattr(subscriber_link, "_QUIET", quiet)
        for _ in range(100):
            total += 1
            channel.publish(big())
        assert len([entry for entry in caplog.records if "does not read" in entry.getMessage()]) == lines
        peer.read_seqs(total)
        wait_until(lambda: not channel._links[0].waiting, "the backlog to be gone")


def test_who_leaves_is_forgotten_and_his_losses_are_not(impl, channel, peers, monkeypatch):
    monkeypatch.setattr(subscriber_link, "BACKLOG_MESSAGES", 5)
    leaver, stayer = peers("/leaver"), peers("/stayer")
    for index in range(100):
        channel.publish(big())
        stayer.read_message()
    count, = [entry.messages for entry in channel.dropped()]
    leaver.close()

    def left():
        channel.publish(big())
        stayer.read_message()
        return len(impl.connections) == 1
    wait_until(left, "the closed connection to be noticed")
    assert [link.endpoint_id for link in impl.connections] == ["/stayer"] and channel.connected()
    (topic, peer, gone), = channel.dropped()
    assert (topic, peer) == ("/topic", "") and gone >= count > 0


def test_the_death_of_a_stuck_peer_is_noticed(impl, channel, peers):
    peer = peers()
    for _ in range(100):
        channel.publish(big())
    assert channel._links[0].waiting
    peer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    peer.close()                                        # resets the connection, as the death of a process does
    wait_until(lambda: not impl.connections, "the connection to go")
    channel.publish(big())                              # no subscriber


def test_a_connection_that_goes_takes_its_backlog_along(impl, channel, peers):
    peers()
    for _ in range(100):
        channel.publish(big())
    link = channel._links[0]
    impl.connections[0].close()                         # as rospy does when the same subscriber connects again
    assert not impl.connections and not link._backlog and link._bytes == 0
    assert link not in subscriber_link._drain._links.values()
    channel.publish(big())
    assert link not in channel._links


def test_the_same_subscriber_again_replaces_its_old_connection(impl, channel, peers):
    old = peers("/same")
    channel.publish(big())
    new = peers("/same")
    channel.publish(big())
    assert [connection.endpoint_id for connection in impl.connections] == ["/same"]
    assert new.read_seqs(2) == [2] and old.read_seqs(1) == [1]


def test_subscribers_come_and_go_while_messages_go_out(impl, channel, monkeypatch):
    monkeypatch.setattr(subscriber_link, "BACKLOG_MESSAGES", 10)
    steady, faults, ended = Peer(impl, "/steady"), [], threading.Event()
    seen = []
    reader = threading.Thread(target=lambda: seen.extend(steady.read_seqs(10 ** 6)), daemon=True)

    def come_and_go(name):
        try:
            for index in range(40):
                peer = Peer(impl, "%s_%d" % (name, index % 3))
                if index % 2:
                    peer.socket.settimeout(0.05)
                    try:
                        peer.read_message()
                    except (OSError, AssertionError):
                        pass
                peer.close()
        except Exception as error:
            faults.append(error)
        finally:
            ended.set()

    threads = [threading.Thread(target=come_and_go, args=("/guest%d" % index,)) for index in range(3)]
    reader.start()
    for thread in threads:
        thread.start()
    link = None
    while any(thread.is_alive() for thread in threads):
        channel.publish(big())
        link = link or next(link for link in channel._links if link.endpoint_id == "/steady")
        wait_until(lambda: not link.waiting, "the steady one to be served")
    wait_until(lambda: channel.publish(big()) or len(impl.connections) == 1, "all guests to be gone")
    impl.seq = 10 ** 6 - 1
    wait_until(lambda: not link.waiting, "the steady one to be served")
    channel.publish(big())
    reader.join(PATIENCE)
    assert not faults and seen and seen[-1] == 10 ** 6 and not link.dropped
    assert seen[:-1] == list(range(seen[0], seen[-2] + 1))      # nothing was lost or torn
    steady.close()


@pytest.fixture(params=["ours", "another publisher's"])
def latched(request, impl, channel):
    """The channel, latched by itself or because another publisher of the topic has asked rospy for it."""
    channel.latch() if request.param == "ours" else impl.enable_latch()
    return channel


def test_a_late_subscriber_of_a_latched_topic_gets_the_last(impl, latched, peers):
    for name in ("old", "kept"):
        latched.publish(JointState(name=[name]))
    early = peers("/early")
    assert JointState().deserialize(early.read_message()).name == ["kept"]
    latched.publish(JointState(name=["new"]))
    late = peers("/late")
    for peer in (early, late):
        assert JointState().deserialize(peer.read_message()).name == ["new"]
    assert impl.headers == {"latching": "1"} and all(isinstance(link, Link) for link in impl.connections)
    latched.publish(JointState(name=["newest"]))
    for peer in (early, late):              # no subscriber received a message twice
        assert JointState().deserialize(peer.read_message()).name == ["newest"]


def test_a_slow_subscriber_of_a_latched_topic_delays_no_other(impl, latched, peers):
    names = {"first": ["first"] * 200000, "second": ["second"] * 200000, "third": ["third"]}
    latched.publish(JointState(name=names["first"]))
    made = []

    def come():
        made.append(peers())

    def go_on():
        for name in ("second", "third"):
            latched.publish(JointState(name=names[name]))

    for what, step in (("accepting", come), ("publishing", go_on)):
        thread = threading.Thread(target=step, daemon=True)
        thread.start()
        thread.join(PATIENCE)
        assert not thread.is_alive(), "%s waits for a subscriber that does not read" % what
    assert latched._links[0].waiting
    for name in ("first", "second", "third"):           # whole messages in their order
        assert JointState().deserialize(made[0].read_message()).name == names[name]


def test_a_message_while_rospy_accepts_a_peer_stays_whole(impl, latched, peers):
    class Publishes(rospy.SubscribeListener):
        def peer_subscribe(self, *_):
            latched.publish(JointState(name=["second"] * 200000))

    latched.publish(JointState(name=["first"] * 200000))
    impl.subscriber_listeners.insert(0, Publishes())    # before the last message is sent to the new peer
    made, read = queue.Queue(), []

    def listen():
        peer = made.get()
        read.extend(JointState().deserialize(peer.read_message()).name[0] for _ in range(2))

    reader = threading.Thread(target=listen, daemon=True)
    reader.start()
    made.put(Peer(impl))
    reader.join(PATIENCE)
    assert read == ["first", "second"]


def test_what_cannot_be_serialised_is_not_kept(latched, peers):
    latched.publish(JointState(name=[7]))
    with pytest.raises(Exception):
        peers("/unlucky")
    latched.publish(JointState(name=["good"]))
    assert JointState().deserialize(peers("/late").read_message()).name == ["good"]


def test_losses_of_a_closed_connection_are_counted(impl, channel, peers, monkeypatch):
    monkeypatch.setattr(subscriber_link, "BACKLOG_MESSAGES", 5)
    peers("/leaver"), peers("/other")
    for _ in range(50):
        channel.publish(big())
    link = channel._links[0]
    lost = link.dropped
    link._connection.set_cleanup_callback(None)         # rospy has closed it and not yet taken it out
    link.close()
    peers("/new_subscriber")
    channel.publish(big())
    assert lost > 0 and ("/topic", "", lost) in channel.dropped()
    impl.remove_connection(link)
    assert [entry for entry in channel.dropped() if entry.peer == ""] == [("/topic", "", lost)]


def test_a_connection_of_another_kind_stays_rospys(impl, channel):
    class Unusual(Transport):
        def __init__(self):
            super().__init__("o", "/topic")
            self.endpoint_id, self.sent = "/unusual", []

        def write_data(self, data):
            if self.sent:
                raise OSError("broken")
            self.sent.append(data)

    unusual = Unusual()
    impl.add_connection(unusual)
    channel.publish(JointState(name=["a"]))
    assert len(unusual.sent) == 1 and impl.connections == [unusual] and channel.dropped() == []
    channel.publish(JointState(name=["b"]))
    assert not impl.connections and unusual.done


def test_a_closed_topic_says_so(impl, channel):
    Peer(impl).close()
    channel.publish(big())
    impl.close()
    with pytest.raises(rospy.ROSException, match="/topic"):
        channel.publish(big())


def test_a_topic_that_closes_does_not_end_the_draining_of_others(channel, peers):
    other = _PublisherImpl("/other", JointState)
    stuck, closing = Peer(other), channel_of(other)
    for _ in range(100):
        closing.publish(big())
    other.subscriber_listeners = None                   # what rospy leaves of a topic that was just closed
    stuck.close()
    wait_until(lambda: stuck.transport.done, "the broken connection to be noticed")
    peer = peers()
    for _ in range(100):
        channel.publish(big())
    assert peer.read_seqs(100) == list(range(1, 101))


def test_a_link_stands_for_its_connection(impl, channel):
    peer = Peer(impl)
    channel.publish(big())
    link, = impl.connections
    assert isinstance(link, Link) and link == peer.transport and link in {peer.transport}
    assert link.fileno() == peer.transport.fileno() and "TCPROS connection" in link.get_transport_info()
    with pytest.raises(AttributeError):
        link.no_such_thing


def test_other_publishers_of_the_node_may_write_to_it(impl, channel):
    peer = Peer(impl)
    channel.publish(JointState(name=["ours"]))
    with impl.publock:
        impl.publish(JointState(name=["rospy's"]))
    assert [JointState().deserialize(peer.read_message()).name[0] for _ in range(2)] == ["ours", "rospy's"]


def test_a_message_costs_little():
    impl = _PublisherImpl("/clock", Clock)
    peer, channel, message, samples = Peer(impl), channel_of(impl), Clock(), []
    for _ in range(200):
        began = time.thread_time()
        channel.publish(message)
        samples.append(time.thread_time() - began)
        peer.read_message()
    assert sorted(samples)[100] < 1e-3                  # a hundred times less on an idle machine
    impl.close()


def test_losses_are_told_by_name():
    assert Dropped("/scan", "/rviz", 3) == ("/scan", "/rviz", 3)


def test_topics_that_come_and_go_leave_no_descriptors(monkeypatch):
    manager = rospy.topics._TopicManager()
    monkeypatch.setattr(rospy.topics, "get_topic_manager", lambda: manager)
    monkeypatch.setattr(rospy.topics, "get_registration_listeners", mock.Mock)
    gc.collect()
    gc.disable()
    try:
        before, kept = len(os.listdir("/proc/self/fd")), []
        channels, mailbox = Channels(serialiser_of), mock.Mock()
        for number in range(20):
            publisher, channel = channels.open("/guest%d" % number, Clock)
            subscription = ports._Subscription("/order%d" % number, Clock, None, mailbox)
            kept.append(channel)
            channels.close(publisher, channel)
            subscription.close()
        assert all(channel.impl.closed for channel in kept)
        assert len(os.listdir("/proc/self/fd")) <= before
    finally:
        gc.enable()
