# SPDX-License-Identifier: BSD-3-Clause
"""Tells subscribers of their publishers once more when a connection that should be there does not come.

rospy's subscriber connects once, when the master tells it of a publisher, and gives up for good when that fails: the
publisher refused, or the news was overtaken by older news that was put down later; after any other failure it waits
ever longer.  The master does not tell twice.  What it tells is told here again, in the same words.
"""
import logging
import time

from rospy.topics import get_topic_manager

log = logging.getLogger(__name__)

FIRST_PAUSE, LONGEST_PAUSE = 2.0, 30.0      # s of wall time a connection may take; doubled with every attempt


class Reminder:
    """Keeps note of the connections that are missing.

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

    def __init__(self, own, address, slave, clock=time.monotonic):
        self._own, self._address, self._slave, self._clock = own, address, slave, clock
        self._apart = {}                    # (publisher, subscriber, topic): [when to tell, the pause until then]

    def note(self, apart, publishers):
        """Take note of the connections that are missing now, and tell the subscribers of those missing for too long.

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
            told = self._tell(subscriber, topic, missing, publishers[topic])
            for entry in (self._apart[name, subscriber, topic] for name in missing):
                if entry[1] == FIRST_PAUSE:
                    log.warning("lockstep: %s has not connected to %s on %s within %g s; it is told of the publishers "
                                "again%s", subscriber, ", ".join(missing), topic, FIRST_PAUSE,
                                "" if told is None else ", which failed: %s" % told)
                entry[1] = min(LONGEST_PAUSE, 2.0 * entry[1])
                entry[0] = now + entry[1]

    def _tell(self, subscriber, topic, missing, publishers):
        """Tell a subscriber of all publishers, for some implementations part with those not named; returns what failed.
        """
        uris = [uri for uri in map(self._address, sorted(publishers)) if uri is not None]
        if subscriber == self._own:
            drop_connections(topic, [self._address(name) for name in missing])
        try:
            code, text, _ = self._slave(self._address(subscriber)).publisherUpdate(self._own, topic, uris)
        except Exception as error:          # it may just have ended; the XML-RPC library raises many kinds
            return "%s: %s" % (type(error).__name__, error)
        return None if code == 1 else text


def drop_connections(topic, uris):
    """Close what this node takes for connections to publishers that know nothing of them: it would not make new ones.
    """
    subscriber = get_topic_manager().get_subscriber_impl(topic)
    for connection in list(subscriber.connections) if subscriber is not None else ():
        if connection.endpoint_id in uris:
            connection.close()
