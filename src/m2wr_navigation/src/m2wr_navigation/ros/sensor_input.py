# SPDX-License-Identifier: BSD-3-Clause
"""Scans and clouds of an observation source, transformed to the frame of a costmap."""
from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Deque

import numpy as np
import rospy
from sensor_msgs.msg import LaserScan, PointCloud, PointCloud2, PointField

from m2wr_navigation.costmap.observation import (
    Observation,
    ObservationError,
    cloud_points,
    listed_points,
    scan_points,
    transformed,
)
from m2wr_navigation.ros.transforms import TransformError
from m2wr_node.ros.transform_buffer import fault_of

if TYPE_CHECKING:
    from m2wr_navigation.costmap.observation import Source
    from m2wr_navigation.ros.transforms import Transforms

WAITING = 10                # messages that wait for their transforms; the oldest is dropped first
SELDOM = 10.0               # s between two warnings of a kind
_KINDS = {"LaserScan": LaserScan, "PointCloud": PointCloud, "PointCloud2": PointCloud2}
PATIENCE = 1.0              # s after which a message without transform is dropped


class SensorInput:
    """Subscribes to the topic of a source. Messages wait until :meth:`deliver` finds their transform.

    Parameters
    ----------
    source : Source
    transforms : Transforms
    frame : str
        Global frame of the costmap.
    """

    def __init__(self, source: Source, transforms: Transforms, frame: str) -> None:
        self._source, self._transforms, self._frame = source, transforms, frame
        self._lock = threading.Lock()
        self._waiting: Deque[Any] = deque(maxlen=WAITING)
        self._subscriber = rospy.Subscriber(source.topic, _KINDS[source.values["data_type"]], self._on_message,
                                            queue_size=WAITING, buff_size=2**24, tcp_nodelay=True)

    @property
    def topic(self) -> str:
        """Resolved name of the topic."""
        return str(self._subscriber.resolved_name)

    def _on_message(self, message: Any) -> None:
        fault = fault_of(message.header)
        if fault:
            rospy.logwarn_throttle(SELDOM, self._sentence(message, fault))
            return
        self._source.heard(rospy.get_time())        # now: the costmap may take the message in much later
        with self._lock:
            self._waiting.append(message)

    def _sentence(self, message: Any, reason: str) -> str:
        """Return a warning. rospy limits the rate of each line of code, so that one reason does not hide another."""
        return "a message on {} (stamp {:.3f}) is not used: {}".format(
            self.topic, message.header.stamp.to_sec(), reason)

    def deliver(self, now: float) -> None:
        """Hand all messages whose transform is known to the source.

        Parameters
        ----------
        now : float
            [s]
        """
        with self._lock:
            waiting, later = list(self._waiting), []
            self._waiting.clear()
        for message in waiting:
            stamp = message.header.stamp
            try:
                sensor = self._source.values["sensor_frame"] or message.header.frame_id
                found = self._transforms.message(self._frame, sensor, stamp if not stamp.is_zero() else None)
            except TransformError as error:
                self._source.refuse(now, str(error))
                if abs(now - stamp.to_sec()) < PATIENCE:
                    later.append(message)
                else:
                    rospy.logwarn_throttle(SELDOM, self._sentence(message, str(error)))
                continue
            try:
                self._source.keep(self._observation(message, found.transform))
            except ObservationError as error:
                self._source.refuse(now, str(error))
                rospy.logwarn_throttle(SELDOM, self._sentence(message, str(error)))
        with self._lock:
            self._waiting.extendleft(reversed(later[-(WAITING - len(self._waiting)):] if len(
                self._waiting) < WAITING else []))

    def _observation(self, message: Any, transform: Any) -> Observation:
        shift, turn = transform.translation, transform.rotation
        translation = (shift.x, shift.y, shift.z)
        quaternion = (turn.x, turn.y, turn.z, turn.w)
        if isinstance(message, LaserScan):
            points, free = scan_points(message.ranges, message.angle_min, message.angle_increment,
                                       (message.range_min, message.range_max), self._source.values)
        elif isinstance(message, PointCloud):
            points, free = listed_points([(point.x, point.y, point.z) for point in message.points]), np.zeros((0, 3))
        else:
            points, free = self._cloud(message), np.zeros((0, 3))
        return Observation(message.header.stamp.to_sec(), np.array(translation),
                           transformed(points, translation, quaternion), transformed(free, translation, quaternion))

    @staticmethod
    def _cloud(message: Any) -> Any:
        offsets = {}
        for field in message.fields:
            if field.name in ("x", "y", "z"):
                if field.datatype != PointField.FLOAT32:
                    raise ObservationError("field {} has the type {}; expected FLOAT32".format(
                        field.name, field.datatype))
                offsets[field.name] = field.offset
        if len(offsets) != 3:
            raise ObservationError("it has the fields {}; expected x, y and z".format(
                ", ".join(field.name for field in message.fields[:20]) or "none"))
        return cloud_points(message.data, (message.height, message.width), (message.row_step, message.point_step),
                            (offsets["x"], offsets["y"], offsets["z"]), bool(message.is_bigendian))
