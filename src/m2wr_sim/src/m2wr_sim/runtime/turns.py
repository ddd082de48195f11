# SPDX-License-Identifier: BSD-3-Clause
"""Lockstep without ROS: whose turn it is, what is waited for, and the order in which commands count.

Simulated time stands still while the controllers take their turns, one after another.  Messages of a controller are
held back until its answer has counted them, so that what a command does never depends on how fast it came.
"""
import logging
import threading
from collections import deque, namedtuple

from m2wr_sim.errors import LockstepError

log = logging.getLogger(__name__)

_EARLY_PATIENCE = 1.0           # s of wall time for messages that may have been sent before anybody heard them

TurnRequest = namedtuple("TurnRequest", "tick now_ns since_ns news")
"""What a controller is told: number of the tick, time, since when it takes part, and {topic: new messages}."""

TurnAnswer = namedtuple("TurnAnswer", "published over leave note")
"""What a controller answers; ``published`` holds (topic, messages before the turn, messages in the turn)."""


class TurnFailed(Exception):
    """A controller cannot be asked, or has refused; the text is its own."""


class _Slot:
    """The receiving end of one subscription."""

    def __init__(self, topic, callback):
        self.topic, self.callback = topic, callback
        self.held, self.newest, self.wired = {}, None, False


class Inbox:
    """Messages that have come, of which the newest is delivered: at once for strangers, when counted for controllers.

    Parameters
    ----------
    on_arrival : callable
        Called, in the thread that brought it, after a message was held back.
    """

    ANYBODY = "*"

    def __init__(self, on_arrival=lambda: None):
        self._lock, self._slots, self._on_arrival = threading.Lock(), [], on_arrival
        self._senders, self._answers = set(), {}

    def hold(self, sender):
        """Hold back what this sender sends until :meth:`admit`."""
        self._senders.add(sender)

    def release(self, sender, passing=False):
        """Treat the sender as a stranger from now on; of what was held back the newest passes, or none."""
        with self._lock:
            self._senders.discard(sender)
            self._let_go(sender, self._slots, passing)

    def hold_topic(self, topic, sender=None):
        """Hold back what comes on a topic, by one sender or anybody, under the name :attr:`ANYBODY`."""
        self._answers[topic] = sender

    def release_topic(self, topic, passing=False):
        """Hold back no more what comes on a topic; of what was held back the newest passes, or none."""
        with self._lock:
            self._answers.pop(topic, None)
            self._let_go(self.ANYBODY, [slot for slot in self._slots if slot.topic == topic], passing)

    @staticmethod
    def _let_go(key, slots, passing):
        for slot in slots:
            held = slot.held.pop(key, None)
            if held and passing:
                slot.newest = held[-1]

    def open(self, topic, callback):
        """Return a new slot; it counts for :meth:`has` once :meth:`settle` was called."""
        slot = _Slot(topic, callback)
        with self._lock:
            self._slots.append(slot)
        return slot

    def close(self, slot):
        """Forget a slot and what is in it."""
        with self._lock:
            self._slots.remove(slot)

    def topics(self):
        """Return the topics there are slots of."""
        with self._lock:
            return {slot.topic for slot in self._slots}

    def settle(self):
        """Note that all slots there are now are connected to everybody who sends; returns the topics that were not."""
        with self._lock:
            fresh = {slot.topic for slot in self._slots if not slot.wired}
            for slot in self._slots:
                slot.wired = True
        return fresh

    def arrive(self, slot, sender, message):
        """Take a message from the network."""
        with self._lock:
            key = sender if sender in self._senders else None
            if key is None and slot.topic in self._answers and self._answers[slot.topic] in (None, sender):
                key = self.ANYBODY
            if key is None or not slot.wired:
                slot.newest = message
                return
            slot.held.setdefault(key, deque()).append(message)
        self._on_arrival()

    def has(self, topic, sender, count):
        """Tell whether so many messages are held back in every slot of a topic; true where there is none."""
        with self._lock:
            return all(len(slot.held.get(sender, ())) >= count
                       for slot in self._slots if slot.topic == topic and slot.wired)

    def held(self, topic, sender):
        """Return how many messages are held back in the slot of a topic that has the fewest; 0 where there is none."""
        with self._lock:
            return min([len(slot.held.get(sender, ())) for slot in self._slots if slot.topic == topic and slot.wired],
                       default=0)

    def admit(self, topic, sender, count):
        """Let the first ``count`` messages pass."""
        with self._lock:
            for slot in self._slots:
                held = slot.held.get(sender, ())
                for _ in range(min(count, len(held)) if slot.topic == topic else 0):
                    slot.newest = held.popleft()

    def deliver(self):
        """Hand the newest message of each slot to its callback, once."""
        with self._lock:
            full = [(slot.callback, slot.newest) for slot in self._slots if slot.newest is not None]
            for slot in self._slots:
                slot.newest = None
        for callback, message in full:
            callback(message)


class Ledger:
    """How many messages the simulation has published, by topic."""

    def __init__(self):
        self.counts = {}

    def count(self, topic):
        """Count a message."""
        self.counts[topic] = self.counts.get(topic, 0) + 1

    def since(self, seen):
        """Return ``{topic: messages}`` since the counts were ``seen``, without zeros."""
        return {topic: count - seen.get(topic, 0) for topic, count in self.counts.items() if count > seen.get(topic, 0)}


class Member:
    """A controller that takes part."""

    def __init__(self, name, since_ns, seen):
        self.name, self.since_ns, self.seen, self.last = name, since_ns, dict(seen), None
        self.fresh = set()          # topics that were not heard all the time since its previous answer

    def last_words(self):
        """Say what it said last."""
        if self.last is None:
            return "it has not answered any before"
        tick, now_ns, note = self.last
        said = ", saying \"%s\"" % note if note else ""
        return "its last answer was to tick %d at %.3f s%s" % (tick, now_ns * 1e-9, said)


class Reply:
    """A topic on which one message answers each message of another topic.

    Parameters
    ----------
    trigger, topic : str
        Published by the simulation; expected in return.
    sender : str or None
        Whose answers count; None: anybody's.
    once : bool
        Only the first message of ``trigger`` is answered.
    """

    def __init__(self, trigger, topic, sender=None, once=False):
        self.trigger, self.topic, self.sender, self.once = trigger, topic, sender, once
        self.seen, self.done, self.warned = 0, False, False

    def __str__(self):
        return "%s -> %s%s%s" % (self.trigger, self.topic, " by " + self.sender if self.sender else "",
                                 " once" if self.once else "")

    def due(self, count):
        """Return how many answers are outstanding when ``count`` messages of the trigger were published."""
        return 0 if self.done else min(count - self.seen, 1 if self.once else count)

    def answered(self, count):
        """Note that all answers have come."""
        self.seen, self.done = count, self.once


class Conductor:
    """Lets controllers take turns.

    Parameters
    ----------
    ask : callable
        ``ask(name, TurnRequest)`` returns at once an object with ``done()`` and ``result()``, which returns a
        :class:`TurnAnswer` or raises :class:`TurnFailed`.
    wait : callable
        ``wait(condition, seconds)`` returns whether the condition came true in that wall time.
    inbox : Inbox
    ledger : Ledger
    replies : list of Reply
    patience : float
        Wall seconds that an answer may take.
    go_on : bool
        Leave out a controller that is silent, with a warning, instead of raising.
    settle : callable
        Called after each turn, and after each reply that was waited for; waits until everybody has read what was sent.
    """

    def __init__(self, ask, wait, inbox, ledger, replies=(), patience=10.0, go_on=False, settle=lambda: None):
        self._ask, self._wait, self._inbox, self._ledger = ask, wait, inbox, ledger
        self._replies, self._patience, self._go_on, self._settle = list(replies), patience, go_on, settle
        self.members, self.lost = [], []
        self.ticks, self.over = 0, None
        self._last_ns = 0
        for reply in self._replies:
            inbox.hold_topic(reply.topic, reply.sender)

    def join(self, name, now_ns, position=None):
        """Let a controller take part from the next tick on, in the place of the order given."""
        since_ns = now_ns if self.ticks else 0
        self._inbox.hold(name)
        self.members.insert(len(self.members) if position is None else position,
                            Member(name, since_ns, self._ledger.counts))
        if name in self.lost:
            self.lost.remove(name)

    def connected(self):
        """Note that everybody is connected to what the simulation hears now."""
        fresh = self._inbox.settle()
        for member in self.members:
            member.fresh |= fresh

    def collect_replies(self, now_ns):
        """Wait for what is owed in return for messages published so far."""
        for reply in self._replies:
            published = self._ledger.counts.get(reply.trigger, 0)
            due = reply.due(published)
            if due <= 0:
                reply.seen = published
                continue
            if not self._wait(lambda: self._inbox.has(reply.topic, Inbox.ANYBODY, due), self._patience):
                self._silent("%s: no answer on %s%s to %s at %.3f s within %g s of wall time"
                             % (reply, reply.topic, " by " + reply.sender if reply.sender else "", reply.trigger,
                                now_ns * 1e-9, self._patience))
                reply.done = True
                self._release(reply, False)
                continue
            self._admit_replies(reply, due, now_ns)
            reply.answered(published)
            if reply.done:
                self._release(reply, True)
            self._settle()

    def _admit_replies(self, reply, due, now_ns):
        """Let all pass that is here: one too many would otherwise stand for the next reply, for good."""
        here = self._inbox.held(reply.topic, Inbox.ANYBODY)
        if here > due and not reply.once and not reply.warned:
            reply.warned = True
            log.warning("lockstep: %s: %d messages on %s at %.3f s where %d were due; the newest counts, and when it "
                        "does depends on how fast they come. Said once.", reply, here, reply.topic, now_ns * 1e-9, due)
        self._inbox.admit(reply.topic, Inbox.ANYBODY, due if reply.once else max(here, due))

    def _release(self, reply, passing):
        if all(other.done for other in self._replies if other.topic == reply.topic):
            self._inbox.release_topic(reply.topic, passing)

    def tick(self, now_ns):
        """Let every controller take its turn, in order.

        Raises
        ------
        LockstepError
            If one does not answer, unless ``go_on``.
        """
        self.ticks += 1
        if now_ns < self._last_ns:
            for member in self.members:
                member.since_ns = 0         # the old time and its stamps are gone
        self._last_ns = now_ns
        early, own, leavers = [], [], []
        for member in list(self.members):
            answer = self._turn(member, now_ns)
            if answer is None:
                continue
            for topic, before, within in answer.published:
                early.append((topic, member.name, before))
                own.append((topic, member.name, within))
            self._settle()
            if answer.over:
                self.over = member.name
            if answer.over or answer.leave:
                self.members.remove(member)
                leavers.append(member.name)
        # what somebody published before its turn was asked for in the turn of another, which came before all commands
        for topic, name, count in early + own:
            self._inbox.admit(topic, name, count)
        for name in leavers:                # what they send from now on nobody counts
            self._inbox.release(name, passing=True)

    def _turn(self, member, now_ns):
        """Return a controller's answer when all it has published is here; None if it is left out from now on."""
        request = TurnRequest(self.ticks, now_ns, member.since_ns, self._ledger.since(member.seen))
        member.seen = dict(self._ledger.counts)
        pending = self._ask(member.name, request)
        where = "tick %d at %.3f s" % (self.ticks, now_ns * 1e-9)
        if not self._wait(pending.done, self._patience):
            return self._lose(member, "controller %s has not answered %s within %g s of wall time; %s"
                              % (member.name, where, self._patience, member.last_words()))
        try:
            answer = pending.result()
        except TurnFailed as error:
            return self._lose(member, "controller %s failed in %s (%s); %s"
                              % (member.name, where, error, member.last_words()))
        published = []
        for topic, before, within in answer.published:
            before = self._heard_before(member, topic, before, within)
            if not self._wait(lambda: self._inbox.has(topic, member.name, before + within), self._patience):
                return self._lose(member, "controller %s says in %s that it has published %d messages on %s, which "
                                  "have not come within %g s of wall time"
                                  % (member.name, where, before + within, topic, self._patience))
            published.append((topic, before, within))
        member.fresh.clear()
        member.last = (self.ticks, now_ns, answer.note)
        return answer._replace(published=tuple(published))

    def _heard_before(self, member, topic, before, within):
        """Return how many of the messages from before the turn are held back.

        What was sent before the connection was made, or before the sender was held back, is not: such messages are
        waited for briefly only, and only where there can be any.
        """
        if not before or not (member.last is None or topic in member.fresh):
            return before
        patience = min(_EARLY_PATIENCE, self._patience)
        if self._wait(lambda: self._inbox.has(topic, member.name, before + within), patience):
            return before
        return min(before, max(0, self._inbox.held(topic, member.name) - within))

    def _lose(self, member, sentence):
        self.members.remove(member)
        self.lost.append(member.name)
        self._inbox.release(member.name)
        self._silent(sentence)

    def _silent(self, sentence):
        if not self._go_on:
            raise LockstepError("lockstep: " + sentence)
        log.warning("lockstep: %s. Time goes on without it.", sentence)
