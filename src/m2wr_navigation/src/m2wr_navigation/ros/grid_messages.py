# SPDX-License-Identifier: BSD-3-Clause
"""Messages of costmaps and clouds from arrays, written in one piece."""
from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, BinaryIO, List

import numpy as np
from map_msgs.msg import OccupancyGridUpdate
from sensor_msgs.msg import PointCloud2, PointField

from m2wr_maps.ros import message_conversion

if TYPE_CHECKING:
    import rospy

    from m2wr_maps.ros.message_conversion import ArrayGrid
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_navigation.costmap.layer import Window
    from m2wr_node.array_types import Float32Array, FloatArray, Int8Array

_PLACE = struct.Struct("<iiIII")


def _occupancy_table() -> Int8Array:
    """Return the occupancy (256,) int8 of each cost, as Costmap2DPublisher."""
    table = np.zeros(256, np.int16)
    table[1:253] = 1 + 97 * (np.arange(1, 253) - 1) // 251
    table[253], table[254], table[255] = 99, 100, -1
    return table.astype(np.int8)


OCCUPANCY = _occupancy_table()


class ArrayUpdate(OccupancyGridUpdate):
    """An OccupancyGridUpdate whose ``data`` is an array (h, w) int8."""

    def serialize(self, buff: BinaryIO) -> None:
        """Write the message."""
        self.header.serialize(buff)
        data = np.ascontiguousarray(self.data, np.int8)
        buff.write(_PLACE.pack(self.x, self.y, self.width, self.height, data.size))
        buff.write(data.data)


def grid_message(costmap: Costmap, stamp: rospy.Time) -> ArrayGrid:
    """Return a whole costmap.

    Parameters
    ----------
    costmap : Costmap
    stamp : rospy.Time
    """
    return message_conversion.grid_message(OCCUPANCY[costmap.costs], costmap.resolution, (*costmap.origin, 0.0),
                                           costmap.frame, stamp)


def update_message(costmap: Costmap, window: Window, stamp: rospy.Time) -> ArrayUpdate:
    """Return a window of a costmap.

    Parameters
    ----------
    costmap : Costmap
    window : Window
    stamp : rospy.Time
    """
    message = ArrayUpdate()
    message.header.frame_id, message.header.stamp = costmap.frame, stamp
    message.x, message.y = window.left, window.top
    message.width, message.height = window.right - window.left, window.bottom - window.top
    message.data = OCCUPANCY[costmap.costs[window.slices]]
    return message


def cloud_message(points: Any, names: List[str], frame: str, stamp: rospy.Time) -> PointCloud2:
    """Return a PointCloud2 of 32-bit floats.

    Parameters
    ----------
    points : (N, K) float
    names : list of str
        Of the K fields.
    frame : str
    stamp : rospy.Time
    """
    rows: Float32Array = np.ascontiguousarray(points, np.float32)
    message = PointCloud2(height=1, width=len(rows), is_dense=True, point_step=4 * len(names),
                          row_step=4 * len(names) * len(rows), data=rows.tobytes())
    message.fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate(names)]
    message.header.frame_id, message.header.stamp = frame, stamp
    return message


def potential_points(costmap: Costmap, potential: Any) -> FloatArray:
    """Return the cells (N, 4) that have a potential: x, y, z = 0 and the potential.

    Parameters
    ----------
    costmap : Costmap
    potential : (H, W) float32
    """
    rows, columns = np.nonzero(np.isfinite(potential))
    points = np.zeros((len(rows), 4))
    points[:, 0] = costmap.origin[0] + (columns + 0.5) * costmap.resolution
    points[:, 1] = costmap.origin[1] + (rows + 0.5) * costmap.resolution
    points[:, 3] = potential[rows, columns]
    return points
