"""What a controller keeps count of between two turns; knows nothing of ROS."""
import threading
import time
from collections import deque, namedtuple


class TurnError(Exception):
    """A turn cannot be taken; the text says what is missing."""


Published = namedtuple("Published", "early counts")
"""Messages published on one topic since the previous answer: before the turn began, and in it."""


class Inputs:
    """Messages that have come, by topic, until a turn takes them.

    Messages are handed over in the order in which their topics were added, because what comes on different connections
    has no order of its own.
    """

    def __init__(self):
        self._changed = threading.Condition()
        self._topics = {}           # topic: (callback, waiting messages)

    def add(self, topic, callback):
        """Hand messages of a topic to ``callback`` in every turn."""
        with self._changed:
            self._topics.setdefault(topic, ([], deque()))[0].append(callback)

    def receive(self, topic, message):
        """Keep a message; called from any thread."""
        with self._changed:
            self._topics[topic][1].append(message)
            self._changed.notify_all()

    def take(self, counts, patience, counted=None, wanted=None, clock=time.monotonic):
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

        Raises
        ------
        TurnError
            If messages are missing after that time; it names topics and numbers.
        """
        counted, wanted = counted or _all, wanted or _all
        deadline = clock() + patience
        with self._changed:
            missing = self._missing(counts, counted)
            while missing:
                left = deadline - clock()
                if left <= 0.0:
                    raise TurnError("after %g s still without %s" % (patience, ", ".join(missing)))
                self._changed.wait(left)
                missing = self._missing(counts, counted)
            taken = [(callbacks, list(waiting)) for callbacks, waiting in self._topics.values()]
            for _, waiting in self._topics.values():
                waiting.clear()
        for callbacks, messages in taken:
            for message in messages:
                if counted(message) and wanted(message):
                    for callback in callbacks:
                        callback(message)

    def _missing(self, counts, counted):
        missing = []
        for topic, (_, waiting) in self._topics.items():
            number = counts.get(topic, 0)
            here = sum(1 for message in waiting if counted(message)) if number else 0
            if here < number:
                missing.append("%d of %d messages on %s" % (number - here, number, topic))
        return missing


def _all(_):
    return True


class Outputs:
    """How many messages have been published, by topic, since the previous answer."""

    def __init__(self):
        self._lock, self._counts, self._early = threading.Lock(), {}, {}

    def count(self, topic):
        """Count a message; to be called before it is sent, so that what is counted is on its way."""
        with self._lock:
            self._counts[topic] = self._counts.get(topic, 0) + 1

    def begin(self):
        """A turn begins: what has been counted so far was early."""
        with self._lock:
            self._early, self._counts = self._counts, {}

    def end(self):
        """Return ``{topic: Published}`` since the previous answer, and start anew."""
        with self._lock:
            found = {topic: Published(self._early.get(topic, 0), self._counts.get(topic, 0))
                     for topic in sorted(set(self._early) | set(self._counts))}
            self._early, self._counts = {}, {}
        return found
