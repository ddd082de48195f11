# SPDX-License-Identifier: BSD-3-Clause
"""The topic connections of a node, and how to drop one of this node's.

Need: lockstep starts when every subscriber is connected to every publisher.  The slave API's ``getBusInfo`` tells that
for other nodes, but only rospy's topic manager tells it for this one: a node that calls its own XML-RPC server while it
handles a call waits for itself.  The two ports of a connection are only in the text of its last field.

Uses: ``rospy.topics.get_topic_manager()`` with ``get_pub_sub_info()`` and ``get_subscriber_impl(topic)``; the text
"connection on port A to [HOST:B on socket N]" of ``TCPROSTransport.get_transport_info`` (roscpp writes the same).
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic).
Without it: no connection of this node is known or dropped, and ports are None; one line in the log.
"""
from __future__ import annotations

import logging
import re
from typing import Any, Iterable, List, NamedTuple, Optional, Sequence, Tuple

from rospy import topics

log = logging.getLogger(__name__)

_PORTS = re.compile(r"connection on port (\d+) to \[.*:(\d+) on socket")


class Connection(NamedTuple):
    """A topic connection; ``ports`` are those of the subscriber and the publisher, or None where they are not known."""

    publisher: str
    subscriber: str
    topic: str
    ports: Optional[Tuple[int, int]]


def own_bus_info() -> List[Sequence[Any]]:
    """Return the connections of this node in the form of the slave API's ``getBusInfo``."""
    try:
        return topics.get_topic_manager().get_pub_sub_info()
    except AttributeError as error:
        log.warning("this rospy does not tell the connections of its own node (%s)", error)
        return []


def published(publisher: str, bus_info: Iterable[Sequence[Any]]) -> List[Connection]:
    """Return the connections on which a node publishes.

    Parameters
    ----------
    publisher : str
        Name of the node.
    bus_info : list of lists
        What its ``getBusInfo`` returned.

    Returns
    -------
    list of Connection
    """
    found = []
    for entry in bus_info:
        if entry[2] == "o" and entry[5]:
            ports = _PORTS.search(entry[6]) if len(entry) > 6 else None
            found.append(Connection(publisher, entry[1], entry[4],
                                    (int(ports.group(2)), int(ports.group(1))) if ports else None))
    return found


def drop_connections(topic: str, uris: Sequence[Optional[str]]) -> int:
    """Close this node's connections of a topic to the publishers at ``uris``, so that it can connect to them again.

    rospy does not connect to a publisher to which it has a connection, even if the publisher has none.

    Parameters
    ----------
    topic : str
        Its resolved name.
    uris : list of str
        Slave APIs of the publishers; None, for an unknown one, is ignored.

    Returns
    -------
    int
        Number of connections that were closed.
    """
    try:
        subscriber = topics.get_topic_manager().get_subscriber_impl(topic)
        found = list(subscriber.connections) if subscriber is not None else []
    except AttributeError as error:
        log.warning("this rospy does not tell its connections on %s (%s)", topic, error)
        return 0
    dropped = [connection for connection in found if connection.endpoint_id in uris]
    for connection in dropped:
        connection.close()
    return len(dropped)
