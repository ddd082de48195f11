# SPDX-License-Identifier: BSD-3-Clause
"""The node: ``~core_sensors`` in, ``~pointcloud`` out."""
from __future__ import annotations

import threading
from typing import Any, Optional

import rospy
from kobuki_msgs.msg import SensorState
from sensor_msgs.msg import PointCloud2, PointField

from bumper_cloud.cloud import ConfigurationError, Settings, points, read_settings
from m2wr_node.ros.starting import start_node


class BumperCloud(rospy.SubscribeListener):
    """Publishes the points while a sensor is active, and once after that; subscribes only while it has a subscriber.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings) -> None:
        super().__init__()
        self._settings, self._lock = settings, threading.Lock()
        self._subscriber: Optional[rospy.Subscriber] = None
        self._before = 0
        self._clouds = rospy.Publisher("~pointcloud", PointCloud2, subscriber_listener=self, queue_size=10)

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        with self._lock:
            if self._subscriber is None:
                self._subscriber = rospy.Subscriber("~core_sensors", SensorState, self._on_state, queue_size=10)

    def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
        with self._lock:
            if not num_peers and self._subscriber is not None:
                self._subscriber.unregister()
                self._subscriber, self._before = None, 0

    def _on_state(self, message: SensorState) -> None:
        active = message.bumper | message.cliff
        if not active and not self._before:
            return
        self._before = active
        cloud = PointCloud2(height=1, width=3, point_step=12, row_step=36, is_dense=True,
                            data=points(active, self._settings).tobytes())
        cloud.header.stamp, cloud.header.frame_id = message.header.stamp, self._settings.base_link_frame
        cloud.fields = [PointField(name, 4 * place, PointField.FLOAT32, 1) for place, name in enumerate("xyz")]
        self._clouds.publish(cloud)


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("kobuki_bumper2pc")
    given = rospy.get_param("~", {})
    try:
        node = BumperCloud(read_settings(given if isinstance(given, dict) else {}))
    except ConfigurationError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    rospy.spin()
    del node
    return 0
