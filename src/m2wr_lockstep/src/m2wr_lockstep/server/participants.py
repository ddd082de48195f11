# SPDX-License-Identifier: BSD-3-Clause
"""Nodes that take part in lockstep besides the controllers: who replies to a topic, and who only listens."""
from __future__ import annotations

import re
from typing import Callable, Iterable, List, NamedTuple, Optional, Tuple

from m2wr_lockstep.errors import ConfigError

_REPLY = re.compile(r"^(/\S+) -> (/\S+?)(?: by (/\S+))?( once)?$")


class Listener(NamedTuple):
    """A node that must be connected before time begins; ``topics``: those it must subscribe to, at least.

    One that is ``respawned`` must be connected again before time continues after it has died.
    """

    name: str
    topics: Tuple[str, ...]
    respawned: bool = False


class Reply:
    """A topic on which a node answers each message of another topic with one message.

    Parameters
    ----------
    trigger, topic : str
        Published by the simulation; expected in return.
    sender : str or None
        Node whose answers count; None: any node's.
    once : bool
        Only the first message of ``trigger`` is answered.
    """

    def __init__(self, trigger: str, topic: str, sender: Optional[str] = None, once: bool = False) -> None:
        self.trigger, self.topic, self.sender, self.once = trigger, topic, sender, once
        self.seen, self.done, self.warned = 0, False, False

    def __str__(self) -> str:
        return "%s -> %s%s%s" % (self.trigger, self.topic, " by " + self.sender if self.sender else "",
                                 " once" if self.once else "")

    def due(self, count: int) -> int:
        """Return how many answers are outstanding when ``count`` messages of the trigger were published."""
        return 0 if self.done else min(count - self.seen, 1 if self.once else count)

    def answered(self, count: int) -> None:
        """Note that all answers have come."""
        self.seen, self.done = count, self.once


def read_replies(entries: Iterable[str], resolve: Callable[[str], str]) -> List[Reply]:
    """Read entries ``"TRIGGER -> TOPIC [by NODE] [once]"``.

    Parameters
    ----------
    entries : list of str
    resolve : callable
        Returns the remapped name of a topic or node.

    Returns
    -------
    list of Reply

    Raises
    ------
    ConfigError
        For an entry of another form.
    """
    replies = []
    for entry in entries:
        found = _REPLY.match(entry.strip())
        if found is None:
            raise ConfigError("parameter ~lockstep_replies has %r; expected \"/TRIGGER -> /TOPIC\", and after it, "
                              "optionally, \"by /NODE\" and \"once\"" % entry)
        trigger, topic, sender, once = found.groups()
        replies.append(Reply(resolve(trigger), resolve(topic), sender and resolve(sender), bool(once)))
    return replies


def read_listeners(entries: Iterable[str], resolve: Callable[[str], str]) -> List[Listener]:
    """Read entries ``"NODE [respawned]"`` or ``"NODE [respawned]: TOPIC TOPIC ..."``.

    Parameters
    ----------
    entries : list of str
    resolve : callable
        Returns the remapped name of a topic or node.

    Returns
    -------
    list of Listener

    Raises
    ------
    ConfigError
        For an entry of another form.
    """
    listeners = []
    for entry in entries:
        name, _, topics = entry.partition(":")
        name, *how = name.split() or [""]
        if not name or how not in ([], ["respawned"]):
            raise ConfigError("parameter ~lockstep_listeners has %r; expected \"/NODE\", after it, optionally, "
                              "\" respawned\", and then \": /TOPIC /TOPIC ...\"" % entry)
        listeners.append(Listener(resolve(name), tuple(map(resolve, topics.split())), bool(how)))
    return listeners
