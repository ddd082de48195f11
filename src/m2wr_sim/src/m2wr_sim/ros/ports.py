# SPDX-License-Identifier: BSD-3-Clause
"""Topics, transforms and the clock over rospy."""
import logging
import threading

import rospy
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from m2wr_node.internals.ros_time import set_ros_time
from m2wr_node.internals.subscriber_connections import Channels, unregister
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.ros.loop import ShuttingDown
from m2wr_sim.ros.serialise import serialiser_of
from m2wr_sim.runtime.ports import Ports

log = logging.getLogger(__name__)

_BEGIN_PATIENCE = 60.0          # s of wall time for the world to be ready before a plugin's service gives up


def scoped(topic, namespace):
    """Return the name of a topic in a plugin's namespace; rospy resolves and remaps what is left relative."""
    if topic.startswith("/") or not namespace:
        return topic
    parts = [part for part in (namespace + "/" + topic).split("/") if part]
    return ("/" if namespace.startswith("/") else "") + "/".join(parts)


class _Port:
    """One publisher."""

    def __init__(self, channels, topic, message_class):
        self._channels = channels
        self._publisher, self.channel = channels.open(topic, message_class)
        self.wanted = self.channel.connected        # asked before every stretch of steps
        self.topic = self.channel.topic

    def publish(self, message):
        """Send a message, or a record that makes one; returns at once whatever the subscribers do."""
        try:
            self.channel.publish(message)
        except (rospy.ROSException, AttributeError, ValueError):
            if not rospy.is_shutdown():         # a topic closes under our hands only when the node goes down
                raise

    def latch(self):
        """Send the last message to later subscribers too; it must not change once it is published."""
        self.channel.latch()

    def close(self):
        """Stop publishing on the topic."""
        self._channels.close(self._publisher, self.channel)


class _Subscription:
    """Keeps the newest message until the simulation asks for it."""

    def __init__(self, topic, message_class, callback, mailbox):
        self.callback, self._mailbox = callback, mailbox
        self._subscriber = rospy.Subscriber(topic, message_class, self._store, queue_size=1, tcp_nodelay=True)

    def _store(self, message):
        self._mailbox.put(self, message)

    def close(self):
        """Stop listening; what has not been delivered is dropped."""
        unregister(self._subscriber)
        self._mailbox.drop(self)


class _Service:
    """One service; a name that is taken already stays with its owner, as in Gazebo."""

    def __init__(self, name, service_class, handler, ports):
        self._service = None
        try:
            self._service = rospy.Service(
                name, service_class, lambda request: ports.in_simulation(lambda: handler(request)))
        except rospy.service.ServiceException as error:
            log.warning("service %s is not offered once more: %s", name, error)

    def close(self):
        """Withdraw the service."""
        if self._service is not None:
            self._service.shutdown("its plugin ends")


class _Mailbox:
    """Newest message per subscription, filled by rospy's threads and emptied by the simulation."""

    def __init__(self):
        self._lock, self.newest = threading.Lock(), {}

    def put(self, subscription, message):
        with self._lock:
            self.newest[subscription] = message

    def drop(self, subscription):
        with self._lock:
            self.newest.pop(subscription, None)

    def empty(self):
        if not self.newest:
            return {}
        with self._lock:
            newest, self.newest = self.newest, {}
        return newest


class RosPorts(Ports):
    """Ports of the node it is made in."""

    def __init__(self):
        self._mailbox, self._channels = _Mailbox(), Channels(serialiser_of)
        self._call, self._answering = None, threading.Event()
        self._clock = _Port(self._channels, "/clock", Clock)
        self._transforms = _Port(self._channels, "/tf", TFMessage)
        self._clock_ns, self._stamp = -1, None
        self._clock_message = Clock()
        self._transform = TransformStamped()
        self._transform_message = TFMessage([self._transform])

    def advertise(self, topic, message_class, queue_size, namespace):
        return _Port(self._channels, scoped(topic, namespace), message_class)

    def subscribe(self, topic, message_class, callback, namespace):
        return _Subscription(scoped(topic, namespace), message_class, callback, self._mailbox)

    def dropped(self):
        """Return the messages that slow subscribers have lost, a list of ``subscriber_connections.Dropped``."""
        return self._channels.dropped()

    def traffic(self):
        """Return what has been sent, ``{topic: (messages, subscribers)}``."""
        return self._channels.traffic()

    def serve(self, name, service_class, handler, namespace):
        return _Service(scoped(name, namespace), service_class, handler, self)

    def answer_through(self, call):
        """Let services be answered by ``call(function)``, which runs a function in the simulation's thread."""
        self._call = call
        self._answering.set()

    def in_simulation(self, function):
        """Run a function in the simulation's thread; waits while the world is still being built.

        Raises
        ------
        rospy.ServiceException
            If the simulation does not begin, or ends.
        """
        if not self._answering.wait(_BEGIN_PATIENCE):
            raise rospy.ServiceException("the simulation has not begun within %g s" % _BEGIN_PATIENCE)
        try:
            return self._call(function)
        except ShuttingDown as error:
            raise rospy.ServiceException(str(error)) from error

    def waiting(self):
        return bool(self._mailbox.newest)           # asked before every stretch of steps

    def deliver(self):
        for subscription, message in self._mailbox.empty().items():
            subscription.callback(message)

    def transform(self, stamp, parent, child, position, orientation):
        if not self._transforms.channel.impl.connections:
            return
        transform = self._transform
        transform.header.stamp, transform.header.frame_id, transform.child_frame_id = stamp, parent, child
        where, turn = transform.transform.translation, transform.transform.rotation
        where.x, where.y, where.z = position
        turn.x, turn.y, turn.z, turn.w = orientation
        self._transforms.publish(self._transform_message)

    def moment(self, now_ns):
        """Return the stamp; the clock goes out first, so that no message is stamped later than what clocks show."""
        if now_ns > self._clock_ns:
            self.clock(now_ns)
        return self._stamp if now_ns == self._clock_ns else stamp_of(now_ns)

    def frame(self, name, namespace):
        """Apply the ``tf_prefix`` found from the namespace upwards; a leading slash asks for none."""
        if name.startswith("/"):
            return name[1:]
        parts = [part for part in namespace.split("/") if part]
        for depth in range(len(parts), -1, -1):
            prefix = rospy.get_param("/".join([""] + parts[:depth] + ["tf_prefix"]), None)
            if prefix is not None:
                prefix = prefix.strip("/")
                return prefix + "/" + name if prefix else name
        return name

    def clock(self, now_ns):
        """Publish the time and make it this node's own ROS time, without a subscription to itself."""
        self._clock_ns, self._stamp = now_ns, stamp_of(now_ns)
        set_ros_time(self._stamp)
        if self._clock.channel.impl.connections:        # as wanted(), without a call: 0.1 us
            self._clock_message.clock = self._stamp
            self._clock.publish(self._clock_message)
