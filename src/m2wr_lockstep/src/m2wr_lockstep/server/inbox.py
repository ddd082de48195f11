# SPDX-License-Identifier: BSD-3-Clause
"""Messages that the simulation has received, held back until they count.

Messages of a controller are held back until its answer has counted them.  So the effect of a command never depends on
how fast it arrived.
"""
import threading
from collections import deque


class _Slot:
    """The receiving end of one subscription."""

    def __init__(self, topic, callback):
        self.topic, self.callback = topic, callback
        self.held, self.newest, self.connected = {}, None, False


class Inbox:
    """Received messages, of which the newest is delivered: at the next step, or for controllers when it is counted.

    Parameters
    ----------
    on_arrival : callable
        Called in the receiving thread after a message was held back.
    """

    ANY_SENDER = "*"

    def __init__(self, on_arrival=lambda: None):
        self._lock, self._slots, self._on_arrival = threading.Lock(), [], on_arrival
        self._senders, self._answers = set(), {}

    def hold(self, sender):
        """Hold back what this sender publishes until :meth:`admit`."""
        self._senders.add(sender)

    def release(self, sender, passing=False):
        """Deliver what this sender publishes without delay again; of the held messages the newest passes, or none."""
        with self._lock:
            self._senders.discard(sender)
            self._release(sender, self._slots, passing)

    def hold_topic(self, topic, sender=None):
        """Hold back the messages of a topic, of one sender or of all, under the name :attr:`ANY_SENDER`."""
        self._answers[topic] = sender

    def release_topic(self, topic, passing=False):
        """Deliver the messages of a topic without delay again; of the held messages the newest passes, or none."""
        with self._lock:
            self._answers.pop(topic, None)
            self._release(self.ANY_SENDER, [slot for slot in self._slots if slot.topic == topic], passing)

    @staticmethod
    def _release(key, slots, passing):
        for slot in slots:
            held = slot.held.pop(key, None)
            if held and passing:
                slot.newest = held[-1]

    def open(self, topic, callback):
        """Return a new slot; it counts for :meth:`has` after :meth:`mark_connected`."""
        slot = _Slot(topic, callback)
        with self._lock:
            self._slots.append(slot)
        return slot

    def close(self, slot):
        """Remove a slot with its messages."""
        with self._lock:
            self._slots.remove(slot)

    def topics(self):
        """Return the topics there are slots of."""
        with self._lock:
            return {slot.topic for slot in self._slots}

    def mark_connected(self):
        """Record that all slots are connected to their publishers; returns the topics that were not."""
        with self._lock:
            fresh = {slot.topic for slot in self._slots if not slot.connected}
            for slot in self._slots:
                slot.connected = True
        return fresh

    def arrive(self, slot, sender, message):
        """Store a message from the network."""
        with self._lock:
            key = sender if sender in self._senders else None
            if key is None and slot.topic in self._answers and self._answers[slot.topic] in (None, sender):
                key = self.ANY_SENDER
            if key is None or not slot.connected:
                slot.newest = message
                return
            slot.held.setdefault(key, deque()).append(message)
        self._on_arrival()

    def has(self, topic, sender, count):
        """Return whether every slot of a topic holds at least ``count`` messages; true if there is no slot."""
        with self._lock:
            return all(len(slot.held.get(sender, ())) >= count
                       for slot in self._slots if slot.topic == topic and slot.connected)

    def held(self, topic, sender):
        """Return the number of held messages of a topic: the least over its slots, 0 without a slot."""
        with self._lock:
            return min((len(slot.held.get(sender, ()))
                        for slot in self._slots if slot.topic == topic and slot.connected), default=0)

    def admit(self, topic, sender, count):
        """Release the oldest ``count`` messages."""
        with self._lock:
            for slot in self._slots:
                held = slot.held.get(sender, ())
                for _ in range(min(count, len(held)) if slot.topic == topic else 0):
                    slot.newest = held.popleft()

    def deliver(self):
        """Call each slot's callback with its newest message, once."""
        with self._lock:
            full = [(slot.callback, slot.newest) for slot in self._slots if slot.newest is not None]
            for slot in self._slots:
                slot.newest = None
        for callback, message in full:
            callback(message)
