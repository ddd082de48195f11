# SPDX-License-Identifier: BSD-3-Clause
"""Whether all nodes that take part in lockstep are running and connected, looked up in the ROS graph."""
from __future__ import annotations

import socket
from http.client import HTTPException
from typing import Any, Callable, Collection, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple
from xmlrpc.client import Fault, ServerProxy

import rosgraph
import rospy

from m2wr_lockstep.server.participants import Listener, Reply
from m2wr_lockstep.server.ros.reconnect import Reconnector
from m2wr_node.internals import connections as node_connections
from m2wr_node.internals.connections import Connection
from m2wr_node.ros.is_there import PatientTransport

SERVICE = "lockstep_turn"
NOT_WAITED_FOR = ("/rosout", "/rosout_agg", "/diagnostics")


class Look(NamedTuple):
    """Sentences on what is missing, and the present connections."""

    missing: List[str]
    connections: List[Connection]


def _slave(address: str) -> Any:
    """Return the slave API of a node; a call fails after some seconds without an answer."""
    return ServerProxy(address, transport=PatientTransport())


class Gate:
    """Looks at the ROS graph; may be used from any thread.

    Parameters
    ----------
    controllers : list of str
        Names of the nodes that serve ``lockstep_turn``.
    listeners : list of Listener
    replies : list of Reply
    ticking : callable
        Returns whether the simulation has a topic that makes ticks.
    """

    def __init__(self, controllers: Iterable[str], listeners: Iterable[Listener], replies: Iterable[Reply],
                 ticking: Callable[[], bool]) -> None:
        self.controllers, self._listeners, self._replies = list(controllers), list(listeners), list(replies)
        self._ticking, self._own = ticking, rospy.get_name()
        self._master = rosgraph.Master(self._own)
        self._addresses: Dict[str, str] = {}            # slave APIs, by node
        self._gone: Set[Tuple[int, int]] = set()        # ports of connections that are ignored
        self._reconnector = Reconnector(self._own, self._address, _slave)

    def forget(self, name: str, connections: Iterable[Connection]) -> None:
        """Ignore the connections to a subscriber that has died; rospy removes them only when it writes to them.

        Parameters
        ----------
        name : str
            The subscriber's.
        connections : iterable of Connection
            Those of this moment; of other nodes too.
        """
        self._gone |= {entry.ports for entry in connections if entry.subscriber == name and entry.ports}

    def look(self, without: Collection[str] = ()) -> Look:
        """Return a :class:`Look`; ``without`` are controllers that may be absent."""
        try:
            publishers, subscribers, services = (
                {name: set(nodes) for name, nodes in table} for table in self._master.getSystemState())
        except (rosgraph.MasterException, OSError, HTTPException) as error:
            return Look(["an answer of the master (%s)" % error], [])
        waited = [name for name in self.controllers if name not in without]
        nodes = {self._own} | set(waited) | {listener.name for listener in self._listeners} | {
            reply.sender for reply in self._replies if reply.sender}
        registered = {name for table in (publishers, subscribers, services) for names in table.values()
                      for name in names}
        missing = ["%s to serve %s/%s" % (name, name, SERVICE) for name in waited
                   if name not in services.get("%s/%s" % (name, SERVICE), ())]
        if not self._ticking():
            missing.append("a robot with a sensor that makes ticks")
        connections, answering = [], set()
        for name in sorted(nodes & registered):
            found = self._connections(name)
            if found is None:
                missing.append("an answer of the node %s" % name)
            else:
                answering.add(name)
            connections += found or []
        for name in sorted(self._unnamed(publishers) - nodes):      # some may be registered but have died
            found = self._connections(name)
            if found is not None:
                nodes.add(name)
                answering.add(name)
                connections += found
        missing += self._absent_listeners(subscribers) + self._absent_replies(publishers, subscribers, nodes)
        gone, apart = set(self._gone), []
        connections = [entry for entry in connections if entry.ports not in gone]
        there = {(entry.publisher, entry.subscriber, entry.topic) for entry in connections}
        for topic in sorted(set(publishers) & set(subscribers) - set(NOT_WAITED_FOR)):
            for publisher in sorted(publishers[topic] & nodes):
                for subscriber in sorted(subscribers[topic] & nodes):
                    if (publisher, subscriber, topic) not in there:
                        missing.append("%s to be connected to %s on %s" % (subscriber, publisher, topic))
                        apart.append((publisher, subscriber, topic))
        self._reconnector.note([key for key in apart if answering.issuperset(key[:2])], publishers)
        return Look(missing, connections)

    def _unnamed(self, publishers: Mapping[str, Set[str]]) -> Set[str]:
        """Return the nodes that publish replies of any sender."""
        return {name for reply in self._replies if reply.sender is None for name in publishers.get(reply.topic, ())}

    def _absent_listeners(self, subscribers: Mapping[str, Set[str]]) -> List[str]:
        missing: List[str] = []
        for listener in self._listeners:
            heard = {topic for topic, nodes in subscribers.items() if listener.name in nodes}
            missing += ["%s to subscribe to %s" % (listener.name, topic) for topic in listener.topics
                        if topic not in heard]
            if not heard and not listener.topics:
                missing.append("%s to subscribe to anything" % listener.name)
        return missing

    def _absent_replies(self, publishers: Mapping[str, Set[str]], subscribers: Mapping[str, Set[str]],
                        alive: Set[str]) -> List[str]:
        missing = []
        for reply in self._replies:
            answering = publishers.get(reply.topic, set()) - {self._own}
            if not (reply.sender in answering if reply.sender else answering & alive):
                missing.append("%s to publish %s" % (reply.sender or "a node", reply.topic))
            hearing = subscribers.get(reply.trigger, set()) - {self._own}
            if not (reply.sender in hearing if reply.sender else hearing & alive):
                missing.append("%s to subscribe to %s" % (reply.sender or "a node", reply.trigger))
            if self._own not in publishers.get(reply.trigger, ()):
                missing.append("a robot that publishes %s" % reply.trigger)
        return missing

    def _connections(self, name: str) -> Optional[List[Connection]]:
        """Return the connections on which a node publishes; None if it cannot be reached."""
        table = node_connections.own_bus_info() if name == self._own else self._bus_info(name)
        return None if table is None else node_connections.published(name, table)

    def _address(self, name: str) -> Optional[str]:
        """Return the URI of a node's slave API; None if the master does not know it."""
        try:
            return self._master.lookupNode(name)
        except (rosgraph.MasterException, OSError, HTTPException):
            return None

    def _bus_info(self, name: str) -> Optional[List[Sequence[Any]]]:
        for _ in range(2):              # the second time with the new address of a restarted node
            try:
                address = self._addresses.get(name) or self._master.lookupNode(name)
                self._addresses[name] = address
                code, _, table = _slave(address).getBusInfo(self._own)
                return table if code == 1 else None
            except (rosgraph.MasterException, OSError, HTTPException, Fault, socket.timeout):
                self._addresses.pop(name, None)
        return None
