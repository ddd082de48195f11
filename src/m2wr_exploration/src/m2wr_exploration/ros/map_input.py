# SPDX-License-Identifier: BSD-3-Clause
"""A map that comes over a topic, and its changes."""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Optional

import numpy as np
import rospy
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid

from m2wr_exploration.frontiers import costs_of_occupancy
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.ros.transforms import yaw_of

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

MOST_CELLS = 100000000      # of a map
TELL = 5.0                  # s between two messages about what is missing


def _size(costmap: Costmap) -> FloatArray:
    """Return the length (2,) of the sides of a map [m]."""
    return costmap.resolution * np.array([costmap.columns, costmap.rows])


def _extent(costmap: Costmap) -> str:
    (left, bottom), (right, top) = costmap.origin, costmap.origin + _size(costmap)
    return "x {:.1f} to {:.1f} m, y {:.1f} to {:.1f} m".format(left, right, bottom, top)


def _shrinks(last: Costmap, new: Costmap) -> bool:
    """Return whether a side of a map is shorter by more than a cell; one that only moves does not shrink."""
    return bool((_size(new) < _size(last) - max(last.resolution, new.resolution)).any())


class MapInput:
    """The map from a topic and its changes; what cannot be used is told with its reason."""

    def __init__(self, topic: str, updates: str) -> None:
        self.costmap: Optional[Costmap] = None
        self.topic = rospy.resolve_name(topic)
        self._lock = threading.Lock()
        self._subscribers = (rospy.Subscriber(topic, OccupancyGrid, self._on_map, queue_size=1),
                             rospy.Subscriber(updates, OccupancyGridUpdate, self._on_update, queue_size=10))

    def _on_map(self, message: OccupancyGrid) -> None:
        info = message.info
        turn = yaw_of(info.origin.orientation)
        place = np.array([info.origin.position.x, info.origin.position.y])
        if not 0 < info.width * info.height <= MOST_CELLS or len(message.data) != info.width * info.height:
            return self._refuse("has {} x {} cells and {} values; expected 1 to {} cells, one value each".format(
                info.width, info.height, len(message.data), MOST_CELLS))
        if not (np.isfinite(info.resolution) and info.resolution > 0.0 and np.isfinite(place).all()):
            return self._refuse("has the resolution {} m and the origin {}; expected finite numbers, the resolution "
                                "above 0".format(info.resolution, tuple(place.tolist())))
        if not abs(turn) < 1e-6:
            return self._refuse("is rotated by {:.3f} rad; expected a map along the axes of its frame".format(turn))
        if not message.header.frame_id:
            return self._refuse("has no frame_id; expected the frame of the map")
        data = np.asarray(message.data, np.int8).reshape(info.height, info.width)
        made = Costmap(costs_of_occupancy(data), float(info.resolution), place, message.header.frame_id)
        with self._lock:
            last, self.costmap = self.costmap, made
        if last is not None and _shrinks(last, made):
            rospy.logwarn_throttle(TELL, "the map on %s has shrunk from %s to %s; what is outside is unknown again" % (
                self.topic, _extent(last), _extent(made)))
        return None

    def _refuse(self, reason: str) -> None:
        rospy.logwarn_throttle(TELL, "the map on %s is not used: it %s" % (self.topic, reason))

    def _on_update(self, message: OccupancyGridUpdate) -> None:
        with self._lock:
            if self.costmap is None:
                return
            rows, columns = self.costmap.shape
            if message.x < 0 or message.y < 0 or message.x + message.width > columns \
                    or message.y + message.height > rows or len(message.data) != message.width * message.height:
                rospy.logwarn_throttle(TELL, "a change of %d x %d cells at (%d, %d) does not fit the map on %s of "
                                       "%d x %d; it is not used" % (message.width, message.height, message.x, message.y,
                                                                    self.topic, columns, rows))
                return
            data = np.asarray(message.data, np.int8).reshape(message.height, message.width)
            self.costmap.costs[message.y:message.y + message.height,
                               message.x:message.x + message.width] = costs_of_occupancy(data)

    def snapshot(self) -> Optional[Costmap]:
        """Return a copy of the newest map, or None."""
        with self._lock:
            return None if self.costmap is None else self.costmap.copy()
