# SPDX-License-Identifier: BSD-3-Clause
"""Topics, transforms and the clock over rospy."""
from __future__ import annotations

import logging
import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Callable, Deque, Dict, List, Optional, Sequence, Tuple, TypeVar

import genpy
import rospy
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

from m2wr_node.internals.ros_time import set_ros_time
from m2wr_node.internals.subscriber_connections import Channels, Dropped, unregister
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.ros.loop import ShuttingDown
from m2wr_sim.ros.serialise import serialiser_of
from m2wr_sim.runtime.ports import Ports
from m2wr_sim.runtime.simulator import SimConfig, Simulator

if TYPE_CHECKING:
    from m2wr_sim.physics.engine import Engine
    from m2wr_sim.sensors.ray_scene import RayScene

log = logging.getLogger(__name__)

_Result = TypeVar("_Result")

_BEGIN_PATIENCE = 60.0          # s of wall time for the world to be ready before a plugin's service gives up


def scoped(topic: str, namespace: str) -> str:
    """Return the name of a topic in a plugin's namespace; rospy resolves and remaps a relative name.

    Parameters
    ----------
    topic : str
        With a leading slash the namespace has no effect.
    namespace : str
        ROS namespace; may be empty.
    """
    if topic.startswith("/") or not namespace:
        return topic
    parts = [part for part in (namespace + "/" + topic).split("/") if part]
    return ("/" if namespace.startswith("/") else "") + "/".join(parts)


class _Port:
    """One publisher."""

    def __init__(self, channels: Channels, topic: str, message_class: type) -> None:
        self._channels = channels
        self._publisher, self.channel = channels.open(topic, message_class)
        self.wanted: Callable[[], bool] = self.channel.connected       # called before each sequence of steps
        self.due: Callable[[], bool] = self.channel.due                # as wanted, at this moment of wall time
        self.audience: Callable[[], Tuple[Any, ...]] = self.channel.audience      # its subscribers now
        self.topic: str = self.channel.topic

    def publish(self, message: Any) -> None:
        """Send a message, or a record that makes one; does not wait for subscribers."""
        try:
            self.channel.publish(message)
        except (rospy.ROSException, AttributeError, ValueError):
            if not rospy.is_shutdown():         # at a shutdown rospy closes topics that are in use
                raise

    def latch(self) -> None:
        """Send the last message to later subscribers too; it must not change after it was published."""
        self.channel.latch()

    def close(self) -> None:
        """Stop publishing on the topic."""
        self._channels.close(self._publisher, self.channel)


class _Subscription:
    """Keeps the newest messages until the simulation asks for them."""

    def __init__(self, topic: str, message_class: type, callback: Callable[[Any], object], mailbox: _Mailbox,
                 keep: int = 1) -> None:
        self.callback, self.keep, self._mailbox = callback, keep, mailbox
        self._subscriber = rospy.Subscriber(topic, message_class, self._store, queue_size=keep, tcp_nodelay=True)

    def _store(self, message: Any) -> None:
        self._mailbox.put(self, message)

    def publishers(self) -> int:
        """Return how many nodes publish the topic."""
        return int(self._subscriber.get_num_connections())

    def close(self) -> None:
        """Stop listening; a message that was not delivered yet is dropped."""
        unregister(self._subscriber)
        self._mailbox.drop(self)


class _Service:
    """One service; if another one has the name already, it keeps it, as in Gazebo."""

    def __init__(self, name: str, service_class: type, handler: Callable[[Any], Any], ports: RosPorts) -> None:
        self._service: Optional[rospy.Service] = None
        try:
            self._service = rospy.Service(
                name, service_class, lambda request: ports.in_simulation(lambda: handler(request)))
        except rospy.service.ServiceException as error:
            log.warning("service %s is not offered once more: %s", name, error)

    def close(self) -> None:
        """Withdraw the service."""
        if self._service is not None:
            self._service.shutdown("its plugin ends")


class _Mailbox:
    """Newest messages per subscription, filled by rospy's threads and emptied by the simulation."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.newest: Dict[_Subscription, Deque[Any]] = {}

    def put(self, subscription: _Subscription, message: Any) -> None:
        with self._lock:
            if subscription not in self.newest:
                self.newest[subscription] = deque(maxlen=subscription.keep)
            self.newest[subscription].append(message)

    def drop(self, subscription: _Subscription) -> None:
        with self._lock:
            self.newest.pop(subscription, None)

    def empty(self) -> Dict[_Subscription, Deque[Any]]:
        if not self.newest:
            return {}
        with self._lock:
            newest, self.newest = self.newest, {}
        return newest


class RosPorts(Ports):
    """Ports of the node of this process."""

    def __init__(self) -> None:
        self._mailbox, self._channels = _Mailbox(), Channels(serialiser_of)
        self._call: Optional[Callable[[Callable[[], Any]], Any]] = None
        self._answering = threading.Event()
        self._clock = _Port(self._channels, "/clock", Clock)
        self._transforms = _Port(self._channels, "/tf", TFMessage)
        self._clock_ns = -1
        self._stamp = genpy.Time()
        self._clock_message = Clock()
        self._transform = TransformStamped()
        self._transform_message = TFMessage([self._transform])

    def advertise(self, topic: str, message_class: type, queue_size: int, namespace: str) -> Any:
        return _Port(self._channels, scoped(topic, namespace), message_class)

    def parameter(self, name: str) -> Any:
        return rospy.get_param(name, None)

    def subscribe(self, topic: str, message_class: type, callback: Callable[[Any], object], namespace: str,
                  keep: int = 1) -> Any:
        return _Subscription(scoped(topic, namespace), message_class, callback, self._mailbox, keep)

    def dropped(self) -> List[Dropped]:
        """Return how many messages slow subscribers have lost."""
        return self._channels.dropped()

    def flush(self) -> None:
        """Send what subscribers have not got that asked for fewer messages."""
        self._channels.flush()

    def traffic(self) -> Dict[str, Tuple[int, int]]:
        """Return ``{topic: (messages sent, subscribers)}``."""
        return self._channels.traffic()

    def serve(self, name: str, service_class: type, handler: Callable[[Any], Any], namespace: str) -> _Service:
        return _Service(scoped(name, namespace), service_class, handler, self)

    def answer_through(self, call: Callable[[Callable[[], Any]], Any]) -> None:
        """Answer services by ``call(function)``, which runs a function in the simulation's thread."""
        self._call = call
        self._answering.set()

    def in_simulation(self, function: Callable[[], _Result]) -> _Result:
        """Run a function in the simulation's thread; waits while the world is still being built.

        Raises
        ------
        rospy.ServiceException
            If the simulation does not begin, or ends.
        """
        if not self._answering.wait(_BEGIN_PATIENCE) or self._call is None:
            raise rospy.ServiceException("the simulation has not begun within %g s" % _BEGIN_PATIENCE)
        try:
            return self._call(function)
        except ShuttingDown as error:
            raise rospy.ServiceException(str(error)) from error

    def waiting(self) -> bool:
        return bool(self._mailbox.newest)           # called before each sequence of steps

    def deliver(self) -> None:
        for subscription, messages in self._mailbox.empty().items():
            for message in messages:
                subscription.callback(message)

    def transform(self, stamp: genpy.Time, parent: str, child: str, position: Sequence[float],
                  orientation: Sequence[float]) -> None:
        if not self._transforms.channel.impl.connections:
            return
        transform = self._transform
        transform.header.stamp, transform.header.frame_id, transform.child_frame_id = stamp, parent, child
        where, turn = transform.transform.translation, transform.transform.rotation
        where.x, where.y, where.z = position
        turn.x, turn.y, turn.z, turn.w = orientation
        self._transforms.publish(self._transform_message)

    def moment(self, now_ns: int) -> genpy.Time:
        """Return the stamp; the clock is published first, so that no stamp is later than the time that nodes know."""
        if now_ns > self._clock_ns:
            self.clock(now_ns)
        return self._stamp if now_ns == self._clock_ns else stamp_of(now_ns)

    def frame(self, name: str, namespace: str) -> str:
        """Return a frame name with the ``tf_prefix`` of its namespace.

        Parameters
        ----------
        name : str
            With a leading slash it gets no prefix.
        namespace : str
            The parameter is looked up here, then in the parent namespaces.
        """
        if name.startswith("/"):
            return name[1:]
        parts = [part for part in namespace.split("/") if part]
        for depth in range(len(parts), -1, -1):
            prefix = rospy.get_param("/".join([""] + parts[:depth] + ["tf_prefix"]), None)
            if prefix is not None:
                prefix = prefix.strip("/")
                return prefix + "/" + name if prefix else name
        return name

    def clock(self, now_ns: int) -> None:
        """Publish the time and make it this node's own ROS time, without a subscription to itself."""
        self._clock_ns, self._stamp = now_ns, stamp_of(now_ns)
        set_ros_time(self._stamp)
        if self._clock.channel.impl.connections:        # as wanted(), without a call: 0.1 us
            self._clock_message.clock = self._stamp
            self._clock.publish(self._clock_message)


class RosSimulator(Simulator):
    """A simulator with the ports of a node.

    Parameters
    ----------
    engine : Engine
    scene : RayScene
    ports : RosPorts
    config : SimConfig
    """

    ports: RosPorts

    def __init__(self, engine: Engine, scene: RayScene, ports: RosPorts, config: SimConfig) -> None:
        super().__init__(engine, scene, ports, config)
