# SPDX-License-Identifier: BSD-3-Clause
"""What a VoxelLayer publishes: its columns, and where its rays ended."""
from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
import roslib.message
import rospy
from sensor_msgs.msg import PointCloud

if TYPE_CHECKING:
    from m2wr_navigation.costmap.voxel_layer import VoxelLayer

KIND = "costmap_2d/VoxelGrid"
_LENGTH = struct.Struct("<I")
_PLACE = struct.Struct("<3f3d3I")       # origin, resolutions, sizes


class ArrayCloud(PointCloud):
    """A PointCloud without channels whose ``points`` are an array (N, 3)."""

    def serialize(self, buff: BinaryIO) -> None:
        """Write the message."""
        self.header.serialize(buff)
        points = np.ascontiguousarray(self.points, np.float32)
        buff.write(_LENGTH.pack(len(points)) + points.tobytes() + _LENGTH.pack(0))


def array_grid(kind: Any) -> Any:
    """Return a kind of VoxelGrid whose ``data`` is an array (H, W) uint32.

    Parameters
    ----------
    kind : type
        The message costmap_2d/VoxelGrid.
    """
    class ArrayVoxelGrid(kind):     # type: ignore[misc]
        """A VoxelGrid that writes its columns in one piece."""

        def serialize(self, buff: BinaryIO) -> None:
            """Write the message."""
            self.header.serialize(buff)
            columns, origin, sides = np.ascontiguousarray(self.data, np.uint32), self.origin, self.resolutions
            buff.write(_LENGTH.pack(columns.size) + columns.tobytes())
            buff.write(_PLACE.pack(origin.x, origin.y, origin.z, sides.x, sides.y, sides.z, self.size_x, self.size_y,
                                   self.size_z))

    return ArrayVoxelGrid


def grid_message(kind: Any, layer: VoxelLayer, frame: str, stamp: rospy.Time) -> Any:
    """Return the columns of a layer.

    Parameters
    ----------
    kind : type
        Of :func:`array_grid`.
    layer : VoxelLayer
    frame : str
        Of the costmap.
    stamp : rospy.Time
    """
    place, values, (rows, columns) = layer.costs, layer.values, layer.columns.shape
    message = kind(size_x=columns, size_y=rows, size_z=values["z_voxels"], data=layer.columns.copy())
    message.header.frame_id, message.header.stamp = frame, stamp
    message.origin.x, message.origin.y, message.origin.z = *place.origin, values["origin_z"]
    message.resolutions.x = message.resolutions.y = place.resolution
    message.resolutions.z = values["z_resolution"]
    return message


class VoxelOutputs:
    """Publishes ``clearing_endpoints``, and with ``publish_voxel_map`` also ``voxel_grid``, to those who subscribe.

    Parameters
    ----------
    layer : VoxelLayer
    place : str
        Namespace of the layer.
    frame : str
        Of the costmap.
    """

    def __init__(self, layer: VoxelLayer, place: str, frame: str) -> None:
        self._layer, self._frame = layer, frame
        self._grid: Any = None
        self._kind: Any = None
        self._ends = rospy.Publisher(place + "/clearing_endpoints", PointCloud, queue_size=10)
        if layer.values["publish_voxel_map"]:
            kind = roslib.message.get_message_class(KIND)
            if kind is None:
                rospy.logwarn("%s/voxel_grid is not published: there is no message %s; expected the package costmap_2d "
                              "in this workspace", place, KIND)
                return
            self._kind = array_grid(kind)
            self._grid = rospy.Publisher(place + "/voxel_grid", kind, queue_size=1)

    def publish(self, stamp: rospy.Time) -> None:
        """Publish what the last update has changed; the caller holds the costmap's lock.

        Parameters
        ----------
        stamp : rospy.Time
            Of the update.
        """
        if self._ends.get_num_connections():
            for seen, ends in self._layer.ray_ends:
                cloud = ArrayCloud(points=ends)
                cloud.header.frame_id, cloud.header.stamp = self._frame, rospy.Time.from_sec(seen)
                self._ends.publish(cloud)
        if self._grid is not None and self._grid.get_num_connections():
            self._grid.publish(grid_message(self._kind, self._layer, self._frame, stamp))
