# SPDX-License-Identifier: BSD-3-Clause
"""The simulator's doors to outside, as an interface, and the ones that lead nowhere but into lists."""
import abc


class Ports(abc.ABC):
    """Topics, transforms and the clock; the simulator knows nothing of what carries them."""

    @abc.abstractmethod
    def advertise(self, topic, message_class, queue_size, namespace):
        """Return an object with ``publish(message)``, ``wanted()`` and ``close()``."""

    @abc.abstractmethod
    def subscribe(self, topic, message_class, callback, namespace):
        """Arrange for ``callback`` to get the newest message in :meth:`deliver`; returns an object with ``close()``."""

    @abc.abstractmethod
    def serve(self, name, service_class, handler, namespace):
        """Offer a service; ``handler(request)`` runs in the simulation's thread.  Returns what has a ``close()``."""

    def waiting(self):
        """Tell whether there may be anything to deliver."""
        return True

    @abc.abstractmethod
    def deliver(self):
        """Hand every newest message that has come since the last call to its callback."""

    @abc.abstractmethod
    def transform(self, stamp, parent, child, position, orientation):
        """Publish one transform."""

    @abc.abstractmethod
    def moment(self, now_ns):
        """Return the message stamp of a simulated time, making sure the clock has reached it."""

    @abc.abstractmethod
    def frame(self, name, namespace):
        """Return a frame name as it goes into messages."""

    @abc.abstractmethod
    def clock(self, now_ns):
        """Publish the simulated time."""


class LocalPort:
    """A topic without a network: keeps what is published while ``listening``."""

    def __init__(self, topic, listening=True):
        self.topic, self.listening, self.messages = topic, listening, []

    def publish(self, message):
        """Keep a message."""
        self.messages.append(message)

    def wanted(self):
        """Tell whether anybody listens."""
        return self.listening

    def close(self):
        """Stop listening."""
        self.listening = False


class LocalSubscription:
    """The receiving end of a topic without a network, or the answering end of a service."""

    def __init__(self, callback):
        self.callback, self.open, self.newest = callback, True, None

    def close(self):
        """Stop delivering."""
        self.open, self.callback, self.newest = False, None, None


class LocalPorts(Ports):
    """Topics inside this process, for use without ROS.

    Messages are whatever the plugins make; ``copy`` is applied to each, because plugins may reuse message objects.
    """

    def __init__(self, copy=None):
        self.topics, self.subscriptions, self.transforms, self.clock_ns = {}, {}, [], []
        self.services = {}
        self._copy = copy

    @staticmethod
    def resolve(topic, namespace):
        """Return the absolute name of a topic in a namespace."""
        if topic.startswith("/"):
            return topic
        return "/" + "/".join(part for part in (namespace + "/" + topic).split("/") if part)

    def advertise(self, topic, message_class, queue_size, namespace):
        port = LocalPort(self.resolve(topic, namespace))
        if self._copy is not None:
            port.publish = lambda message: port.messages.append(self._copy(message))
        self.topics[port.topic] = port
        return port

    def subscribe(self, topic, message_class, callback, namespace):
        subscription = LocalSubscription(callback)
        self.subscriptions[self.resolve(topic, namespace)] = subscription
        return subscription

    def serve(self, name, service_class, handler, namespace):
        service = LocalSubscription(handler)
        self.services[self.resolve(name, namespace)] = service
        return service

    def send(self, topic, message):
        """Let a message arrive on a topic; it is delivered at the next step boundary."""
        subscription = self.subscriptions.get(topic)
        if subscription is not None and subscription.open:
            subscription.newest = message

    def waiting(self):
        return any(subscription.newest is not None for subscription in self.subscriptions.values())

    def deliver(self):
        for subscription in list(self.subscriptions.values()) if self.subscriptions else ():
            if subscription.open and subscription.newest is not None:
                message, subscription.newest = subscription.newest, None
                subscription.callback(message)

    def transform(self, stamp, parent, child, position, orientation):
        self.transforms.append((stamp, parent, child, position, orientation))

    def moment(self, now_ns):
        return now_ns

    def frame(self, name, namespace):
        return name.lstrip("/")

    def clock(self, now_ns):
        self.clock_ns.append(now_ns)
