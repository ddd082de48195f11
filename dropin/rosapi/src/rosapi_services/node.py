# SPDX-License-Identifier: BSD-3-Clause
"""The node ``rosapi``."""
from __future__ import annotations

from typing import Any, Callable, Dict, List

import rosgraph
import rospy
from rosapi import srv
from rosapi.msg import TypeDef

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.ros import settings
from m2wr_bridge.ros.classes import Classes
from m2wr_bridge.rosbridge.globs import Globs
from m2wr_node.ros.starting import start_node
from rosapi_services.parameters import Parameters
from rosapi_services.questions import Questions
from rosapi_services.typedefs import definitions

#: Answers a request with the values of the response's fields.
_Answer = Callable[[Any], Any]


def _guarded(answer: _Answer) -> _Answer:
    """Return the same, with an error as the answer of a service that fails."""
    def serve(request: Any) -> Any:
        try:
            return answer(request)
        except (BridgeError, rospy.ROSException, rosgraph.MasterException, OSError, ValueError, KeyError,
                TypeError) as error:
            raise rospy.ServiceException("%s" % error) from None
    return serve


class RosapiNode:
    """Serves the services of rosapi.

    Raises
    ------
    BridgeError
        If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._classes = Classes()
        self._questions = Questions(rospy.get_name(), self._globs("topics_glob"), self._globs("services_glob"))
        self._parameters = Parameters(rospy, self._globs("params_glob"))
        self._services = [rospy.Service("~" + name, getattr(srv, kind), _guarded(answer))
                          for name, (kind, answer) in {**self._of_graph(), **self._of_types(),
                                                       **self._of_parameters()}.items()]

    @staticmethod
    def _globs(name: str) -> Globs:
        return Globs(settings.text(name, ""), name)

    def _of_graph(self) -> Dict[str, Any]:
        """Return {name: (type, answer)} of what is asked about topics, services and nodes."""
        ask = self._questions
        return {
            "topics": ("Topics", lambda _: self._lists(ask.topics())),
            "topics_for_type": ("TopicsForType", lambda request: [
                [name for name, kind in ask.topics().items() if kind == request.type]]),
            "topics_and_raw_types": ("TopicsAndRawTypes", lambda _: self._lists(ask.topics()) + [
                [self._text_of(kind) for kind in ask.topics().values()]]),
            "topic_type": ("TopicType", lambda request: [ask.topics().get(request.topic, "")]),
            "publishers": ("Publishers", lambda request: [ask.publishers(request.topic)]),
            "subscribers": ("Subscribers", lambda request: [ask.subscribers(request.topic)]),
            "services": ("Services", lambda _: [ask.services()]),
            "services_for_type": ("ServicesForType", lambda request: [ask.services_of_type(request.type)]),
            "service_type": ("ServiceType", lambda request: [ask.service_type(request.service)]),
            "service_node": ("ServiceNode", lambda request: ["".join(ask.service_nodes(request.service))]),
            "service_providers": ("ServiceProviders", lambda request: [ask.service_nodes(request.service)]),
            "service_host": ("ServiceHost", lambda request: [ask.service_host(request.service)]),
            "nodes": ("Nodes", lambda _: [ask.nodes()]),
            "node_details": ("NodeDetails", lambda request: list(ask.details(request.node))),
            "action_servers": ("GetActionServers", lambda _: [ask.action_servers()]),
            "get_time": ("GetTime", lambda _: [rospy.get_rostime()])}

    def _of_types(self) -> Dict[str, Any]:
        find = self._classes
        return {
            "message_details": ("MessageDetails", lambda request: self._details(find.message(request.type))),
            "service_request_details": ("ServiceRequestDetails", lambda request: self._details(
                find.service(request.type)._request_class)),
            "service_response_details": ("ServiceResponseDetails", lambda request: self._details(
                find.service(request.type)._response_class))}

    def _of_parameters(self) -> Dict[str, Any]:
        own = self._parameters
        return {
            "get_param": ("GetParam", lambda request: [own.get(request.name, request.default)]),
            "set_param": ("SetParam", self._set),
            "has_param": ("HasParam", lambda request: [own.has(request.name)]),
            "delete_param": ("DeleteParam", self._delete),
            "search_param": ("SearchParam", lambda request: [own.search(request.name)]),
            "get_param_names": ("GetParamNames", lambda _: [own.names()])}

    def _set(self, request: Any) -> List[Any]:
        self._parameters.set(request.name, request.value)
        return []

    def _delete(self, request: Any) -> List[Any]:
        self._parameters.delete(request.name)
        return []

    @staticmethod
    def _lists(topics: Dict[str, str]) -> List[Any]:
        return [list(topics), list(topics.values())]

    def _text_of(self, kind: str) -> str:
        try:
            return str(self._classes.message(kind)._full_text)
        except BridgeError:
            return ""

    def _details(self, kind: Any) -> List[Any]:
        return [[TypeDef(*found) for found in definitions(kind, self._classes.message)]]


def main() -> int:
    """Entry point; returns the exit code."""
    start_node("rosapi")
    settings.log_through_ros()
    try:
        node = RosapiNode()
    except BridgeError as error:
        rospy.logfatal("rosapi: %s", error)
        return 1
    rospy.spin()
    del node
    return 0
