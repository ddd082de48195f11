# SPDX-License-Identifier: BSD-3-Clause
"""Interface of the simulator to topics, services and transforms, and an implementation without a network."""
from __future__ import annotations

import abc
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Optional, Sequence, Tuple


class Ports(abc.ABC):
    """Topics, services, transforms and the clock; the simulator does not depend on how they are transported."""

    @abc.abstractmethod
    def advertise(self, topic: str, message_class: Any, queue_size: int, namespace: str) -> Any:
        """Open a topic for publishing.

        Parameters
        ----------
        topic : str
        message_class : type
        queue_size : int
            Number of messages to keep for each slow subscriber.
        namespace : str
            ROS namespace of the topic; may be empty.

        Returns
        -------
        object
            With ``publish(message)``, ``wanted()``, which returns whether there are subscribers, and ``close()``.
            There may be ``due()``, which returns whether one of them takes a message at this moment.
        """

    def parameter(self, name: str) -> Any:
        """Return the value of a parameter, which may be a mapping of parameters, or None if it is not set.

        Parameters
        ----------
        name : str
            With a leading slash.
        """
        return None

    @abc.abstractmethod
    def subscribe(self, topic: str, message_class: Any, callback: Callable[[Any], None], namespace: str,
                  keep: int = 1) -> Any:
        """Subscribe to a topic.

        Parameters
        ----------
        topic : str
        message_class : type
        callback : callable
            Gets the newest messages in :meth:`deliver`.
        namespace : str
            ROS namespace of the topic; may be empty.
        keep : int
            Number of messages to keep between two deliveries.

        Returns
        -------
        object
            With ``close()``, and ``publishers()``, which returns how many nodes publish the topic.
        """

    @abc.abstractmethod
    def serve(self, name: str, service_class: Any, handler: Callable[[Any], Any], namespace: str) -> Any:
        """Offer a service.

        Parameters
        ----------
        name : str
        service_class : type
        handler : callable
            ``handler(request)`` returns the response; it runs in the simulation's thread.
        namespace : str
            ROS namespace of the service; may be empty.

        Returns
        -------
        object
            With ``close()``.
        """

    def waiting(self) -> bool:
        """Return whether there may be a message to deliver."""
        return True

    @abc.abstractmethod
    def deliver(self) -> None:
        """Pass the newest messages of each topic since the last call to its callback, the oldest first."""

    @abc.abstractmethod
    def transform(self, stamp: Any, parent: str, child: str, position: Sequence[float],
                  orientation: Sequence[float]) -> None:
        """Publish one transform.

        Parameters
        ----------
        stamp : object
            As returned by :meth:`moment`.
        parent, child : str
            Frame names.
        position : (3,) sequence of float
            Origin [m] of the child frame in the parent frame.
        orientation : (4,) sequence of float
            Quaternion x y z w of the child frame in the parent frame.
        """

    @abc.abstractmethod
    def moment(self, now_ns: int) -> Any:
        """Return the message stamp of a simulated time, after the clock has reached it."""

    @abc.abstractmethod
    def frame(self, name: str, namespace: str) -> str:
        """Return the name of a frame as used in messages.

        Parameters
        ----------
        name : str
            Name in the description.
        namespace : str
            ROS namespace of the plugin; may be empty.
        """

    @abc.abstractmethod
    def clock(self, now_ns: int) -> None:
        """Publish the simulated time."""


class LocalPort:
    """A topic without a network: stores the messages that are published.

    Parameters
    ----------
    topic : str
    listening : bool
        Whether there is a subscriber.
    copy : callable, optional
        Applied to each message before it is stored.
    """

    def __init__(self, topic: str, listening: bool = True, copy: Optional[Callable[[Any], Any]] = None) -> None:
        self.topic, self.listening = topic, listening
        self.messages: List[Any] = []
        self._copy = copy

    def publish(self, message: Any) -> None:
        """Store a message."""
        self.messages.append(message if self._copy is None else self._copy(message))

    def wanted(self) -> bool:
        """Return whether there is a subscriber."""
        return self.listening

    def close(self) -> None:
        """Stop listening."""
        self.listening = False


class LocalSubscription:
    """A subscriber of a topic without a network, or a service."""

    def __init__(self, callback: Callable[[Any], Any], keep: int = 1) -> None:
        self.callback: Optional[Callable[[Any], Any]] = callback
        self.open = True
        self.newest: Deque[Any] = deque(maxlen=keep)
        self.senders = 1

    def publishers(self) -> int:
        """Return how many programs send to the topic."""
        return self.senders

    def close(self) -> None:
        """Stop delivering."""
        self.open, self.callback = False, None
        self.newest.clear()


class LocalPorts(Ports):
    """Topics inside this process, for use without ROS.

    Messages are the objects that plugins publish; ``copy`` is applied to each, because plugins may reuse them.
    """

    def __init__(self, copy: Optional[Callable[[Any], Any]] = None) -> None:
        self.topics: Dict[str, LocalPort] = {}
        self.subscriptions: Dict[str, LocalSubscription] = {}
        self.services: Dict[str, LocalSubscription] = {}
        self.transforms: List[Tuple[Any, ...]] = []
        self.clock_ns: List[int] = []
        self.parameters: Dict[str, Any] = {}        # by absolute name
        self._copy = copy

    def parameter(self, name: str) -> Any:
        return self.parameters.get(name)

    @staticmethod
    def resolve(topic: str, namespace: str) -> str:
        """Return the absolute name of a topic.

        Parameters
        ----------
        topic : str
            With a leading slash the namespace has no effect.
        namespace : str
            ROS namespace; may be empty.
        """
        if topic.startswith("/"):
            return topic
        return "/" + "/".join(part for part in (namespace + "/" + topic).split("/") if part)

    def advertise(self, topic: str, message_class: Any, queue_size: int, namespace: str) -> LocalPort:
        port = LocalPort(self.resolve(topic, namespace), copy=self._copy)
        self.topics[port.topic] = port
        return port

    def subscribe(self, topic: str, message_class: Any, callback: Callable[[Any], None],
                  namespace: str, keep: int = 1) -> LocalSubscription:
        subscription = LocalSubscription(callback, keep)
        self.subscriptions[self.resolve(topic, namespace)] = subscription
        return subscription

    def serve(self, name: str, service_class: Any, handler: Callable[[Any], Any], namespace: str) -> LocalSubscription:
        service = LocalSubscription(handler)
        self.services[self.resolve(name, namespace)] = service
        return service

    def send(self, topic: str, message: Any) -> None:
        """Send a message to the subscriber of a topic; it is delivered before the next step.

        Parameters
        ----------
        topic : str
        message : object
        """
        subscription = self.subscriptions.get(topic)
        if subscription is not None and subscription.open:
            subscription.newest.append(message)

    def waiting(self) -> bool:
        return any(subscription.newest for subscription in self.subscriptions.values())

    def deliver(self) -> None:
        for subscription in list(self.subscriptions.values()) if self.subscriptions else ():
            while subscription.callback is not None and subscription.newest:
                subscription.callback(subscription.newest.popleft())

    def transform(self, stamp: Any, parent: str, child: str, position: Sequence[float],
                  orientation: Sequence[float]) -> None:
        self.transforms.append((stamp, parent, child, position, orientation))

    def moment(self, now_ns: int) -> Any:
        return now_ns

    def frame(self, name: str, namespace: str) -> str:
        return name.lstrip("/")

    def clock(self, now_ns: int) -> None:
        self.clock_ns.append(now_ns)
