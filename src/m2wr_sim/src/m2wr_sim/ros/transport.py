# SPDX-License-Identifier: BSD-3-Clause
"""Writing messages to subscribers without a thread for each, and without ever waiting for one of them.

rospy keeps what it is good at: it registers the topics, answers subscribers and counts.  What it does with each
message, though, is either to hand it to a thread per subscriber, which costs more than ten physics steps, or to wait
until the subscriber has taken it.  Here the simulation's thread serialises a message once and gives it to the kernel;
what the kernel does not take at once waits in a bounded backlog of that one connection, which a single sleeping thread
empties when the peer reads on.
"""
import logging
import select
import socket
import threading
import time
import warnings
from collections import deque, namedtuple

import rospy
from rospy.exceptions import TransportTerminated
from rospy.impl.tcpros_base import TCPROSTransport

from m2wr_sim.ros.serialise import serialiser_of

log = logging.getLogger("m2wr_sim.transport")

BACKLOG_MESSAGES = 10000    # of one connection; whichever comes first
BACKLOG_BYTES = 8 << 20
_AT_ONCE = socket.MSG_DONTWAIT
_BATCH_MESSAGES = 64        # handed to the kernel in one call when a backlog is emptied
_QUIET = 10.0               # s of wall time between two log lines about one connection

# A publisher without a queue of its own is what leaves the connections to us; rospy warns about each.
warnings.filterwarnings("ignore", "The publisher should be created with an explicit keyword argument 'queue_size'",
                        SyntaxWarning)

Dropped = namedtuple("Dropped", "topic peer count")
"""Messages lost to a subscriber that did not read them in time; ``peer`` is empty for all those that have left."""


class _Drain:
    """The thread that sleeps until a peer which had stopped reading takes data again; started when first needed."""

    def __init__(self):
        self._lock, self._links, self._poll = threading.Lock(), {}, None

    def watch(self, link):
        """Call ``link.drain()`` once, as soon as its socket takes data or breaks."""
        with self._lock:
            number = link.fileno_now()
            if number < 0:
                return
            if self._poll is None:
                self._poll = select.epoll()
                threading.Thread(target=self._run, name="drain", daemon=True).start()
            self._links[number] = link
            for arm in (self._poll.modify, self._poll.register):
                try:
                    arm(number, select.EPOLLOUT | select.EPOLLONESHOT)
                    break
                except OSError:         # not watched before; or closed meanwhile, and then forget() follows
                    continue

    def forget(self, link):
        """Watch a connection no more."""
        with self._lock:
            for number in [number for number, watched in self._links.items() if watched is link]:
                del self._links[number]

    def _run(self):
        while True:
            for number, _ in self._poll.poll():
                with self._lock:
                    link = self._links.pop(number, None)
                if link is not None:
                    link.drain()
                    link = None         # so that it can go while this thread sleeps


_drain = _Drain()


class Link:
    """One subscriber's connection, in place of rospy's own among the connections of a topic.

    Attributes that are not defined here are those of the connection it stands for.  A message that was begun is always
    finished; beyond the limits the oldest whole messages go.

    Parameters
    ----------
    connection : rospy.impl.tcpros_base.TCPROSTransport
        With an open socket.
    topic : str
        For what is logged.
    """

    def __init__(self, connection, topic):
        self._connection, self._socket, self._topic = connection, connection.socket, topic
        self._lock = threading.Lock()
        self._begun = None              # what the kernel takes next, only _drain's thread changes it; None: all is sent
        self._backlog, self._bytes = deque(), 0
        self._fault, self._complaint, self._complained = None, False, -_QUIET
        self.dropped = 0
        previous = connection.cleanup_cb

        def cleanup(closed):
            self._let_go()
            if previous:
                previous(closed)

        connection.set_cleanup_callback(cleanup)

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def __eq__(self, other):
        return other is self or other is self._connection       # rospy takes out what it has put in

    def __hash__(self):
        return hash(self._connection)

    @property
    def waiting(self):
        """Number of messages that are not sent yet."""
        begun = self._begun
        return 0 if begun is None else len(begun) + len(self._backlog)

    def fileno_now(self):
        """Return the number of the socket while it is open, else -1."""
        return -1 if self._socket is None else self._socket.fileno()

    def write_data(self, data):
        """Send one framed message, or keep it for later; returns at once.

        Raises
        ------
        rospy.exceptions.TransportTerminated
            If the connection is gone; it has left its topic then.
        """
        with self._lock:
            if self._begun is None:
                try:
                    sent = self._socket.send(data, _AT_ONCE)
                except BlockingIOError:
                    sent = 0
                except (OSError, AttributeError) as error:  # AttributeError: it was closed before it came here
                    self._fault, sent = error, None
                if sent == len(data):
                    self._connection.stat_bytes += sent
                    self._connection.stat_num_msg += 1
                    return
                if sent is not None:
                    self._connection.stat_bytes += sent
                    self._begun = deque((memoryview(data)[sent:],))
                    _drain.watch(self)
            else:
                self._keep(data)
        if self._fault is not None:
            self._break()
        if self._complaint:
            self._complain()

    def _keep(self, data):
        self._backlog.append(data)
        self._bytes += len(data)
        while len(self._backlog) > BACKLOG_MESSAGES or (self._bytes > BACKLOG_BYTES and len(self._backlog) > 1):
            self._bytes -= len(self._backlog.popleft())
            self.dropped += 1
            if self._complained is not None:
                self._complaint = True

    def drain(self):
        """Send what waits until it is gone or the kernel takes no more; for :class:`_Drain`'s thread alone."""
        try:
            while self._refill():
                self._account(self._socket.sendmsg(self._begun, (), socket.MSG_DONTWAIT))
        except BlockingIOError:
            _drain.watch(self)
        except (OSError, AttributeError) as error:
            self._fault = error
            try:
                self._break()
            except TransportTerminated:
                pass                    # said in _break

    def _refill(self):
        """Move messages from the backlog to what the kernel takes next; False when nothing is left."""
        with self._lock:
            while self._backlog and len(self._begun) < _BATCH_MESSAGES:
                data = self._backlog.popleft()
                self._bytes -= len(data)
                self._begun.append(memoryview(data))
            if not self._begun:
                self._begun = None
                if self._complained is None:
                    self._complained = time.monotonic()
            return self._begun is not None

    def _account(self, sent):
        self._connection.stat_bytes += sent
        while self._begun and sent >= len(self._begun[0]):
            sent -= len(self._begun.popleft())
            self._connection.stat_num_msg += 1
        if sent:
            self._begun[0] = self._begun[0][sent:]

    def _complain(self):
        """Say once that messages are lost; again only after the backlog was empty meanwhile."""
        self._complaint = False
        if time.monotonic() - self._complained >= _QUIET:
            log.warning("%s does not read %s fast enough: %d messages wait for it, and from now on the oldest are "
                        "dropped; /diagnostics counts them", self._connection.endpoint_id, self._topic, self.waiting)
        self._complained = None

    def _break(self):
        """Close the connection, which takes it out of its topic."""
        error, self._fault = self._fault, None
        log.debug("%s to %s: %s", self._topic, self._connection.endpoint_id, error)
        try:
            self._connection.close()
        except Exception as fault:      # rospy stumbles when the topic itself is closed at the same moment
            log.debug("%s to %s: while closing: %s", self._topic, self._connection.endpoint_id, fault)
        raise TransportTerminated(str(error))

    def _let_go(self):
        """Forget what can no more be sent."""
        _drain.forget(self)
        with self._lock:
            self._backlog.clear()
            self._bytes = 0


class _Door(rospy.SubscribeListener):
    """Tells a channel of every newcomer, from the thread in which rospy accepts it."""

    def __init__(self, channel):
        self._channel = channel

    def peer_subscribe(self, topic_name, topic_publish, peer_publish):
        """Let the newcomer have what the channel keeps for it."""
        self._channel.welcome()


class Channel:
    """All connections of one topic, and how its messages become bytes.

    One thread publishes; subscribers come and go in rospy's threads meanwhile.  Topics are latched here and not by
    rospy, whose accepting thread would wait for the newcomer while it holds the topic, and would write into the middle
    of a message that a link has begun.

    Parameters
    ----------
    impl : rospy.topics._PublisherImpl
        What rospy keeps of the topic.
    """

    def __init__(self, impl):
        self.impl, self.topic = impl, impl.resolved_name
        self._serialise = serialiser_of(impl.data_class)
        self._known, self._links = None, ()
        self._gone = 0                  # messages dropped for those that have left
        self._lock = threading.RLock()  # whoever holds it never waits for a subscriber
        self._latched, self._kept = False, None     # the last message: framed, or itself while nobody has needed it

    def connected(self):
        """Tell whether anybody listens."""
        return bool(self.impl.connections)

    def latch(self):
        """Let everybody who subscribes from now on have the last message at once.

        Messages of such a topic must not be changed once they are published.
        """
        impl = self.impl
        with self._lock:
            if impl.is_latch:           # another publisher of the topic has asked rospy for it
                impl.is_latch, self._kept, impl.latch = False, impl.latch, None
            if not self._latched:
                self._latched = True
                impl.add_headers({"latching": "1"})
                impl.add_subscriber_listener(_Door(self))

    def welcome(self):
        """Take newcomers in now instead of with the next message."""
        with self._lock:
            if not self.impl.closed:
                self._adopt()

    def publish(self, message):
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
            links, data = self._links, b""
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

    def _frame(self, message):
        self.impl.seq += 1
        return self._serialise(self.impl.seq, message)

    def _send(self, link, data):
        try:
            link.write_data(data)
        except Exception as error:
            self._lose(link, error)

    def _lose(self, link, error):
        """Take a connection out that has failed; a link of ours has left the topic by itself."""
        if not isinstance(error, TransportTerminated):          # of another kind, which rospy treats so
            log.debug("%s to %s: %s", self.topic, link.endpoint_id, error)
            self.impl.remove_connection(link)

    def _adopt(self):
        """Put links in the places of rospy's connections, of which it makes a new list with every change.

        Connections that are not of the usual kind stay what they are.  Newcomers get what the topic keeps for them.
        """
        impl, before = self.impl, self._links
        with impl.c_lock:
            connections = impl.connections
            for index, connection in enumerate(connections):
                if isinstance(connection, Link) or connection.done:
                    continue
                if isinstance(connection, TCPROSTransport) and connection.socket is not None:
                    connections[index] = Link(connection, self.topic)
            self._links = tuple(connection for connection in connections if not connection.done)
            self._known = connections
        self._gone += sum(getattr(link, "dropped", 0) for link in before if link not in self._links)
        newcomers = [link for link in self._links if link not in before]
        if self._kept is None or not newcomers:
            return
        if not isinstance(self._kept, bytes):
            kept, self._kept = self._kept, None         # what cannot be sent is not kept either
            self._kept = self._frame(kept)
        for link in newcomers:
            self._send(link, self._kept)
            impl.message_data_sent += len(self._kept)

    def dropped(self):
        """Return what was lost, a list of :class:`Dropped`."""
        with self._lock:
            if self.impl.connections is not self._known:
                self._adopt()
            lost = [Dropped(self.topic, link.endpoint_id, link.dropped) for link in self._links
                    if getattr(link, "dropped", 0)]
            return lost + ([Dropped(self.topic, "", self._gone)] if self._gone else [])


def release(impl):
    """Free the descriptor with which rospy watches the connections of a topic, once the topic is closed.

    rospy leaves it to a cycle of objects that only a garbage collection frees, which comes seldom here.
    """
    poller = getattr(getattr(impl, "connection_poll", None), "poller", None)
    if impl.closed and hasattr(poller, "close"):
        poller.close()


class Channels:
    """The channels of a node; publishers of one topic share one."""

    def __init__(self):
        self._channels = {}

    def open(self, topic, message_class):
        """Register a publisher with the master; returns it with its channel."""
        publisher = rospy.Publisher(topic, message_class, queue_size=None)
        channel = self._channels.get(publisher.resolved_name)
        if channel is None or channel.impl is not publisher.impl:
            channel = self._channels[publisher.resolved_name] = Channel(publisher.impl)
        return publisher, channel

    def close(self, publisher, channel):
        """Take back a registration; the topic ends with the last one."""
        publisher.unregister()
        release(channel.impl)
        if channel.impl.closed and self._channels.get(channel.topic) is channel:
            del self._channels[channel.topic]

    def traffic(self):
        """Return ``{topic: (messages made, subscribers)}``; nothing is made for nobody."""
        return {topic: (channel.impl.seq, len(channel.impl.connections))
                for topic, channel in list(self._channels.items())}

    def dropped(self):
        """Return what subscribers have lost by not reading, a list of :class:`Dropped`."""
        return [lost for channel in list(self._channels.values()) for lost in channel.dropped()]
