# SPDX-License-Identifier: BSD-3-Clause
"""Publishing to subscribers without a thread for each, and without waiting for any of them.

rospy registers the topics, accepts subscribers and counts messages.  The publishing thread serialises a message once
and passes it to the kernel.  What the kernel does not accept at once waits in a bounded backlog of that connection,
which one thread sends when the peer reads again.

Need: rospy either passes each message to a thread per subscriber, which costs 36 us to 41 us of CPU for a message on
/clock with one subscriber, or waits until the subscriber has read it.  Here a message costs 3.4 us (3.3 us where rospy
waits), and a subscriber that does not read cannot delay the simulation.  A latched topic has the same problem: rospy
waits for the new subscriber while it holds the topic.  A closed topic keeps its epoll descriptor until a garbage
collection.

Uses: of ``rospy.topics._PublisherImpl`` the attributes in :data:`USED`.  ``connections`` is replaced by a new list,
under ``c_lock``, whenever a connection is added or removed; without a ``queue_size`` the connections are added as they
are.  ``add_connection`` calls ``peer_subscribe`` of the subscriber listeners after the connection is in the list.
``connection_poll.poller`` of a topic is its epoll object.  Connections: see ``subscriber_link``.
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic).
Without it: topics are published by plain rospy with a queue (:class:`PlainChannel`); one line in the log.
"""
from __future__ import annotations

import logging
import threading
import time
import warnings
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple, Union

import rospy
from rospy.exceptions import TransportTerminated
from rospy.impl import tcpros_base

from m2wr_node.internals import subscriber_link
from m2wr_node.internals.subscriber_link import Link

log = logging.getLogger(__name__)

USED = ("connections", "c_lock", "closed", "seq", "is_latch", "latch", "message_data_sent", "resolved_name",
        "data_class", "add_headers", "add_subscriber_listener", "remove_connection")
PLAIN_QUEUE = 100               # messages that wait for a subscriber where plain rospy publishes

# Only a publisher without a queue leaves the connections to us; rospy warns about each.
warnings.filterwarnings("ignore", "The publisher should be created with an explicit keyword argument 'queue_size'",
                        SyntaxWarning)

Serialiser = Callable[[int, Any], bytes]        # (seq, message or record) -> framed message


class Dropped(NamedTuple):
    """Messages lost to a subscriber that did not read them in time; ``peer`` is empty for all that have left."""

    topic: str
    peer: str
    messages: int


class _SubscriberListener(rospy.SubscribeListener):
    """Tells a channel of each new subscriber, from the thread in which rospy accepts it."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel

    def peer_subscribe(self, topic_name: str, topic_publish: object, peer_publish: object) -> None:
        """Send the latched message to the new subscriber."""
        self._channel.adopt_new()


class Channel:
    """All connections of one topic, and its serialiser.

    One thread publishes; at the same time rospy's threads add and remove subscribers.  Topics are latched here and not
    by rospy.  rospy's accepting thread would wait for the new subscriber while it holds the topic, and would write into
    the middle of a message that a link has partly sent.

    Parameters
    ----------
    impl : rospy.topics._PublisherImpl
        rospy's part of the topic.
    serialise : callable
        ``(seq, message) -> bytes`` of a framed message.

    Attributes
    ----------
    impl
        ``impl.connections`` is empty while the topic has no subscriber; with each step it is read without a call.
    """

    def __init__(self, impl: Any, serialise: Serialiser) -> None:
        self.impl = impl
        self.topic: str = impl.resolved_name
        self._serialise = serialise
        self._known: Optional[List[Any]] = None         # rospy's list of connections that _links was made of
        self._links: Tuple[Any, ...] = ()               # of Link, or connections of rospy
        self._prompt: Tuple[Any, ...] = ()              # those of the links that get each message,
        self._paced: Tuple[Link, ...] = ()              # and those that asked for fewer (subscriber_link.PERIOD_FIELD)
        self._skipped: Any = None       # the newest message, if a link has not got it
        self._gone = 0                  # messages dropped for subscribers that have left
        self._lock = threading.RLock()  # a holder never waits for a subscriber
        self._latched = False
        self._kept: Any = None          # the last message: framed, or not serialised yet

    def connected(self) -> bool:
        """Return whether the topic has a subscriber."""
        return bool(self.impl.connections)

    def audience(self) -> Tuple[Any, ...]:
        """Return the subscribers, to compare with those of another moment."""
        return tuple(self.impl.connections)

    def due(self) -> bool:
        """Return whether a subscriber takes a message now; one that asked for fewer may not."""
        if self.impl.connections is not self._known or self._prompt:
            return bool(self.impl.connections)
        if not self._paced:
            return False
        now = time.monotonic()
        return any(now >= link.due for link in self._paced)

    def latch(self) -> None:
        """Send the last message to each new subscriber from now on.

        Messages of such a topic must not change after they are published.
        """
        impl = self.impl
        with self._lock:
            if impl.is_latch:           # another publisher of the topic has asked rospy for it
                impl.is_latch, self._kept, impl.latch = False, impl.latch, None
            if not self._latched:
                self._latched = True
                impl.add_headers({"latching": "1"})
                impl.add_subscriber_listener(_SubscriberListener(self))

    def adopt_new(self) -> None:
        """Adopt new connections now instead of with the next message."""
        with self._lock:
            if not self.impl.closed:
                self._adopt()

    def publish(self, message: Any) -> None:
        """Send a message, or a record that makes one with its method ``message``; returns at once.

        Raises
        ------
        rospy.ROSException
            If the topic is closed.
        """
        impl = self.impl
        with self._lock:
            if impl.is_latch:
                self.latch()
            if impl.connections is not self._known:
                self._adopt()
            if impl.closed:
                raise rospy.ROSException("publish() to the closed topic %s" % self.topic)
            links, data = self._prompt, b""
            if self._paced:
                links += self._take_due(message)
            if links:
                impl.seq += 1
                data = self._serialise(impl.seq, message)
            if self._latched:
                self._kept = data or message
            for link in links:
                try:
                    link.write_data(data)       # as _send, without a call for each message
                except Exception as error:
                    self._lose(link, error)
            impl.message_data_sent += len(data)

    def _take_due(self, message: Any) -> Tuple[Link, ...]:
        """Return the paced links that take a message now; it is kept for the others, see :meth:`flush`."""
        now = time.monotonic()
        due = tuple(link for link in self._paced if now >= link.due)
        for link in due:
            link.due = now + link.period
        self._skipped = None if len(due) == len(self._paced) else message
        return due

    def flush(self) -> None:
        """Send the newest message to the subscribers that asked for fewer messages and have not got it.

        For moments in which no further message comes soon.
        """
        with self._lock:
            message = self._skipped
            links = self._take_due(message) if message is not None and not self.impl.closed else ()
            if links:
                data = self._frame(message)
                for link in links:
                    self._send(link, data)
                self.impl.message_data_sent += len(data)

    def _frame(self, message: Any) -> bytes:
        self.impl.seq += 1
        return self._serialise(self.impl.seq, message)

    def _send(self, link: Any, data: bytes) -> None:
        try:
            link.write_data(data)
        except Exception as error:
            self._lose(link, error)

    def _lose(self, link: Any, error: Exception) -> None:
        """Remove a connection that has failed; a link of ours has already left the topic."""
        if not isinstance(error, TransportTerminated):          # one of rospy's own connections
            log.debug("%s to %s: %s", self.topic, link.endpoint_id, error)
            self.impl.remove_connection(link)

    def _adopt(self) -> None:
        """Replace rospy's connections by links; rospy makes a new list with every change.

        Connections of another class are kept as they are.  New subscribers get the latched message.
        """
        impl, before = self.impl, self._links
        with impl.c_lock:
            connections = impl.connections
            for index, connection in enumerate(connections):
                if isinstance(connection, Link) or connection.done:
                    continue
                if is_replaceable(connection):
                    connections[index] = Link(connection, self.topic)
            self._links = tuple(connection for connection in connections if not connection.done)
            self._known = connections
            paced = () if self._latched else tuple(
                link for link in self._links if isinstance(link, Link) and link.period)
            self._paced, self._prompt = paced, tuple(link for link in self._links if link not in paced)
            self._skipped = self._skipped if paced else None
        self._gone += sum(getattr(link, "dropped", 0) for link in before if link not in self._links)
        added = [link for link in self._links if link not in before]
        if self._kept is None or not added:
            return
        if not isinstance(self._kept, bytes):
            kept, self._kept = self._kept, None         # what cannot be serialised is not kept
            self._kept = self._frame(kept)
        for link in added:
            self._send(link, self._kept)
            impl.message_data_sent += len(self._kept)

    def dropped(self) -> List[Dropped]:
        """Return the lost messages, a list of :class:`Dropped`."""
        with self._lock:
            if self.impl.connections is not self._known:
                self._adopt()
            lost = [Dropped(self.topic, link.endpoint_id, link.dropped) for link in self._links
                    if getattr(link, "dropped", 0)]
            return lost + ([Dropped(self.topic, "", self._gone)] if self._gone else [])

    def traffic(self) -> Tuple[int, int]:
        """Return how many messages were serialised, and the number of subscribers."""
        return self.impl.seq, len(self.impl.connections)

    def release(self) -> bool:
        """Return whether the last publisher of the topic is unregistered."""
        return self.impl.closed


class PlainChannel:
    """A topic that plain rospy publishes, where this rospy has not what :class:`Channel` uses.

    Parameters
    ----------
    topic : str
    message_class : type
    """

    def __init__(self, topic: str, message_class: type) -> None:
        self._class = message_class
        self._latched: Any = None       # a second rospy.Publisher, once latched
        self._publisher = rospy.Publisher(topic, message_class, queue_size=PLAIN_QUEUE)
        self.topic: str = self._publisher.resolved_name
        self._count, self.users = 0, 0
        self.impl = self            # for impl.connections, as of a Channel

    @property
    def connections(self) -> int:
        """Number of subscribers."""
        return self._publisher.get_num_connections()

    def connected(self) -> bool:
        """Return whether the topic has a subscriber."""
        return self._publisher.get_num_connections() > 0

    def audience(self) -> Tuple[Any, ...]:
        """Return something that differs if the number of subscribers does."""
        return (self._publisher.get_num_connections(),)

    def due(self) -> bool:
        """Return whether the topic has a subscriber; rospy sends each message to all."""
        return self.connected()

    def flush(self) -> None:
        """Do nothing: no message is held back."""

    def latch(self) -> None:
        """Send the last message to each new subscriber from now on."""
        if self._latched is None:
            self._latched = rospy.Publisher(self.topic, self._class, latch=True, queue_size=PLAIN_QUEUE)

    def publish(self, message: Any) -> None:
        """Send a message, or a record that makes one with its method ``message``."""
        self._count += 1
        self._publisher.publish(message if isinstance(message, self._class) else message.message(self._class))

    def dropped(self) -> List[Dropped]:
        """Return no losses: rospy does not count them."""
        return []

    def traffic(self) -> Tuple[int, int]:
        """Return how many messages were published, and the number of subscribers."""
        return self._count, self._publisher.get_num_connections()

    def release(self) -> bool:
        """Count one user less; return whether it was the last, and then unregister."""
        self.users -= 1
        for publisher in (self._publisher, self._latched):
            if publisher is not None and self.users == 0:
                unregister(publisher)
        return self.users == 0


AnyChannel = Union[Channel, PlainChannel]


def is_replaceable(connection: Any) -> bool:
    """Return whether a :class:`Link` can stand for a connection of rospy."""
    usual = getattr(tcpros_base, "TCPROSTransport", None)
    return (usual is not None and isinstance(connection, usual) and connection.socket is not None
            and all(hasattr(connection, name) for name in subscriber_link.USED))


def missing_parts(impl: Any) -> List[str]:
    """Return the attributes of a topic that :class:`Channel` uses and this rospy does not have."""
    return [name for name in USED if not hasattr(impl, name)]


def unregister(topic: Any) -> None:
    """Unregister a rospy.Publisher or rospy.Subscriber; the last one of a topic frees its epoll descriptor at once.

    rospy leaves the descriptor to a cycle of objects that only a garbage collection frees.
    """
    impl = getattr(topic, "impl", None)
    topic.unregister()
    poller: Any = getattr(getattr(impl, "connection_poll", None), "poller", None)
    if getattr(impl, "closed", False) and hasattr(poller, "close"):
        poller.close()


class Channels:
    """The channels of a node; publishers of one topic share one.

    Parameters
    ----------
    serialiser_of : callable
        Returns the function ``(seq, message) -> bytes`` for a message class.
    """

    def __init__(self, serialiser_of: Callable[[type], Serialiser]) -> None:
        self._serialiser_of, self._warned = serialiser_of, False
        self._channels: Dict[str, AnyChannel] = {}      # by resolved topic
        subscriber_link.read_periods()

    def open(self, topic: str, message_class: type) -> Tuple[Any, AnyChannel]:
        """Register a publisher with the master.

        Parameters
        ----------
        topic : str
        message_class : type

        Returns
        -------
        tuple
            The rospy.Publisher, and its :class:`Channel` or :class:`PlainChannel`.
        """
        publisher = rospy.Publisher(topic, message_class, queue_size=None)
        channel = self._channels.get(publisher.resolved_name)
        impl: Any = getattr(publisher, "impl", None)
        missing = missing_parts(impl)
        if missing:
            return publisher, self._plain(channel, publisher, missing)
        if channel is None or channel.impl is not impl:
            channel = self._channels[publisher.resolved_name] = Channel(impl, self._serialiser_of(impl.data_class))
        return publisher, channel

    def _plain(self, channel: Optional[AnyChannel], publisher: Any, missing: List[str]) -> PlainChannel:
        if not self._warned:
            self._warned = True
            log.warning("the publishers of this rospy have no %s; rospy publishes with a queue of %d messages",
                        ", ".join(missing), PLAIN_QUEUE)
        if not isinstance(channel, PlainChannel):
            channel = PlainChannel(publisher.resolved_name, publisher.data_class)
            self._channels[channel.topic] = channel
        channel.users += 1
        return channel

    def close(self, publisher: Any, channel: AnyChannel) -> None:
        """Unregister a publisher; the topic closes with the last one.

        Parameters
        ----------
        publisher : rospy.Publisher
        channel : Channel or PlainChannel
            As :meth:`open` has returned them.
        """
        unregister(publisher)
        if channel.release() and self._channels.get(channel.topic) is channel:
            del self._channels[channel.topic]

    def flush(self) -> None:
        """Send what subscribers have not got that asked for fewer messages."""
        for channel in list(self._channels.values()):
            channel.flush()

    def traffic(self) -> Dict[str, Tuple[int, int]]:
        """Return ``{topic: (messages made, subscribers)}``; without a subscriber no message is made."""
        return {topic: channel.traffic() for topic, channel in list(self._channels.items())}

    def dropped(self) -> List[Dropped]:
        """Return the messages that slow subscribers have lost, a list of :class:`Dropped`."""
        return [lost for channel in list(self._channels.values()) for lost in channel.dropped()]
