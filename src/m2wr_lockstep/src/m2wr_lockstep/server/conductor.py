# SPDX-License-Identifier: BSD-3-Clause
"""Asks the controllers for their turns, one after another, while simulated time does not advance."""
from __future__ import annotations

import logging
from typing import Callable, Dict, Iterable, List, Mapping, NamedTuple, Optional, Protocol, Set, Tuple

from m2wr_lockstep.errors import LockstepError
from m2wr_lockstep.server.inbox import Inbox
from m2wr_lockstep.server.message_counts import MessageCounts
from m2wr_lockstep.server.participants import Reply

log = logging.getLogger(__name__)

_EARLY_PATIENCE = 1.0       # s of wall time for messages that may have been sent before the subscription was connected


class TurnRequest(NamedTuple):
    """Sent to a controller: tick number, time [ns], when it joined [ns], and {topic: number of new messages}."""

    tick: int
    now_ns: int
    since_ns: int
    news: Dict[str, int]


class TurnAnswer(NamedTuple):
    """A controller's answer; ``published`` holds (topic, messages before the turn, messages in the turn)."""

    published: Tuple[Tuple[str, int, int], ...]
    over: bool
    leave: bool
    note: str


class TurnFailed(Exception):
    """A controller cannot be reached or has refused; the text is the controller's."""


class PendingAnswer(Protocol):
    """The future answer to a request."""

    def done(self) -> bool:
        """Return whether there is an answer or an error."""

    def result(self) -> TurnAnswer:
        """Return the answer.

        Raises
        ------
        TurnFailed
        """


class Member:
    """A controller that takes part."""

    def __init__(self, name: str, since_ns: int, seen: Mapping[str, int]) -> None:
        self.name, self.since_ns, self.seen = name, since_ns, dict(seen)
        self.last: Optional[Tuple[int, int, str]] = None    # tick, time [ns] and note of its last answer
        self.newly_connected: Set[str] = set()  # topics that were not connected throughout since its previous answer

    def last_answer(self) -> str:
        """Return a description of its last answer."""
        if self.last is None:
            return "it has not answered any before"
        tick, now_ns, note = self.last
        said = ", saying \"%s\"" % note if note else ""
        return "its last answer was to tick %d at %.3f s%s" % (tick, now_ns * 1e-9, said)


class Conductor:
    """Asks the controllers for turns, in order, and waits for what they have published.

    Parameters
    ----------
    ask : callable
        ``ask(name, TurnRequest)`` does not block.  It returns an object with ``done()`` and ``result()``; the latter
        returns a :class:`TurnAnswer` or raises :class:`TurnFailed`.
    wait : callable
        ``wait(condition, seconds)`` returns whether the condition became true within that wall time.
    inbox : Inbox
    counts : MessageCounts
    replies : list of Reply
    patience : float
        Longest time for an answer [s], wall.
    continue_on_silence : bool
        Continue without a controller that does not answer, with a warning, instead of raising.
    settle : callable
        Called after each turn and each awaited reply; waits until the listeners have read what was sent.
    """

    def __init__(self, ask: Callable[[str, TurnRequest], PendingAnswer],
                 wait: Callable[[Callable[[], bool], float], bool], inbox: Inbox, counts: MessageCounts,
                 replies: Iterable[Reply] = (), patience: float = 10.0, continue_on_silence: bool = False,
                 settle: Callable[[], object] = lambda: None) -> None:
        self._ask, self._wait, self._inbox, self._counts = ask, wait, inbox, counts
        self._replies, self._patience, self._continue_on_silence, self._settle = (
            list(replies), patience, continue_on_silence, settle)
        self.members: List[Member] = []
        self.lost: List[str] = []           # names of controllers without which the run continues
        self.over: Optional[str] = None     # name of the controller that has ended the run
        self.ticks, self._last_ns = 0, 0
        for reply in self._replies:
            inbox.hold_topic(reply.topic, reply.sender)

    def join(self, name: str, now_ns: int, position: Optional[int] = None) -> None:
        """Add a controller from the next tick on.

        Parameters
        ----------
        name : str
            Name of its node.
        now_ns : int
            Simulated time [ns].
        position : int, optional
            Place in the order in which controllers are asked; by default the last.
        """
        since_ns = now_ns if self.ticks else 0
        self._inbox.hold(name)
        self.members.insert(len(self.members) if position is None else position,
                            Member(name, since_ns, self._counts.counts))
        if name in self.lost:
            self.lost.remove(name)

    def mark_connected(self) -> None:
        """Record that all nodes are connected to the simulation's subscriptions."""
        fresh = self._inbox.mark_connected()
        for member in self.members:
            member.newly_connected |= fresh

    def collect_replies(self, now_ns: int) -> None:
        """Wait for the replies to the messages published so far."""
        for reply in self._replies:
            published = self._counts.counts.get(reply.trigger, 0)
            due = reply.due(published)
            if due <= 0:
                reply.seen = published
                continue
            if not self._await_messages(reply.topic, Inbox.ANY_SENDER, due):
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

    def _admit_replies(self, reply: Reply, due: int, now_ns: int) -> None:
        """Release all held messages: a surplus one would otherwise be taken for the next reply, in every tick."""
        here = self._inbox.held(reply.topic, Inbox.ANY_SENDER)
        if here > due and not reply.once and not reply.warned:
            reply.warned = True
            log.warning("lockstep: %s: %d messages on %s at %.3f s where %d were due; the newest counts, and when it "
                        "does depends on how fast they come. Said once.", reply, here, reply.topic, now_ns * 1e-9, due)
        self._inbox.admit(reply.topic, Inbox.ANY_SENDER, due if reply.once else max(here, due))

    def _release(self, reply: Reply, passing: bool) -> None:
        if all(other.done for other in self._replies if other.topic == reply.topic):
            self._inbox.release_topic(reply.topic, passing)

    def tick(self, now_ns: int) -> None:
        """Ask every controller for its turn, in order.

        Raises
        ------
        LockstepError
            If one does not answer, unless ``continue_on_silence``.
        """
        self.ticks += 1
        if now_ns < self._last_ns:
            for member in self.members:
                member.since_ns = 0         # stamps of the time before the reset do not count
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
        # what was published before a turn belongs to an earlier controller's turn, so it counts before all commands
        for topic, name, count in early + own:
            self._inbox.admit(topic, name, count)
        for name in leavers:                # what they publish from now on is not counted
            self._inbox.release(name, passing=True)

    def _turn(self, member: Member, now_ns: int) -> Optional[TurnAnswer]:
        """Return a controller's answer when all it has published has arrived; None if the run continues without it."""
        request = TurnRequest(self.ticks, now_ns, member.since_ns, self._counts.since(member.seen))
        member.seen = dict(self._counts.counts)
        pending = self._ask(member.name, request)
        where = "tick %d at %.3f s" % (self.ticks, now_ns * 1e-9)
        if not self._wait(pending.done, self._patience):
            self._lose(member, "controller %s has not answered %s within %g s of wall time; %s"
                       % (member.name, where, self._patience, member.last_answer()))
            return None
        try:
            answer = pending.result()
        except TurnFailed as error:
            self._lose(member, "controller %s failed in %s (%s); %s"
                       % (member.name, where, error, member.last_answer()))
            return None
        published = []
        for topic, before, within in answer.published:
            before = self._arrived_before(member, topic, before, within)
            if not self._await_messages(topic, member.name, before + within):
                self._lose(member, "controller %s says in %s that it has published %d messages on %s, which "
                           "have not come within %g s of wall time"
                           % (member.name, where, before + within, topic, self._patience))
                return None
            published.append((topic, before, within))
        member.newly_connected.clear()
        member.last = (self.ticks, now_ns, answer.note)
        return answer._replace(published=tuple(published))

    def _arrived_before(self, member: Member, topic: str, before: int, within: int) -> int:
        """Return how many of the messages published before the turn are held back.

        Messages sent before the connection existed, or before the sender was held back, never are.  They are waited
        for only briefly, and only if there can be any.
        """
        if not before or not (member.last is None or topic in member.newly_connected):
            return before
        patience = min(_EARLY_PATIENCE, self._patience)
        if self._wait(lambda: self._inbox.has(topic, member.name, before + within), patience):
            return before
        return min(before, max(0, self._inbox.held(topic, member.name) - within))

    def _await_messages(self, topic: str, sender: str, count: int) -> bool:
        return self._wait(lambda: self._inbox.has(topic, sender, count), self._patience)

    def _lose(self, member: Member, sentence: str) -> None:
        self.members.remove(member)
        self.lost.append(member.name)
        self._inbox.release(member.name)
        self._silent(sentence)

    def _silent(self, sentence: str) -> None:
        if not self._continue_on_silence:
            raise LockstepError("lockstep: " + sentence)
        log.warning("lockstep: %s. The run continues without it.", sentence)
