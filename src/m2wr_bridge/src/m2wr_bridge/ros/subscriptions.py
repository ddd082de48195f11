# SPDX-License-Identifier: BSD-3-Clause
"""Topics to which clients listen: one subscriber of ROS for all of them."""
from __future__ import annotations

import io
import struct
import threading
from typing import Any, Callable, Dict, List, Optional

import genpy
import rosgraph
import rospy

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.messages.received import Received
from m2wr_bridge.ros.classes import Classes

Listener = Callable[[Received], None]
MOST_LATCHED = 100          # publishers of a topic whose latched message is kept
_BUFFER = 1 << 20           # bytes read at once from a publisher


def legal(kind: str, name: str) -> str:
    """Return the global name of a topic or service.

    Parameters
    ----------
    kind : str
        "topic" or "service", for the error.
    name : str

    Raises
    ------
    BridgeError
        If the name is not legal.
    """
    if not name or len(name) > 500 or not rosgraph.names.is_legal_name(name) or name.startswith("~"):
        raise BridgeError("%s name %r; expected letters, digits, _ and /" % (kind, name[:100]))
    resolved: str = rospy.resolve_name(name)
    return resolved


def topic_type(topic: str) -> Optional[str]:
    """Return the type that the master knows for a topic, or None.

    Raises
    ------
    BridgeError
        If the master does not answer.
    """
    try:
        types = dict(rosgraph.Master(rospy.get_name()).getTopicTypes())
    except (OSError, rosgraph.MasterException) as error:
        raise BridgeError("the master does not answer: %s" % error) from error
    found = types.get(topic)
    return None if found in (None, "*") else str(found)


def raw_class(type_name: Optional[str]) -> Any:
    """Return a class that keeps messages serialised, of any type, registered as of one."""
    return rospy.AnyMsg if type_name is None else type("Raw", (rospy.AnyMsg,), {"_type": type_name})


class _Source:
    """The subscriber of a topic, its listeners, and the latched message of each publisher."""

    def __init__(self) -> None:
        self.subscriber: Any = None
        self.listeners: List[Listener] = []
        self.latched: Dict[str, Received] = {}
        self.lock = threading.Lock()


class Subscriptions:
    """All topics to which clients listen.

    Parameters
    ----------
    classes : Classes
    """

    def __init__(self, classes: Classes) -> None:
        self._classes = classes
        self._sources: Dict[str, _Source] = {}
        self._lock = threading.Lock()

    def add(self, topic: str, type_name: Optional[str], listener: Listener) -> None:
        """Call a listener with each message of a topic, beginning with latched ones.

        Parameters
        ----------
        topic : str
        type_name : str or None
            None: whatever type it has.
        listener : callable

        Raises
        ------
        BridgeError
            If the topic has another type, or its class is not there.
        """
        name = legal("topic", topic)
        if type_name is not None:
            self._classes.message(type_name)
        known = topic_type(name)
        if known is not None and type_name is not None and known != type_name:
            raise BridgeError("topic %s has the type %s, not %s" % (topic, known, type_name))
        with self._lock:
            source = self._sources.get(name)
            if source is None:
                source = self._sources[name] = _Source()
            with source.lock:           # no newer message comes between
                source.listeners.append(listener)
                for received in source.latched.values():
                    listener(received)
            if source.subscriber is None:
                try:
                    source.subscriber = rospy.Subscriber(name, raw_class(known or type_name), self._take, source,
                                                         buff_size=_BUFFER, tcp_nodelay=True)
                except (rospy.ROSException, ValueError) as error:
                    del self._sources[name]
                    raise BridgeError("topic %s: %s" % (topic, error)) from error

    def repeat(self, topic: str, listener: Listener) -> None:
        """Call a listener with the latched messages of a topic again.

        Parameters
        ----------
        topic : str
        listener : callable
        """
        with self._lock:
            source = self._sources.get(legal("topic", topic))
        if source is not None:
            with source.lock:
                for received in source.latched.values():
                    listener(received)

    def remove(self, topic: str, listener: Listener) -> None:
        """Stop calling a listener.

        Parameters
        ----------
        topic : str
        listener : callable
        """
        name = legal("topic", topic)
        with self._lock:
            source = self._sources.get(name)
            if source is None:
                return
            with source.lock:
                if listener in source.listeners:
                    source.listeners.remove(listener)
                left = len(source.listeners)
            if not left:
                del self._sources[name]
                source.subscriber.unregister()

    def _take(self, message: Any, source: _Source) -> None:
        """Pass a message on; in a thread of rospy."""
        header = message._connection_header
        now = rospy.get_rostime()
        # rospy gives one topic one class: /clock comes as a message, because rospy itself reads the time from it
        raw = message._buff if isinstance(message, rospy.AnyMsg) else serialised(message)
        received = Received(raw, header.get("type", "*"), header.get("md5sum", "*"),
                            header.get("message_definition", ""), now.secs, now.nsecs, self.decode)
        with source.lock:
            if header.get("latching") == "1":
                publisher = header.get("callerid", "")
                source.latched.pop(publisher, None)         # the newest is the last
                source.latched[publisher] = received
                if len(source.latched) > MOST_LATCHED:
                    del source.latched[next(iter(source.latched))]
            listeners = list(source.listeners)
        for listener in listeners:
            listener(received)

    def decode(self, received: Received) -> Any:
        """Return the message.

        Raises
        ------
        BridgeError
            If its class is not there or another version, or the bytes do not fit.
        """
        kind = self._classes.message(received.type_name)
        if kind._md5sum != received.md5:
            raise BridgeError("%s of the publisher is another version than the one built here" % received.type_name)
        try:
            message = kind()
            message.deserialize(received.raw)
            return message
        except (genpy.DeserializationError, struct.error, ValueError, MemoryError) as error:
            raise BridgeError("a message of %d bytes is no %s: %s" % (
                len(received.raw), received.type_name, error)) from error


def serialised(message: Any) -> bytes:
    """Return the bytes of a message.

    Raises
    ------
    BridgeError
        If a value does not fit its field.
    """
    stream = io.BytesIO()
    try:
        message.serialize(stream)
    except (genpy.SerializationError, struct.error, UnicodeError, TypeError) as error:
        raise BridgeError("a message of %s cannot be written: %s" % (message._type, error)) from error
    return stream.getvalue()
