# SPDX-License-Identifier: BSD-3-Clause
"""Messages that the simulation has received, held back until they count.

Messages of a controller are held back until its answer has counted them.  So the effect of a command never depends on
how fast it arrived.
"""
from __future__ import annotations

import threading
from collections import deque
from typing import Any, Callable, Deque, Dict, Iterable, List, Optional, Set


class _Slot:
    """The receiving end of one subscription."""

    def __init__(self, topic: str, callback: Callable[[Any], object]) -> None:
        self.topic, self.callback, self.connected = topic, callback, False
        self.held: Dict[str, Deque[Any]] = {}       # by sender
        self.newest: Any = None


class Inbox:
    """Received messages, of which the newest is delivered: at the next step, or for controllers when it is counted.

    Parameters
    ----------
    on_arrival : callable
        Called in the receiving thread after a message was held back.
    """

    ANY_SENDER = "*"

    def __init__(self, on_arrival: Callable[[], object] = lambda: None) -> None:
        self._lock, self._on_arrival = threading.Lock(), on_arrival
        self._slots: List[_Slot] = []
        self._senders: Set[str] = set()                     # whose messages are held back
        self._answers: Dict[str, Optional[str]] = {}        # topic that is held back: of which sender; None: of all

    def hold(self, sender: str) -> None:
        """Hold back what this sender publishes until :meth:`admit`."""
        self._senders.add(sender)

    def release(self, sender: str, passing: bool = False) -> None:
        """Deliver what this sender publishes without delay again.

        Parameters
        ----------
        sender : str
        passing : bool
            Deliver the newest of the messages that are held back; otherwise all of them are discarded.
        """
        with self._lock:
            self._senders.discard(sender)
            self._release(sender, self._slots, passing)

    def hold_topic(self, topic: str, sender: Optional[str] = None) -> None:
        """Hold back the messages of a topic under the name :attr:`ANY_SENDER`.

        Parameters
        ----------
        topic : str
        sender : str, optional
            Only those of this node.
        """
        self._answers[topic] = sender

    def release_topic(self, topic: str, passing: bool = False) -> None:
        """Deliver the messages of a topic without delay again.

        Parameters
        ----------
        topic : str
        passing : bool
            As of :meth:`release`.
        """
        with self._lock:
            self._answers.pop(topic, None)
            self._release(self.ANY_SENDER, [slot for slot in self._slots if slot.topic == topic], passing)

    @staticmethod
    def _release(key: str, slots: Iterable[_Slot], passing: bool) -> None:
        for slot in slots:
            held = slot.held.pop(key, None)
            if held and passing:
                slot.newest = held[-1]

    def open(self, topic: str, callback: Callable[[Any], object]) -> _Slot:
        """Return a new slot; it counts for :meth:`has` after :meth:`mark_connected`.

        Parameters
        ----------
        topic : str
            Its resolved name.
        callback : callable
            Called with a message by :meth:`deliver`.
        """
        slot = _Slot(topic, callback)
        with self._lock:
            self._slots.append(slot)
        return slot

    def close(self, slot: _Slot) -> None:
        """Remove a slot with its messages."""
        with self._lock:
            self._slots.remove(slot)

    def topics(self) -> Set[str]:
        """Return the topics there are slots of."""
        with self._lock:
            return {slot.topic for slot in self._slots}

    def mark_connected(self) -> Set[str]:
        """Record that all slots are connected to their publishers; returns the topics that were not."""
        with self._lock:
            fresh = {slot.topic for slot in self._slots if not slot.connected}
            for slot in self._slots:
                slot.connected = True
        return fresh

    def arrive(self, slot: _Slot, sender: str, message: Any) -> None:
        """Store a message from the network.

        Parameters
        ----------
        slot : _Slot
            As :meth:`open` has returned it.
        sender : str
            Name of the node that has sent it.
        message : object
            Its content, other than None.
        """
        with self._lock:
            key = sender if sender in self._senders else None
            if key is None and slot.topic in self._answers and self._answers[slot.topic] in (None, sender):
                key = self.ANY_SENDER
            if key is None or not slot.connected:
                slot.newest = message
                return
            slot.held.setdefault(key, deque()).append(message)
        self._on_arrival()

    def has(self, topic: str, sender: str, count: int) -> bool:
        """Return whether every slot of a topic holds at least ``count`` messages; true if there is no slot.

        Parameters
        ----------
        topic : str
        sender : str
            Name of a node, or :attr:`ANY_SENDER`.
        count : int
        """
        with self._lock:
            return all(len(slot.held.get(sender, ())) >= count
                       for slot in self._slots if slot.topic == topic and slot.connected)

    def held(self, topic: str, sender: str) -> int:
        """Return the number of held messages of a topic: the least over its slots, 0 without a slot.

        Parameters
        ----------
        topic : str
        sender : str
            Name of a node, or :attr:`ANY_SENDER`.
        """
        with self._lock:
            return min((len(slot.held.get(sender, ()))
                        for slot in self._slots if slot.topic == topic and slot.connected), default=0)

    def admit(self, topic: str, sender: str, count: int) -> None:
        """Release the oldest messages of a topic.

        Parameters
        ----------
        topic : str
        sender : str
            Name of a node, or :attr:`ANY_SENDER`.
        count : int
            Number of messages; all where fewer are held.
        """
        with self._lock:
            for slot in self._slots:
                held = slot.held.get(sender)
                if held is not None and slot.topic == topic:
                    for _ in range(min(count, len(held))):
                        slot.newest = held.popleft()

    def deliver(self) -> None:
        """Call each slot's callback with its newest message, once."""
        with self._lock:
            full = [(slot.callback, slot.newest) for slot in self._slots if slot.newest is not None]
            for slot in self._slots:
                slot.newest = None
        for callback, message in full:
            callback(message)
