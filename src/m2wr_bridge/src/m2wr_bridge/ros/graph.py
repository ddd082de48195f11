# SPDX-License-Identifier: BSD-3-Clause
"""ROS as a session sees it: topics, services, and messages as plain values."""
from __future__ import annotations

import threading
from typing import Any, Dict, Optional, Tuple

import genpy
import rosgraph
import rosgraph.network
import rospy
import rosservice

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.messages.build import Builder
from m2wr_bridge.messages.plain import Reader, typed_array
from m2wr_bridge.ros.classes import Classes
from m2wr_bridge.ros.publications import Publications
from m2wr_bridge.ros.subscriptions import Subscriptions, legal
from m2wr_bridge.rosbridge.graph import Handler
from m2wr_bridge.rosbridge.topics import Readers


def _now() -> Tuple[int, int]:
    now = rospy.get_rostime()
    return now.secs, now.nsecs


class RosGraph:
    """Implements :class:`m2wr_bridge.rosbridge.graph.Graph` with rospy.

    Parameters
    ----------
    patience : float
        Time for which a topic that no client publishes any more is kept [s].
    """

    def __init__(self, patience: float) -> None:
        self.classes = Classes()
        self.readers = Readers(Reader(self.classes.message), Reader(self.classes.message, typed_array))
        self.builder = Builder(self.classes.message, _now)
        self.subscriptions = Subscriptions(self.classes)
        self.publications = Publications(self.classes, patience)
        self.subscribe, self.unsubscribe = self.subscriptions.add, self.subscriptions.remove
        self.repeat_latched = self.subscriptions.repeat
        self.advertise, self.unadvertise = self.publications.advertise, self.publications.unadvertise
        self._served: Dict[str, Any] = {}
        self._lock = threading.Lock()

    def publish(self, topic: str, values: Any) -> None:
        """Publish a message from plain values.

        Parameters
        ----------
        topic : str
        values : dict

        Raises
        ------
        BridgeError
            If a value does not fit.
        """
        self.publications.publish(topic, self.builder.build(self.publications.kind(topic), values))

    def service_class(self, service: str, type_name: Optional[str]) -> Any:
        """Return the class of a service.

        Parameters
        ----------
        service : str
        type_name : str or None
            None: ask the service.

        Raises
        ------
        BridgeError
            If the service or its class is not there.
        """
        if type_name is None:
            try:
                type_name = rosservice.get_service_type(service)
            except (rosservice.ROSServiceException, OSError, rosgraph.MasterException,
                    rosgraph.network.ROSHandshakeException) as error:
                raise BridgeError("service %s: %s" % (service, error)) from error
        if type_name is None:
            raise BridgeError("service %s does not exist" % service)
        return self.classes.service(type_name)

    def call(self, service: str, type_name: Optional[str], arguments: Any) -> Any:
        """Return the answer of a service, a message.

        Parameters
        ----------
        service : str
        type_name : str or None
        arguments : dict, list or None

        Raises
        ------
        BridgeError
            If the service is not there, refuses, or an argument does not fit.
        """
        name = legal("service", service)
        kind = self.service_class(name, type_name)
        return self.request(name, kind, self.builder.from_arguments(kind._request_class, arguments))

    @staticmethod
    def request(service: str, kind: Any, request: Any) -> Any:
        """Return the answer of a service to a request.

        Parameters
        ----------
        service : str
        kind : type
            Class of the service.
        request : genpy.Message

        Raises
        ------
        BridgeError
            If the service is not there or refuses.
        """
        try:
            return rospy.ServiceProxy(service, kind)(request)
        except (rospy.ServiceException, rospy.ROSException, genpy.MessageException, OSError, ValueError,
                TypeError) as error:
            raise BridgeError("service %s: %s" % (service, error)) from error

    def offer_service(self, service: str, type_name: str, handler: Handler) -> None:
        """Serve a service.

        Parameters
        ----------
        service : str
        type_name : str
        handler : callable
            Takes the request and returns the answer as plain values; raises BridgeError.

        Raises
        ------
        BridgeError
            If another client serves it or the class is not there.
        """
        name, kind = legal("service", service), self.classes.service(type_name)

        def serve(request: Any) -> Any:
            try:
                values = handler(self.readers.json.plain(request))
                return self.builder.build(kind._response_class, {} if values is None else values, "values")
            except BridgeError as error:
                raise rospy.ServiceException(str(error)) from None

        with self._lock:
            if name in self._served:
                raise BridgeError("service %s is served by another client" % service)
            try:
                self._served[name] = rospy.Service(name, kind, serve)
            except (rospy.ServiceException, rospy.ROSException) as error:
                raise BridgeError("service %s: %s" % (service, error)) from error

    def withdraw_service(self, service: str) -> None:
        """Stop serving."""
        with self._lock:
            found = self._served.pop(legal("service", service), None)
        if found is not None:
            found.shutdown("the client has left")
