# SPDX-License-Identifier: BSD-3-Clause
"""What a controller keeps count of between two turns; knows nothing of ROS."""
from __future__ import annotations

import threading
import time
from collections import deque, namedtuple
from typing import Any, Callable, Deque, Dict, List, Mapping, Optional, Tuple

#: Messages of each topic that are kept while nobody asks for turns.
KEPT = 1000
#: Wall seconds without a turn after which that is taken to be so.
UNASKED = 30.0


class TurnError(Exception):
    """A turn cannot be taken; the text says what is missing."""


Published = namedtuple("Published", "early counts")
"""Messages published on one topic since the previous answer: before the turn began, and in it."""


class Inputs:
    """Messages that have come, by topic, until a turn takes them.

    Messages are handed over in the order in which their topics were added, because what comes on different connections
    has no order of its own.  While nobody asks for turns (before the first, after one that failed, or long after the
    newest) only the newest :data:`KEPT` of each topic are kept.

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
        """Hand messages of a topic to ``callback`` in every turn."""
        with self._changed:
            self._topics.setdefault(topic, ([], deque()))[0].append(callback)

    def receive(self, topic: str, message: Any, sender: Optional[str] = None) -> None:
        """Keep a message; called from any thread."""
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
        """Wait for messages and hand over everything that has come.

        Parameters
        ----------
        counts : dict
            How many messages of each topic belong to this turn; topics that were not added are passed over.
        patience : float
            Wall seconds to wait.
        counted, wanted : callable, optional
            Tell of a message whether it is one of those that ``counts`` counts, and whether it is to be handed over
            when it is.  By default all are.
        sender : str, optional
            Whose messages ``counts`` counts; what others have sent is handed over as well.  By default everybody's.

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


class Outputs:
    """How many messages have been published, by topic, since the previous answer."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: Dict[str, int] = {}
        self._early: Dict[str, int] = {}

    def count(self, topic: str) -> None:
        """Count a message; to be called before it is sent, so that what is counted is on its way."""
        with self._lock:
            self._counts[topic] = self._counts.get(topic, 0) + 1

    def begin(self) -> None:
        """A turn begins: what has been counted so far was early."""
        with self._lock:
            self._early, self._counts = self._counts, {}

    def end(self) -> Dict[str, Published]:
        """Return ``{topic: Published}`` since the previous answer, and start anew."""
        with self._lock:
            found = {topic: Published(self._early.get(topic, 0), self._counts.get(topic, 0))
                     for topic in sorted(set(self._early) | set(self._counts))}
            self._early, self._counts = {}, {}
        return found
