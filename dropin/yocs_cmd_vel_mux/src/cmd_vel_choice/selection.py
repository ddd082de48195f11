# SPDX-License-Identifier: BSD-3-Clause
"""Which source of velocity commands drives the robot: a file of sources, their priorities and timeouts, without ROS."""
from __future__ import annotations

import math
from typing import Any, List, NamedTuple, Optional, Tuple

import yaml

from m2wr_node.numbers import number

MOST = 100                      # sources
LONGEST = 1 << 16               # bytes of a file
HIGHEST = 2 ** 31 - 1           # priority
OUTPUT = "output"               # topic, where the file names none
_EXPECTED = "expected a list of {name, topic, timeout, priority}"


class ConfigurationError(ValueError):
    """A file that cannot be used; the message names the entry and what was expected."""


class Source(NamedTuple):
    """Who may drive: ``timeout`` [s] without a command after which another source may."""

    name: str
    topic: str
    timeout: float
    priority: int


def read_sources(text: str, where: str) -> Tuple[List[Source], str]:
    """Return the sources that a file lists, and the topic of the output.

    Parameters
    ----------
    text : str
        YAML: ``subscribers``, a list of {name, topic, timeout, priority}, and ``publisher``, a topic.
    where : str
        Name of the file, for messages.

    Raises
    ------
    ConfigurationError
        If it is no such YAML, if a name or a topic occurs twice, or a number is out of range.
    """
    if len(text) > LONGEST:
        raise ConfigurationError("%s has %d characters; expected at most %d" % (where, len(text), LONGEST))
    try:
        document = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise ConfigurationError("%s is no YAML: %s" % (where, " ".join(str(error).split()))) from None
    if not isinstance(document, dict):
        raise ConfigurationError("%s: %.60r; expected the keys subscribers and publisher" % (where, document))
    entries, output = document.get("subscribers"), document.get("publisher", OUTPUT)
    if not isinstance(entries, list) or not 1 <= len(entries) <= MOST:
        raise ConfigurationError("%s: subscribers is %.60r; %s, with 1 to %d entries" % (
            where, entries, _EXPECTED, MOST))
    if not isinstance(output, str) or not output:
        raise ConfigurationError("%s: publisher is %.60r; expected a topic" % (where, output))
    found: List[Source] = []
    for place, entry in enumerate(entries):
        source = _source(entry, "%s: subscribers[%d]" % (where, place))
        if any(source.name == other.name or source.topic == other.topic for other in found):
            raise ConfigurationError("%s: subscribers[%d]: the name %r or the topic %r occurs twice" % (
                where, place, source.name, source.topic))
        found.append(source)
    return found, output


def _source(entry: Any, where: str) -> Source:
    values: List[Any] = [entry.get(key) for key in Source._fields] if isinstance(entry, dict) else []
    if not values or not all(isinstance(text, str) and text for text in values[:2]):
        raise ConfigurationError("%s is %.60r; %s" % (where, entry, _EXPECTED))
    timeout, priority = number(values[2]), number(values[3])
    if timeout is None or not 0.0 <= timeout < math.inf:
        raise ConfigurationError("%s: timeout is %.60r; expected seconds" % (where, values[2]))
    if priority is None or not 0 <= priority <= HIGHEST or priority != int(priority):
        raise ConfigurationError("%s: priority is %.60r; expected a whole number from 0 to %d" % (
            where, values[3], HIGHEST))
    return Source(values[0], values[1], float(timeout), int(priority))


class Selection:
    """Decides which command passes.

    A command passes if no other source drives or the one that does has a lower priority. A source drives until its
    last command is older than its timeout.
    """

    def __init__(self) -> None:
        self.active: Optional[Source] = None
        self._last = 0.0

    def passes(self, source: Source, now: float) -> bool:
        """Return whether a command passes that came now.

        Parameters
        ----------
        source : Source
        now : float
            Time [s].
        """
        self.expire(now)
        if self.active is not None and self.active != source and source.priority <= self.active.priority:
            return False
        self.active, self._last = source, now
        return True

    def expire(self, now: float) -> None:
        """Stop the source that drives if its last command is too old, or if time has jumped back.

        Parameters
        ----------
        now : float
            Time [s].
        """
        if self.active is not None and not 0.0 <= now - self._last <= self.active.timeout:
            self.active = None
