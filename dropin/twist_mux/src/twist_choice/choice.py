# SPDX-License-Identifier: BSD-3-Clause
"""Which of several sources of commands is passed on: priorities, locks and timeouts, without ROS."""
from __future__ import annotations

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Set

from m2wr_node.numbers import number

HIGHEST = 255           # largest priority
MOST = 100              # sources in one list


class ConfigurationError(ValueError):
    """A list of topics or locks that cannot be used; the message names the entry and what was expected."""


class Source(NamedTuple):
    """One entry of the lists: ``timeout`` [s], 0: never; ``priority`` 0 to 255."""

    name: str
    topic: str
    timeout: float
    priority: int


def read_sources(value: Any, parameter: str) -> List[Source]:
    """Return the sources that a parameter lists.

    Parameters
    ----------
    value : object
        As the parameter server holds it: a list of dictionaries with name, topic, timeout and priority.
    parameter : str
        Its name, for messages.

    Raises
    ------
    ConfigurationError
        If it is no such list, if a name or a topic occurs twice, or a number is out of range.
    """
    if not isinstance(value, list):
        raise ConfigurationError("%s is %.60r; expected a list of {name, topic, timeout, priority}" % (
            parameter, value))
    if len(value) > MOST:
        raise ConfigurationError("%s has %d entries; expected at most %d" % (parameter, len(value), MOST))
    found: List[Source] = []
    for place, entry in enumerate(value):
        where = "%s[%d]" % (parameter, place)
        source = _source(entry, where)
        for other in found:
            for key in ("name", "topic"):
                if getattr(other, key) == getattr(source, key):
                    raise ConfigurationError("%s: the %s %r occurs twice" % (where, key, getattr(source, key)))
        found.append(source)
    return found


def _source(entry: Any, where: str) -> Source:
    if not isinstance(entry, dict):
        raise ConfigurationError("%s is %.60r; expected {name, topic, timeout, priority}" % (where, entry))
    missing = [key for key in Source._fields if key not in entry]
    if missing:
        raise ConfigurationError("%s has no %s; expected name, topic, timeout and priority" % (
            where, " and no ".join(missing)))
    for key in ("name", "topic"):
        if not isinstance(entry[key], str) or not entry[key]:
            raise ConfigurationError("%s: %s is %.60r; expected a text" % (where, key, entry[key]))
    timeout, priority = number(entry["timeout"]), number(entry["priority"])
    if timeout is None or not 0.0 <= timeout < math.inf:
        raise ConfigurationError("%s (%s): timeout is %.60r; expected seconds, 0 for none" % (
            where, entry["name"], entry["timeout"]))
    if priority is None or not 0 <= priority <= HIGHEST or priority != int(priority):
        raise ConfigurationError("%s (%s): priority is %.60r; expected a whole number from 0 to %d" % (
            where, entry["name"], entry["priority"], HIGHEST))
    return Source(entry["name"], entry["topic"], float(timeout), int(priority))


class Choice:
    """Decides which command passes.

    A command passes if its topic has the highest priority of all that have not expired, and at least that of the
    strongest lock.  Of equal priorities the first in the list passes; priority 0 never does.

    Parameters
    ----------
    topics : sequence of Source
        Sources of commands.
    locks : sequence of Source
        Sources of locks.
    """

    def __init__(self, topics: Sequence[Source], locks: Sequence[Source] = ()) -> None:
        self.topics, self.locks = list(topics), list(locks)
        self._heard: Dict[Source, float] = {}
        self._closed: Set[Source] = set()

    def hear_lock(self, lock: Source, closed: bool, now: float) -> None:
        """Note a message on a lock's topic.

        Parameters
        ----------
        lock : Source
            One of :attr:`locks`.
        closed : bool
            True: commands of lower priority are held back.
        now : float
            Time [s].
        """
        self._heard[lock] = now
        (self._closed.add if closed else self._closed.discard)(lock)

    def passes(self, topic: Source, now: float) -> bool:
        """Note a command on a topic, and return whether it is passed on.

        Parameters
        ----------
        topic : Source
            One of :attr:`topics`.
        now : float
            Time [s].

        Returns
        -------
        bool
        """
        self._heard[topic] = now
        return self.chosen(now) is topic

    def age(self, source: Source, now: float) -> float:
        """Return the time since the last message of a source [s]; infinite if there is none since time jumped back.

        Parameters
        ----------
        source : Source
            A topic or a lock.
        now : float
            Time [s].
        """
        age = now - self._heard.get(source, -math.inf)
        if age < 0.0:
            del self._heard[source]
            return math.inf
        return age

    def expired(self, source: Source, now: float) -> bool:
        """Return whether a source's last message is older than its timeout.

        Parameters
        ----------
        source : Source
            A topic or a lock.
        now : float
            Time [s].
        """
        return source.timeout > 0.0 and self.age(source, now) > source.timeout

    def locked(self, lock: Source, now: float) -> bool:
        """Return whether a lock holds commands back: closed by its last message, or expired.

        Parameters
        ----------
        lock : Source
            One of :attr:`locks`.
        now : float
            Time [s].
        """
        return lock in self._closed or self.expired(lock, now)

    def lock_priority(self, now: float) -> int:
        """Return the priority of the strongest lock that is closed; 0 if none is."""
        return max((lock.priority for lock in self.locks if self.locked(lock, now)), default=0)

    def masked(self, topic: Source, now: float) -> bool:
        """Return whether a topic is expired or held back by a lock.

        Parameters
        ----------
        topic : Source
            One of :attr:`topics`.
        now : float
            Time [s].
        """
        return self.expired(topic, now) or topic.priority < self.lock_priority(now)

    def chosen(self, now: float) -> Optional[Source]:
        """Return the topic whose commands pass at a time [s], or None."""
        found, highest = None, 0
        for topic in self.topics:
            if topic.priority > highest and not self.masked(topic, now):
                found, highest = topic, topic.priority
        return found
