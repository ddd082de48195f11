# SPDX-License-Identifier: BSD-3-Clause
"""Waits until the listeners have read all messages that were sent to them."""
from __future__ import annotations

import logging
import time
from typing import Callable, Iterable, List, NamedTuple, Optional

import rospy

from m2wr_lockstep.errors import LockstepError
from m2wr_lockstep.server.interfaces import Loop
from m2wr_lockstep.server.participants import Listener
from m2wr_lockstep.server.ros.gate import NOT_WAITED_FOR
from m2wr_node.internals.connections import Connection
from m2wr_node.internals.unread_bytes import Ends, UnreadBytes, find_ends

log = logging.getLogger(__name__)

_POLL_PAUSE = 0.0001            # s of wall time between two looks at a socket; the kernel sends no event for it


class Link(NamedTuple):
    """A connection on which ``reader`` receives from ``publisher``; ``ends`` are (address, port) of both."""

    publisher: str
    reader: str
    topic: str
    ends: Ends


class ListenerBarrier:
    """Waits for listeners; all methods but the constructor are called in the simulation's thread.

    Parameters
    ----------
    listeners : list of Listener
    patience : float
        Longest time for a listener to read [s], wall.
    continue_on_silence : bool
        Continue without a listener that does not read, with a warning, instead of raising.
    on_death : callable
        ``on_death(name)`` is called when a respawned listener has died.

    Attributes
    ----------
    all, shared, foreign : list of Link
        All links; of those on topics that a listener receives from several publishers, this node's and the others'.
    """

    _loop: Loop                         # from attach() on

    def __init__(self, listeners: List[Listener], patience: float, continue_on_silence: bool,
                 on_death: Callable[[str], object]) -> None:
        self._listeners, self._patience, self._continue_on_silence = listeners, patience, continue_on_silence
        self._on_death = on_death
        self._unread: Optional[UnreadBytes] = None
        self.all: List[Link] = []
        self.shared: List[Link] = []
        self.foreign: List[Link] = []

    def attach(self, loop: Loop) -> None:
        """Set the loop of the node; see :meth:`Lockstep.attach`."""
        self._loop = loop

    def connect(self, connections: Iterable[Connection]) -> None:
        """Find the sockets of the listeners among the present connections, a list of Connection."""
        names = {listener.name for listener in self._listeners}
        wanted = [entry for entry in connections
                  if entry.subscriber in names and entry.publisher not in names and entry.topic not in NOT_WAITED_FOR]
        ends = find_ends({entry.ports for entry in wanted if entry.ports})
        self.all = [Link(entry.publisher, entry.subscriber, entry.topic, ends[entry.ports])
                    for entry in wanted if entry.ports in ends]
        # messages can be read in another order than they were sent only if several nodes publish on one topic
        received = [(entry.topic, entry.reader) for entry in self.all]
        several = [entry for entry in self.all if received.count((entry.topic, entry.reader)) > 1]
        self.shared = [entry for entry in several if entry.publisher == rospy.get_name()]
        self.foreign = [entry for entry in several if entry.publisher != rospy.get_name()]
        unseen = sorted({entry.subscriber for entry in wanted if entry.ports not in ends})
        try:
            if self._unread is None and self.all:
                self._unread = UnreadBytes()
        except OSError:
            unseen, self.all, self.shared, self.foreign = sorted(names), [], [], []
        if unseen:
            log.warning("lockstep: cannot determine whether %s has read its messages (it runs on another machine, or "
                        "the system does not report it); if several nodes publish on one topic, their messages may "
                        "arrive in another order",
                        ", ".join(unseen))

    def wait(self, links: Iterable[Link], between_steps: bool = True) -> None:
        """Wait until the listeners have read everything; between two steps, requests are served meanwhile.

        Parameters
        ----------
        links : list of Link
            :attr:`all`, :attr:`shared` or :attr:`foreign`.
        between_steps : bool
            False within a step: then no request is served, and a shutdown only ends the waiting.

        Raises
        ------
        LockstepError
            If one does not read, unless the run continues without it.
        Exception
            As the loop's ``wait_until`` raises if the node is to end meanwhile.
        """
        for link in list(links):
            deadline = None
            while self._bytes_left(link):
                now = time.monotonic()
                deadline = deadline or now + self._patience
                if now > deadline:
                    self._lose(link)
                    break
                if between_steps:
                    self._loop.wait_until(lambda: False, _POLL_PAUSE)
                elif self._loop.stopping():
                    return
                else:
                    time.sleep(_POLL_PAUSE)

    def _bytes_left(self, link: Link) -> Optional[int]:
        assert self._unread is not None         # connect() sets it where it finds a link
        try:
            unread = self._unread.of(link.ends)
        except OSError as error:
            log.warning("lockstep: cannot determine whether %s has read what %s sent on %s (%s); the run continues "
                        "without waiting for it", link.reader, link.publisher, link.topic, error)
            unread = None
        if unread is None:                  # the connection is closed; only a respawned listener comes back
            if any(entry.name == link.reader and entry.respawned for entry in self._listeners):
                self._on_death(link.reader)
                self._forget(lambda entry: entry.reader == link.reader)
            else:
                self._forget(lambda entry: entry is link)
        return unread

    def _forget(self, which: Callable[[Link], bool]) -> None:
        self.all, self.shared, self.foreign = ([entry for entry in links if not which(entry)] for links in (
            self.all, self.shared, self.foreign))

    def _lose(self, link: Link) -> None:
        sentence = "%s has not read what %s sent on %s within %g s of wall time" % (
            link.reader, link.publisher, link.topic, self._patience)
        if not self._continue_on_silence:
            raise LockstepError("lockstep: " + sentence)
        log.warning("lockstep: %s. The run continues without waiting for it.", sentence)
        self._forget(lambda entry: entry.reader == link.reader)
