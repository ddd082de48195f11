# SPDX-License-Identifier: BSD-3-Clause
"""Topics that clients publish: one publisher of ROS for all of them."""
from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, Optional, Set, Tuple

import rospy

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.ros.classes import Classes
from m2wr_bridge.ros.subscriptions import legal, topic_type

_RECENT = 1.0               # s in which a new topic keeps messages for subscribers that are just connecting
_MOST_RECENT = 20           # messages


class _Recent(rospy.SubscribeListener):
    """Gives the first messages of a new topic to subscribers that connect after them.

    A page publishes right after it has advertised, and a subscriber needs some milliseconds to connect.
    """

    def __init__(self) -> None:
        self._messages: Deque[Tuple[float, Any]] = deque(maxlen=_MOST_RECENT)
        self._lock = threading.Lock()
        self._began = time.monotonic()

    def keep(self, message: Any, publish: Callable[[Any], None]) -> None:
        """Publish a message, and keep it while the topic is new.

        Parameters
        ----------
        message : genpy.Message
        publish : callable
        """
        with self._lock:
            if time.monotonic() - self._began > _RECENT:
                self._messages.clear()
            else:
                self._messages.append((time.monotonic(), message))
            publish(message)

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        """Send a new subscriber what it has missed; nothing else is published meanwhile, as rospy demands."""
        with self._lock:
            for at, message in self._messages:
                if time.monotonic() - at <= _RECENT:
                    peer_publish(message)


class _Publication:
    """The publisher of a topic and who holds it."""

    def __init__(self, publisher: Any, kind: Any, recent: _Recent) -> None:
        self.publisher, self.kind, self.recent = publisher, kind, recent
        self.holders: Set[object] = set()
        self.unused = 0.0


class Publications:
    """All topics that clients publish.

    Parameters
    ----------
    classes : Classes
    patience : float
        Time for which a topic that no client holds is kept [s].
    """

    def __init__(self, classes: Classes, patience: float) -> None:
        self._classes, self._patience = classes, patience
        self._topics: Dict[str, _Publication] = {}
        self._lock = threading.Lock()

    def advertise(self, topic: str, type_name: Optional[str], holder: object, latch: bool, depth: int) -> None:
        """Hold a topic; it is made if it is not there.

        Parameters
        ----------
        topic : str
        type_name : str or None
            None: the type that the topic has.
        holder : object
        latch : bool
        depth : int
            Messages that wait for a subscriber.

        Raises
        ------
        BridgeError
            If the type is not known or another one.
        """
        name = legal("topic", topic)
        known = topic_type(name)
        wanted = type_name or known
        if wanted is None:
            raise BridgeError("topic %s has no type yet; advertise it with one first" % topic)
        if known is not None and known != wanted:
            raise BridgeError("topic %s has the type %s, not %s" % (topic, known, wanted))
        kind = self._classes.message(wanted)
        with self._lock:
            found = self._topics.get(name)
            if found is None:
                recent = _Recent()
                try:
                    publisher = rospy.Publisher(name, kind, None if latch else recent,   # rospy sends latched ones
                                                latch=latch, queue_size=depth, tcp_nodelay=True)
                except (rospy.ROSException, ValueError) as error:
                    raise BridgeError("topic %s: %s" % (topic, error)) from error
                found = self._topics[name] = _Publication(publisher, kind, recent)
            found.holders.add(holder)

    def unadvertise(self, topic: str, holder: object) -> None:
        """Release a topic; after a while without holders it ends.

        Parameters
        ----------
        topic : str
        holder : object
        """
        name = legal("topic", topic)
        with self._lock:
            found = self._topics.get(name)
            if found is None:
                return
            found.holders.discard(holder)
            if found.holders:
                return
            found.unused = time.monotonic()
        timer = threading.Timer(self._patience, self._end, (name, found))
        timer.daemon = True
        timer.start()

    def _end(self, name: str, publication: _Publication) -> None:
        with self._lock:
            if publication.holders or self._topics.get(name) is not publication or \
                    time.monotonic() - publication.unused < 0.9 * self._patience:
                return
            del self._topics[name]
        publication.publisher.unregister()

    def kind(self, topic: str) -> Any:
        """Return the class of a topic's messages.

        Raises
        ------
        BridgeError
            If the topic is not advertised.
        """
        found = self._topics.get(legal("topic", topic))
        if found is None:
            raise BridgeError("topic %s is not advertised" % topic)
        return found.kind

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message.

        Parameters
        ----------
        topic : str
        message : genpy.Message

        Raises
        ------
        BridgeError
            If the topic is not advertised or the message cannot be serialised.
        """
        found = self._topics.get(legal("topic", topic))
        if found is None:
            raise BridgeError("topic %s is not advertised" % topic)
        try:
            found.recent.keep(message, found.publisher.publish)
        except (rospy.ROSException, rospy.ROSSerializationException) as error:
            raise BridgeError("topic %s: %s" % (topic, error)) from error
