# SPDX-License-Identifier: BSD-3-Clause
"""Messages that a controller has received and not used yet; ROS-free."""
from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Mapping, Optional, Tuple

#: Messages kept of each topic while no turn is requested.
KEPT = 1000
#: Wall seconds without a turn after which the older messages are dropped.
UNASKED = 30.0


class TurnError(Exception):
    """A turn is not possible; the text states what is missing."""


class Inputs:
    """Received messages, by topic, until a turn takes them.

    Messages are passed on in the order in which their topics were added: those of different connections have no order.
    While no turn is requested (before the first, after a failed one, or :data:`UNASKED` seconds after the newest) only
    the newest :data:`KEPT` messages of each topic are kept.

    Parameters
    ----------
    clock : callable
        Wall time [s].

    Attributes
    ----------
    dropped : int
        Messages that were not kept.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._changed, self._clock = threading.Condition(), clock
        #: topic: (callbacks, waiting (sender, message))
        self._topics: Dict[str, Tuple[List[Callable[[Any], object]], Deque[Tuple[Optional[str], Any]]]] = {}
        #: when the newest turn was taken; None before the first and after one that failed
        self._taken: Optional[float] = None
        self.dropped = 0

    def add(self, topic: str, callback: Callable[[Any], object]) -> None:
        """Add a topic, or another callback of it.

        Parameters
        ----------
        topic : str
            Its resolved name.
        callback : callable
            Called with each message in every turn.
        """
        with self._changed:
            self._topics.setdefault(topic, ([], deque()))[0].append(callback)

    def receive(self, topic: str, message: Any, sender: Optional[str] = None) -> None:
        """Keep a message; called from any thread.

        Parameters
        ----------
        topic : str
            One that was added.
        message : object
        sender : str, optional
            Name of the node that has sent it.
        """
        with self._changed:
            waiting = self._topics[topic][1]
            waiting.append((sender, message))
            if len(waiting) > KEPT and (self._taken is None or self._clock() - self._taken > UNASKED):
                self.dropped += len(waiting) - KEPT
                while len(waiting) > KEPT:
                    waiting.popleft()
            self._changed.notify_all()

    def take(self, counts: Mapping[str, int], patience: float, counted: Optional[Callable[[Any], bool]] = None,
             wanted: Optional[Callable[[Any], bool]] = None, sender: Optional[str] = None) -> None:
        """Wait for messages and pass on all that were received.

        Parameters
        ----------
        counts : dict
            How many messages of each topic belong to this turn; topics that were not added are ignored.
        patience : float
            Wall seconds to wait.
        counted, wanted : callable, optional
            Return whether ``counts`` includes a message, and whether an included message is passed on.  By default
            all are.
        sender : str, optional
            Node whose messages ``counts`` counts; those of other nodes are passed on as well.  By default all nodes'.

        Raises
        ------
        TurnError
            If messages are missing after that time; it names topics and numbers.
        """
        counted, wanted = counted or _all, wanted or _all
        deadline = self._clock() + patience
        with self._changed:
            missing = self._missing(counts, counted, sender)
            while missing:
                left = deadline - self._clock()
                if left <= 0.0:
                    self._taken = None
                    raise TurnError("after %g s still without %s" % (patience, ", ".join(missing)))
                self._changed.wait(left)
                missing = self._missing(counts, counted, sender)
            self._taken = self._clock()
            taken = [(callbacks, list(waiting)) for callbacks, waiting in self._topics.values()]
            for _, waiting in self._topics.values():
                waiting.clear()
        for callbacks, messages in taken:
            for _, message in messages:
                if counted(message) and wanted(message):
                    for callback in callbacks:
                        callback(message)

    def _missing(self, counts: Mapping[str, int], counted: Callable[[Any], bool], sender: Optional[str]) -> List[str]:
        missing = []
        for topic, (_, waiting) in self._topics.items():
            number = counts.get(topic, 0)
            here = sum(1 for whose, message in waiting if sender in (None, whose) and counted(message)) if number else 0
            if here < number:
                missing.append("%d of %d messages on %s%s" % (number - here, number, topic,
                                                              " by " + sender if sender else ""))
        return missing


def _all(_: Any) -> bool:
    return True
