# SPDX-License-Identifier: BSD-3-Clause
"""Whether everybody who takes part in lockstep is there and connected, looked up in the ROS graph."""
import re
import socket
from collections import namedtuple
from http.client import HTTPConnection, HTTPException
from xmlrpc.client import Fault, ServerProxy, Transport

import rosgraph
import rospy
from rospy.topics import get_topic_manager

from m2wr_sim.ros.lockstep_reminder import Reminder

SERVICE = "lockstep_turn"
_ANSWER_PATIENCE = 2.0              # s of wall time for a node to tell of its connections
_PORTS = re.compile(r"connection on port (\d+) to \[.*:(\d+) on socket")
NOT_WAITED_FOR = ("/rosout", "/rosout_agg", "/diagnostics")

Listener = namedtuple("Listener", "name topics respawned", defaults=(False,))
"""A node that must be connected before time begins; ``topics``: those it must subscribe to, at least.

One that is ``respawned`` must be connected again before time goes on when it has died.
"""

Connection = namedtuple("Connection", "publisher subscriber topic ports")
"""``ports`` are those of the subscriber and the publisher, or None."""

Look = namedtuple("Look", "missing connections")
"""Sentences on what is missing, and the connections there are."""


class _BriefTransport(Transport):
    """XML-RPC that does not wait for ever."""

    def make_connection(self, host):
        if self._connection and host == self._connection[0]:
            return self._connection[1]
        self._connection = host, HTTPConnection(host, timeout=_ANSWER_PATIENCE)
        return self._connection[1]


def _slave(address):
    """Return the slave API of a node."""
    return ServerProxy(address, transport=_BriefTransport())


class Gate:
    """Looks at the graph; may be used from any thread.

    Parameters
    ----------
    controllers : list of str
        Names of the nodes that serve ``lockstep_turn``.
    listeners : list of Listener
    replies : list of Reply
    ticking : callable
        Tells whether the simulation has a topic that makes ticks.
    """

    def __init__(self, controllers, listeners, replies, ticking):
        self.controllers, self._listeners, self._replies = list(controllers), list(listeners), list(replies)
        self._ticking, self._own = ticking, rospy.get_name()
        self._master = rosgraph.Master(self._own)
        self._addresses, self._gone = {}, set()
        self._reminder = Reminder(self._own, self._address, _slave)

    def forget(self, name, connections):
        """Take the connections of a look to a subscriber that has died for gone: rospy notices when it writes to them.
        """
        self._gone |= {entry.ports for entry in connections if entry.subscriber == name and entry.ports}

    def look(self, without=()):
        """Return a :class:`Look`; ``without`` are controllers that are not waited for."""
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
        for name in sorted(self._unnamed(publishers) - nodes):      # some may be registered and long dead
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
        self._reminder.note([key for key in apart if answering.issuperset(key[:2])], publishers)
        return Look(missing, connections)

    def _unnamed(self, publishers):
        """Return who may send replies without having been named."""
        return {name for reply in self._replies if reply.sender is None for name in publishers.get(reply.topic, ())}

    def _absent_listeners(self, subscribers):
        missing = []
        for listener in self._listeners:
            heard = {topic for topic, nodes in subscribers.items() if listener.name in nodes}
            missing += ["%s to subscribe to %s" % (listener.name, topic) for topic in listener.topics
                        if topic not in heard]
            if not heard and not listener.topics:
                missing.append("%s to subscribe to anything" % listener.name)
        return missing

    def _absent_replies(self, publishers, subscribers, alive):
        missing = []
        for reply in self._replies:
            answering = publishers.get(reply.topic, set()) - {self._own}
            if not (reply.sender in answering if reply.sender else answering & alive):
                missing.append("%s to publish %s" % (reply.sender or "somebody", reply.topic))
            hearing = subscribers.get(reply.trigger, set()) - {self._own}
            if not (reply.sender in hearing if reply.sender else hearing & alive):
                missing.append("%s to subscribe to %s" % (reply.sender or "somebody", reply.trigger))
            if self._own not in publishers.get(reply.trigger, ()):
                missing.append("a robot that publishes %s" % reply.trigger)
        return missing

    def _connections(self, name):
        """Return the connections on which a node publishes; None if it cannot be reached."""
        if name == self._own:
            table = get_topic_manager().get_pub_sub_info()
        else:
            table = self._bus_info(name)
        if table is None:
            return None
        found = []
        for entry in table:
            if entry[2] == "o" and entry[5]:
                ports = _PORTS.search(entry[6]) if len(entry) > 6 else None
                found.append(Connection(name, entry[1], entry[4],
                                        (int(ports.group(2)), int(ports.group(1))) if ports else None))
        return found

    def _address(self, name):
        """Return the URI of a node's slave API; None if the master does not know it."""
        try:
            return self._master.lookupNode(name)
        except (rosgraph.MasterException, OSError, HTTPException):
            return None

    def _bus_info(self, name):
        for _ in range(2):              # the second time with the address that a restarted node has
            try:
                address = self._addresses.get(name) or self._master.lookupNode(name)
                self._addresses[name] = address
                code, _, table = _slave(address).getBusInfo(self._own)
                return table if code == 1 else None
            except (rosgraph.MasterException, OSError, HTTPException, Fault, socket.timeout):
                self._addresses.pop(name, None)
        return None
