"""Topics, transforms and the clock over rospy."""
import threading

import rospy
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from rospy.rostime import _set_rostime
from tf2_msgs.msg import TFMessage

from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.runtime.ports import Ports


def scoped(topic, namespace):
    """Return the name of a topic in a plugin's namespace; rospy resolves and remaps what is left relative."""
    if topic.startswith("/") or not namespace:
        return topic
    parts = [part for part in (namespace + "/" + topic).split("/") if part]
    return ("/" if namespace.startswith("/") else "") + "/".join(parts)


class _Port:
    """One publisher."""

    def __init__(self, topic, message_class, queue_size):
        self._publisher = rospy.Publisher(topic, message_class, queue_size=queue_size)
        self.publish = self._publish

    def _publish(self, message):
        try:
            self._publisher.publish(message)
        except rospy.ROSException:
            if not rospy.is_shutdown():         # a topic closes under our hands only when the node goes down
                raise

    def wanted(self):
        """Tell whether anybody listens."""
        return self._publisher.get_num_connections() > 0

    def close(self):
        """Stop publishing on the topic."""
        self._publisher.unregister()


class _Subscription:
    """Keeps the newest message until the simulation asks for it."""

    def __init__(self, topic, message_class, callback, mailbox):
        self.callback, self._mailbox = callback, mailbox
        self._subscriber = rospy.Subscriber(topic, message_class, self._store, queue_size=1, tcp_nodelay=True)

    def _store(self, message):
        self._mailbox.put(self, message)

    def close(self):
        """Stop listening; what has not been delivered is dropped."""
        self._subscriber.unregister()
        self._mailbox.drop(self)


class _Mailbox:
    """Newest message per subscription, filled by rospy's threads and emptied by the simulation."""

    def __init__(self):
        self._lock, self._newest = threading.Lock(), {}

    def put(self, subscription, message):
        with self._lock:
            self._newest[subscription] = message

    def drop(self, subscription):
        with self._lock:
            self._newest.pop(subscription, None)

    def empty(self):
        if not self._newest:
            return {}
        with self._lock:
            newest, self._newest = self._newest, {}
        return newest


class RosPorts(Ports):
    """Ports of the node it is made in."""

    def __init__(self):
        self._mailbox = _Mailbox()
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10)
        self._transforms = rospy.Publisher("/tf", TFMessage, queue_size=100)
        self._clock_ns = -1
        self._clock_message = Clock()

    def advertise(self, topic, message_class, queue_size, namespace):
        return _Port(scoped(topic, namespace), message_class, queue_size)

    def subscribe(self, topic, message_class, callback, namespace):
        return _Subscription(scoped(topic, namespace), message_class, callback, self._mailbox)

    def deliver(self):
        for subscription, message in self._mailbox.empty().items():
            subscription.callback(message)

    def transform(self, stamp, parent, child, position, orientation):
        transform = TransformStamped()
        transform.header.stamp, transform.header.frame_id, transform.child_frame_id = stamp, parent, child
        where, turn = transform.transform.translation, transform.transform.rotation
        where.x, where.y, where.z = position
        turn.x, turn.y, turn.z, turn.w = orientation
        self._transforms.publish(TFMessage([transform]))

    def moment(self, now_ns):
        """Return the stamp; the clock goes out first, so that no message is stamped later than what clocks show."""
        if now_ns > self._clock_ns:
            self.clock(now_ns)
        return stamp_of(now_ns)

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
        self._clock_ns = now_ns
        stamp = stamp_of(now_ns)
        _set_rostime(stamp)
        self._clock_message.clock = stamp
        self._clock.publish(self._clock_message)
