# SPDX-License-Identifier: BSD-3-Clause
"""The node's ports in lockstep: topics, transforms and the clock go through :class:`LockstepTopics`."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Sequence

import genpy
import rospy

from m2wr_lockstep.server.ros.lockstep import Settings
from m2wr_lockstep.server.ros.topics import LockstepTopics
from m2wr_sim.ros.ports import RosPorts, scoped

if TYPE_CHECKING:
    from m2wr_sim.ros.params import NodeConfig


def lockstep_settings(config: NodeConfig) -> Settings:
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

    def __init__(self, tick: str = "scan") -> None:
        super().__init__()
        self.topics = LockstepTopics(tick)
        self._clock_topic, self._transform_topic = rospy.resolve_name("/clock"), rospy.resolve_name("/tf")

    def advertise(self, topic: str, message_class: type, queue_size: int, namespace: str) -> Any:
        port = super().advertise(topic, message_class, queue_size, namespace)
        return self.topics.counted(port, scoped(topic, namespace), message_class)

    def subscribe(self, topic: str, message_class: type, callback: Callable[[Any], object], namespace: str,
                  keep: int = 1) -> Any:
        return self.topics.subscribe(scoped(topic, namespace), message_class, callback)

    def waiting(self) -> bool:
        return True                 # messages that were held back may count now

    def deliver(self) -> None:
        self.topics.inbox.deliver()

    def clock(self, now_ns: int) -> None:
        self.topics.counts.count(self._clock_topic)
        super().clock(now_ns)

    def transform(self, stamp: genpy.Time, parent: str, child: str, position: Sequence[float],
                  orientation: Sequence[float]) -> None:
        self.topics.counts.count(self._transform_topic)
        super().transform(stamp, parent, child, position, orientation)
