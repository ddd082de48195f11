# SPDX-License-Identifier: BSD-3-Clause
"""``costmap_2d_markers`` and ``costmap_2d_cloud``: show a VoxelGrid."""
from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, Callable, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point, Point32
from sensor_msgs.msg import ChannelFloat32, PointCloud
from visualization_msgs.msg import Marker

from m2wr_navigation.costmap.voxel_columns import VoxelError, centres
from m2wr_node.ros.starting import start_node

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

Colour = Tuple[float, float, float, float]
MARKED: Colour = (1.0, 0.0, 0.0, 1.0)
UNKNOWN: Colour = (0.0, 1.0, 0.0, 0.5)


def cells_of(message: Any) -> Tuple[FloatArray, FloatArray]:
    """Return the centres of the marked and of the unknown cells of a message; raises VoxelError.

    Parameters
    ----------
    message : costmap_2d/VoxelGrid
    """
    origin, sides = message.origin, message.resolutions
    return centres(message.data, (message.size_x, message.size_y, message.size_z), (origin.x, origin.y, origin.z),
                   (sides.x, sides.y, sides.z))


def marker_of(message: Any) -> Marker:
    """Return the marked cells as a list of cubes.

    Parameters
    ----------
    message : costmap_2d/VoxelGrid
    """
    marker = Marker(header=message.header, ns=rospy.get_name(), id=0, type=Marker.CUBE_LIST, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.scale = message.resolutions
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = MARKED
    marker.points = [Point(*place) for place in cells_of(message)[0].tolist()]
    return marker


def cloud_of(message: Any, places: FloatArray, colour: Colour) -> PointCloud:
    """Return cells as points with a colour.

    Parameters
    ----------
    message : costmap_2d/VoxelGrid
        Whose header is taken.
    places : (N, 3) float64
        [m]
    colour : four floats
        Red, green, blue, opacity.
    """
    # rviz reads one channel "rgb" whose bits are those of three bytes
    bits = np.array([int(255.0 * part) for part in colour[:3]], np.uint32)
    packed = struct.unpack("<f", struct.pack("<I", int(bits[0] << 16 | bits[1] << 8 | bits[2])))[0]
    return PointCloud(header=message.header, points=[Point32(*place) for place in places.tolist()],
                      channels=[ChannelFloat32(name="rgb", values=[packed] * len(places))])


def _told(show: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return a callback that tells why a grid cannot be shown."""
    def take(message: Any) -> None:
        try:
            show(message)
        except VoxelError as error:
            rospy.logwarn_throttle(10.0, "a message of {} is not shown: {}".format(
                rospy.resolve_name("voxel_grid"), error))
    return take


def markers(kind: Any) -> int:
    """Run ``costmap_2d_markers``; return its exit code.

    Parameters
    ----------
    kind : type
        The message costmap_2d/VoxelGrid, which the package of this name has.
    """
    start_node("costmap_2d_markers")
    publisher = rospy.Publisher("visualization_marker", Marker, queue_size=1)
    rospy.Subscriber("voxel_grid", kind, _told(lambda message: publisher.publish(marker_of(message))), queue_size=1)
    rospy.spin()
    return 0


def cloud(kind: Any) -> int:
    """Run ``costmap_2d_cloud``; return its exit code.

    Parameters
    ----------
    kind : type
        As for :func:`markers`.
    """
    start_node("costmap_2d_cloud")
    publishers = [rospy.Publisher(topic, PointCloud, queue_size=2) for topic in ("voxel_marked_cloud",
                                                                                 "voxel_unknown_cloud")]

    def show(message: Any) -> None:
        for publisher, places, colour in zip(publishers, cells_of(message), (MARKED, UNKNOWN)):
            publisher.publish(cloud_of(message, places, colour))

    rospy.Subscriber("voxel_grid", kind, _told(show), queue_size=1)
    rospy.spin()
    return 0
