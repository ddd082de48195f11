# SPDX-License-Identifier: BSD-3-Clause
"""The node ``depthimage_to_laserscan``: ``image`` and ``camera_info`` in, ``scan`` out."""
from __future__ import annotations

import threading
from typing import Any, List, Optional, Tuple

import rospy
from sensor_msgs.msg import CameraInfo, Image, LaserScan

from depth_scan.conversion import ConfigurationError, Projection, Settings, depths_of, read_settings
from m2wr_node.ros.starting import start_node

_MOST_PIXELS = 1 << 25          # of an image


class _OnSubscribers(rospy.SubscribeListener):
    """Tells the node when the first subscriber comes and the last one leaves."""

    def __init__(self, node: DepthScan) -> None:
        super().__init__()
        self._node = node

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        self._node.listen(True)

    def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
        self._node.listen(num_peers > 0)


class DepthScan:
    """Publishes a scan for each image with a calibration of the same size.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings) -> None:
        self._settings, self._lock = settings, threading.Lock()
        self._projection: Optional[Projection] = None
        self._calibration: Tuple[Any, ...] = ()
        self._subscribers: List[rospy.Subscriber] = []
        image = rospy.resolve_name("image")
        self._topics = image, rospy.remap_name(image.rsplit("/", 1)[0] + "/camera_info")
        self._scans = rospy.Publisher("scan", LaserScan, subscriber_listener=_OnSubscribers(self), queue_size=10)

    def listen(self, wanted: bool) -> None:
        """Subscribe to the camera, or stop doing so.

        Parameters
        ----------
        wanted : bool
        """
        with self._lock:
            if wanted and not self._subscribers:
                image, info = self._topics
                self._subscribers = [rospy.Subscriber(info, CameraInfo, self._on_info, queue_size=1),
                                     rospy.Subscriber(image, Image, self._on_image, queue_size=1, buff_size=1 << 24)]
            elif not wanted:
                for subscriber in self._subscribers:
                    subscriber.unregister()
                self._subscribers = []

    def _on_info(self, message: CameraInfo) -> None:
        rectified = (message.P[0], message.P[2], message.P[6]) if message.P[0] else (
            message.K[0], message.K[2], message.K[5])
        calibration = (message.width,) + rectified
        if calibration == self._calibration:
            return
        self._calibration, self._projection = calibration, None
        try:
            if not 2 <= message.width <= _MOST_PIXELS:
                raise ConfigurationError("a calibration for %d columns; expected 2 or more" % message.width)
            self._projection = Projection(*calibration)
        except ConfigurationError as error:
            rospy.logwarn("%s: %s", self._topics[1], error)

    def _on_image(self, message: Image) -> None:
        projection, settings = self._projection, self._settings
        if projection is None:
            return
        try:
            if message.width * message.height > _MOST_PIXELS:
                raise ConfigurationError("an image of %d x %d pixels; expected at most %d" % (
                    message.width, message.height, _MOST_PIXELS))
            depths = depths_of(message.data, message.width, message.height, message.step, message.encoding,
                               bool(message.is_bigendian))
            ranges = projection.ranges(depths, settings)
        except ConfigurationError as error:
            rospy.logwarn_throttle(10.0, "%s: %s; no scan" % (self._topics[0], error))
            return
        scan = LaserScan(angle_min=projection.angle_min, angle_max=projection.angle_max,
                         angle_increment=projection.increment, scan_time=settings.scan_time,
                         range_min=settings.range_min, range_max=settings.range_max, ranges=ranges.tolist())
        scan.header.stamp, scan.header.frame_id = message.header.stamp, settings.output_frame_id
        self._scans.publish(scan)


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("depthimage_to_laserscan")
    given = rospy.get_param("~", {})
    try:
        node = DepthScan(read_settings(given if isinstance(given, dict) else {}))
    except ConfigurationError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    rospy.spin()
    del node
    return 0
