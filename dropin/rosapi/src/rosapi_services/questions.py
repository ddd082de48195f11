# SPDX-License-Identifier: BSD-3-Clause
"""Answers about topics, services and nodes, from the master."""
from __future__ import annotations

import http.client
import struct
import xmlrpc.client
from typing import Any, Callable, Dict, List, Tuple
from urllib.parse import urlsplit

import rosgraph
import rosgraph.network
import rosnode
import rosservice

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.rosbridge.globs import Globs

#: Topics of an action, below its name.
_ACTION = ("goal", "cancel", "status", "feedback", "result")
#: Errors of a master, node or service that does not answer, or at whose address another program listens.
UNREACHABLE = (OSError, rosgraph.MasterException, rosnode.ROSNodeException, rosservice.ROSServiceException,
               rosgraph.network.ROSHandshakeException, struct.error, UnicodeError, http.client.HTTPException,
               xmlrpc.client.Error)


class Questions:
    """Asks the master.

    Parameters
    ----------
    name : str
        Of the node.
    topics, services : Globs
        Names that are told.
    """

    def __init__(self, name: str, topics: Globs, services: Globs) -> None:
        self._name, self._topics, self._services = name, topics, services

    def _ask(self, question: Callable[[Any], Any]) -> Any:
        try:
            return question(rosgraph.Master(self._name))
        except UNREACHABLE as error:
            raise BridgeError("the master does not answer: %s" % error) from error

    def _state(self) -> Tuple[Dict[str, List[str]], Dict[str, List[str]], Dict[str, List[str]]]:
        """Return {name: nodes} of publishers, subscribers and services."""
        state = self._ask(lambda master: master.getSystemState())
        published, subscribed, served = ({name: list(nodes) for name, nodes in part} for part in state)
        return ({name: nodes for name, nodes in published.items() if self._topics.allow(name)},
                {name: nodes for name, nodes in subscribed.items() if self._topics.allow(name)},
                {name: nodes for name, nodes in served.items() if self._services.allow(name)})

    def topics(self) -> Dict[str, str]:
        """Return {topic: type} of all topics that are published or subscribed to."""
        published, subscribed, _ = self._state()
        types = dict(self._ask(lambda master: master.getTopicTypes()))
        names = sorted({**published, **subscribed})
        return {name: "" if types.get(name, "*") == "*" else types[name] for name in names}

    def publishers(self, topic: str) -> List[str]:
        """Return the nodes that publish a topic."""
        return self._state()[0].get(topic, [])

    def subscribers(self, topic: str) -> List[str]:
        """Return the nodes that subscribe to a topic."""
        return self._state()[1].get(topic, [])

    def services(self) -> List[str]:
        """Return the names of all services."""
        return sorted(self._state()[2])

    def nodes(self) -> List[str]:
        """Return the names of all nodes."""
        return sorted({node for part in self._state() for nodes in part.values() for node in nodes})

    def details(self, node: str) -> Tuple[List[str], List[str], List[str]]:
        """Return what a node subscribes to, publishes and serves."""
        published, subscribed, served = ([name for name, nodes in sorted(part.items()) if node in nodes]
                                         for part in self._state())
        return subscribed, published, served

    def service_nodes(self, service: str) -> List[str]:
        """Return the nodes that serve a service: one or none."""
        return self._state()[2].get(service, [])

    def service_type(self, service: str) -> str:
        """Return the type of a service, or an empty text."""
        if not self._services.allow(service):
            return ""
        try:
            return rosservice.get_service_type(service) or ""
        except UNREACHABLE:
            return ""

    def service_host(self, service: str) -> str:
        """Return the machine of a service, or an empty text."""
        try:
            return urlsplit(self._ask(lambda master: master.lookupService(service))).hostname or ""
        except BridgeError:
            return ""

    def services_of_type(self, wanted: str) -> List[str]:
        """Return the services of a type; each service is asked."""
        return [name for name in self.services() if self.service_type(name) == wanted]

    def action_servers(self) -> List[str]:
        """Return the names of actions: all five topics are there."""
        topics = set(self.topics())
        names = sorted(topic[:-len("/goal")] for topic in topics if topic.endswith("/goal"))
        return [name for name in names if all("%s/%s" % (name, part) in topics for part in _ACTION)]
