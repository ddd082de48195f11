# SPDX-License-Identifier: BSD-3-Clause
"""Topics in lockstep: what is published is counted, what controllers send is held back until they have answered."""
import rospy

from m2wr_sim.ros.ports import RosPorts, scoped
from m2wr_sim.runtime.turns import Inbox, Ledger

#: Message types that make a tick, by the value of the parameter ~lockstep_tick.
TICKS = {"scan": ("sensor_msgs/LaserScan",), "odometry": ("nav_msgs/Odometry",),
         "both": ("sensor_msgs/LaserScan", "nav_msgs/Odometry")}


class _CountedPort:
    """A port whose messages are counted; everything else is the port's own."""

    def __init__(self, ports, port, topic, ticking):
        self._ports, self._port, self._topic, self._ticking = ports, port, topic, ticking
        self.wanted = self._wanted if ticking else port.wanted

    def _wanted(self):
        """Tell whether to publish: for subscribers, or to make ticks where no other port that makes them has any."""
        return self._port.wanted() or not any(other.heard() for other in list(self._ports.ticking))

    def heard(self):
        """Tell whether there is a subscriber."""
        return self._port.wanted()

    def publish(self, message):
        """Publish and count a message."""
        ports = self._ports
        ports.ledger.count(self._topic)
        if self._topic in ports.triggers:
            ports.before_trigger()
        if self._ticking:
            ports.tick_due = True
        self._port.publish(message)

    def close(self):
        """Stop publishing on the topic."""
        self._ports.ticking.discard(self)
        self._ports.changed = True
        self._port.close()

    def __getattr__(self, name):
        return getattr(self._port, name)


class _Subscription:
    """A subscription whose messages go through the inbox; without a callback they are only counted."""

    def __init__(self, ports, topic, message_class, callback):
        self._ports, self._inbox, self._own = ports, ports.inbox, rospy.get_name()
        self._slot = self._inbox.open(rospy.resolve_name(topic), callback)
        # no queue size: rospy would keep only the newest of several messages that come together
        self._subscriber = rospy.Subscriber(topic, message_class, self._store, queue_size=None, tcp_nodelay=True)

    def _store(self, message):
        sender = message._connection_header.get("callerid", "")
        if sender != self._own:
            self._inbox.arrive(self._slot, sender, message)

    def close(self):
        """Stop listening."""
        self._ports.changed = True
        self._subscriber.unregister()
        self._inbox.close(self._slot)


class LockstepPorts(RosPorts):
    """Ports that know what was published and who has sent what.

    Attributes
    ----------
    tick_due : bool
        Whether something that makes a tick was published since this was last set to False.
    ticking : set
        Ports that make ticks.
    changed : bool
        Whether topics came or went since this was last set to False.
    triggers, before_trigger : set, callable
        Topics that others answer at once, and what is called before a message on one of them leaves.
    """

    def __init__(self, tick="scan"):
        super().__init__()
        self.ledger, self.inbox = Ledger(), Inbox(lambda: self.on_arrival())
        self.tick_due, self.changed, self.ticking = False, True, set()
        self.on_arrival = self.before_trigger = lambda: None
        self.triggers = set()
        self._tick_types, self._bare = TICKS[tick], {}
        self._clock_topic, self._transform_topic = rospy.resolve_name("/clock"), rospy.resolve_name("/tf")

    def advertise(self, topic, message_class, queue_size, namespace):
        port = super().advertise(topic, message_class, queue_size, namespace)
        ticking = message_class._type in self._tick_types
        counted = _CountedPort(self, port, rospy.resolve_name(scoped(topic, namespace)), ticking)
        if ticking:
            self.ticking.add(counted)
        self.changed = True
        return counted

    def subscribe(self, topic, message_class, callback, namespace):
        self.changed = True
        name = scoped(topic, namespace)
        bare = self._bare.pop(rospy.resolve_name(name), None)
        if bare is not None:
            bare.close()            # rospy takes one message class a topic
        return _Subscription(self, name, message_class, callback)

    def listen(self, topic):
        """Hear a topic that nothing else here subscribes to, for the sake of counting."""
        if topic not in self.inbox.topics():
            self._bare[topic] = _Subscription(self, topic, rospy.AnyMsg, lambda message: None)
            self.changed = True

    def waiting(self):
        return True                 # what was held back may count now

    def deliver(self):
        self.inbox.deliver()

    def clock(self, now_ns):
        self.ledger.count(self._clock_topic)
        super().clock(now_ns)

    def transform(self, stamp, parent, child, position, orientation):
        self.ledger.count(self._transform_topic)
        super().transform(stamp, parent, child, position, orientation)
