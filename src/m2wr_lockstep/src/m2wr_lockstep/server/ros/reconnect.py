# SPDX-License-Identifier: BSD-3-Clause
"""Sends a subscriber the list of its publishers again when a connection is missing for too long.

rospy's subscriber connects when the master sends it the publishers of its topic (``publisherUpdate`` of the slave API).
It gives up when the publisher refuses, or when an older update is handled after a newer one; after other failures it
waits longer and longer.  The master sends an update only once, so it is repeated here.
"""
from __future__ import annotations

import logging
import time
from typing import Any, Callable, Collection, Dict, Iterable, List, Mapping, Optional, Tuple

from m2wr_node.internals.connections import drop_connections

log = logging.getLogger(__name__)

FIRST_PAUSE, LONGEST_PAUSE = 2.0, 30.0      # s of wall time a connection may take; doubled with every attempt


class Reconnector:
    """Records which connections are missing, and since when.

    Parameters
    ----------
    own : str
        Name of this node.
    address : callable
        Returns the URI of a node's slave API; None if the master does not know it.
    slave : callable
        Returns the slave API of a URI, for calls by XML-RPC.
    clock : callable
        Wall time [s].
    """

    def __init__(self, own: str, address: Callable[[str], Optional[str]], slave: Callable[[str], Any],
                 clock: Callable[[], float] = time.monotonic) -> None:
        self._own, self._address, self._slave, self._clock = own, address, slave, clock
        # (publisher, subscriber, topic): [time of the next update, pause before it]
        self._apart: Dict[Tuple[str, str, str], List[float]] = {}

    def note(self, apart: Iterable[Tuple[str, str, str]], publishers: Mapping[str, Collection[str]]) -> None:
        """Record the connections that are missing now; send updates for those missing for too long.

        Parameters
        ----------
        apart : iterable of (str, str, str)
            Publisher, subscriber and topic; both nodes are known to be alive.
        publishers : dict
            Topic to the names of all nodes that publish it, as the master has them.
        """
        now, apart = self._clock(), sorted(apart)
        self._apart = {key: self._apart.get(key, [now + FIRST_PAUSE, FIRST_PAUSE]) for key in apart}
        late = [key for key in apart if now >= self._apart[key][0]]
        for subscriber, topic in sorted({key[1:] for key in late}):
            missing = [key[0] for key in late if key[1:] == (subscriber, topic)]
            error = self._send(subscriber, topic, missing, publishers[topic])
            for entry in (self._apart[name, subscriber, topic] for name in missing):
                if entry[1] == FIRST_PAUSE:
                    log.warning("lockstep: %s has not connected to %s on %s within %g s; it is sent the publishers "
                                "again%s", subscriber, ", ".join(missing), topic, FIRST_PAUSE,
                                "" if error is None else ", which failed: %s" % error)
                entry[1] = min(LONGEST_PAUSE, 2.0 * entry[1])
                entry[0] = now + entry[1]

    def _send(self, subscriber: str, topic: str, missing: List[str], publishers: Collection[str]) -> Optional[str]:
        """Send a subscriber all its publishers, as some clients drop those not named; returns an error or None."""
        uris = [uri for uri in map(self._address, sorted(publishers)) if uri is not None]
        if subscriber == self._own:
            drop_connections(topic, [self._address(name) for name in missing])
        address = self._address(subscriber)
        if address is None:
            return "the master does not know its address"
        try:
            code, text, _ = self._slave(address).publisherUpdate(self._own, topic, uris)
        except Exception as error:          # it may just have ended; the XML-RPC library raises many kinds
            return "%s: %s" % (type(error).__name__, error)
        return None if code == 1 else text
