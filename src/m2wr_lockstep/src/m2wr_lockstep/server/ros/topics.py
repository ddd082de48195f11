# SPDX-License-Identifier: BSD-3-Clause
"""The simulation's topics in lockstep: published messages are counted, received ones are held back until they count."""
from __future__ import annotations

from typing import Any, Callable, Dict, Set

import rospy

from m2wr_lockstep.server.inbox import Inbox
from m2wr_lockstep.server.interfaces import Port
from m2wr_lockstep.server.message_counts import MessageCounts

#: Message types that make a tick, by the value of the parameter ~lockstep_tick.
TICKS = {"scan": ("sensor_msgs/LaserScan",), "odometry": ("nav_msgs/Odometry",),
         "both": ("sensor_msgs/LaserScan", "nav_msgs/Odometry")}


class _CountedPort:
    """A port whose messages are counted; it has the other attributes of the port."""

    def __init__(self, topics: LockstepTopics, port: Port, topic: str, ticking: bool) -> None:
        self._topics, self._port, self._topic, self._ticking = topics, port, topic, ticking
        self.wanted = self._wanted if ticking else port.wanted

    def _wanted(self) -> bool:
        """Return whether to publish: for subscribers, or to make ticks if no other port that makes them has any."""
        return self._port.wanted() or not any(other.has_subscriber() for other in list(self._topics.ticking))

    def has_subscriber(self) -> bool:
        """Return whether the port has a subscriber."""
        return self._port.wanted()

    def publish(self, message: Any) -> None:
        """Publish and count a message."""
        topics = self._topics
        topics.counts.count(self._topic)
        if self._topic in topics.triggers:
            topics.before_trigger()
        if self._ticking:
            topics.tick_due = True
        self._port.publish(message)

    def close(self) -> None:
        """Stop publishing on the topic."""
        self._topics.ticking.discard(self)
        self._topics.changed = True
        self._port.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)


class _Subscription:
    """A subscription whose messages go through the inbox."""

    def __init__(self, topics: LockstepTopics, topic: str, message_class: Any,
                 callback: Callable[[Any], object]) -> None:
        self._topics, self._inbox, self._own = topics, topics.inbox, rospy.get_name()
        self._slot = self._inbox.open(rospy.resolve_name(topic), callback)
        # no queue size: rospy would keep only the newest of several messages that arrive together
        self._subscriber = rospy.Subscriber(topic, message_class, self._store, queue_size=None, tcp_nodelay=True)

    def _store(self, message: Any) -> None:
        sender = message._connection_header.get("callerid", "")
        if sender != self._own:
            self._inbox.arrive(self._slot, sender, message)

    def publishers(self) -> int:
        """Return how many nodes publish the topic."""
        return int(self._subscriber.get_num_connections())

    def close(self) -> None:
        """Unsubscribe."""
        self._topics.changed = True
        self._subscriber.unregister()
        self._inbox.close(self._slot)


def _do_nothing() -> None:
    """Do nothing, until there is a loop or a barrier to call."""


class LockstepTopics:
    """What was published, and what was received from whom.

    Parameters
    ----------
    tick : str
        A key of :data:`TICKS`.

    Attributes
    ----------
    counts : MessageCounts
    inbox : Inbox
    tick_due : bool
        Whether a message that makes a tick was published since this was last set to False.
    ticking : set
        Ports that make ticks.
    changed : bool
        Whether topics were added or removed since this was last set to False.
    triggers, before_trigger : set, callable
        Topics that other nodes answer at once, and what is called before a message on one of them is sent.
    on_arrival : callable
        Called in the receiving thread after a message was held back.
    """

    def __init__(self, tick: str = "scan") -> None:
        self.counts, self.inbox = MessageCounts(), Inbox(lambda: self.on_arrival())
        self.tick_due, self.changed = False, True
        self.ticking: Set[_CountedPort] = set()
        self.on_arrival: Callable[[], object] = _do_nothing
        self.before_trigger: Callable[[], object] = _do_nothing
        self.triggers: Set[str] = set()
        self._tick_types = TICKS[tick]
        self._counting: Dict[str, _Subscription] = {}       # by topic: subscriptions that only count

    def counted(self, port: Port, topic: str, message_class: Any) -> _CountedPort:
        """Return a port that publishes through ``port`` and counts its messages.

        Parameters
        ----------
        port : Port
        topic : str
            Its name before remapping.
        message_class : type
        """
        ticking = message_class._type in self._tick_types
        counted = _CountedPort(self, port, rospy.resolve_name(topic), ticking)
        if ticking:
            self.ticking.add(counted)
        self.changed = True
        return counted

    def subscribe(self, topic: str, message_class: Any, callback: Callable[[Any], object]) -> _Subscription:
        """Return a subscription.

        Parameters
        ----------
        topic : str
            Its name before remapping.
        message_class : type
        callback : callable
            Called with a message by the inbox's ``deliver``.
        """
        self.changed = True
        counting = self._counting.pop(rospy.resolve_name(topic), None)
        if counting is not None:
            counting.close()            # rospy allows one message class for a topic
        return _Subscription(self, topic, message_class, callback)

    def listen(self, topic: str) -> None:
        """Subscribe to a topic only to count its messages, unless there is a subscription."""
        if topic not in self.inbox.topics():
            self._counting[topic] = _Subscription(self, topic, rospy.AnyMsg, lambda message: None)
            self.changed = True
