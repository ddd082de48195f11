# SPDX-License-Identifier: BSD-3-Clause
"""The node's ports in lockstep: topics, transforms and the clock go through :class:`LockstepTopics`."""
import rospy

from m2wr_lockstep.server.ros.lockstep import Settings
from m2wr_lockstep.server.ros.topics import LockstepTopics
from m2wr_sim.ros.ports import RosPorts, scoped


def lockstep_settings(config):
    """Return the Settings of lockstep of a :class:`~m2wr_sim.ros.params.NodeConfig`."""
    return Settings(config.lockstep_controllers, config.lockstep_replies, config.lockstep_listeners,
                    config.lockstep_patience, config.lockstep_on_silence == "go_on")


class LockstepPorts(RosPorts):
    """Ports whose published messages are counted, and whose received messages are held back until they count.

    Parameters
    ----------
    tick : str
        Value of the parameter ~lockstep_tick.

    Attributes
    ----------
    topics : LockstepTopics
    """

    def __init__(self, tick="scan"):
        super().__init__()
        self.topics = LockstepTopics(tick)
        self._clock_topic, self._transform_topic = rospy.resolve_name("/clock"), rospy.resolve_name("/tf")

    def advertise(self, topic, message_class, queue_size, namespace):
        port = super().advertise(topic, message_class, queue_size, namespace)
        return self.topics.counted(port, scoped(topic, namespace), message_class)

    def subscribe(self, topic, message_class, callback, namespace):
        return self.topics.subscribe(scoped(topic, namespace), message_class, callback)

    def waiting(self):
        return True                 # messages that were held back may count now

    def deliver(self):
        self.topics.inbox.deliver()

    def clock(self, now_ns):
        self.topics.counts.count(self._clock_topic)
        super().clock(now_ns)

    def transform(self, stamp, parent, child, position, orientation):
        self.topics.counts.count(self._transform_topic)
        super().transform(stamp, parent, child, position, orientation)
