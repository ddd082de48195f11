# SPDX-License-Identifier: BSD-3-Clause
"""Messages from arrays and back; grids without a Python number for each cell."""
from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, BinaryIO, List, Sequence, Union

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from nav_msgs.msg import MapMetaData, OccupancyGrid, Path
from nav_msgs.srv import GetMapResponse
from std_msgs.msg import Header

if TYPE_CHECKING:
    import genpy
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray, Int8Array

_COUNT = struct.Struct("<I")


class ArrayGrid(OccupancyGrid):
    """An OccupancyGrid whose ``data`` is an array of bytes, written and read in one piece.

    The standard message creates a Python number for every cell: about a second for 16 million cells.
    """

    def serialize(self, buff: BinaryIO) -> None:
        """Write the message."""
        self.header.serialize(buff)
        self.info.serialize(buff)
        data = np.ascontiguousarray(self.data, np.int8)
        buff.write(_COUNT.pack(data.size))
        buff.write(data.data)           # not tobytes(), which copies 16 MB at the default size

    def deserialize(self, str: bytes) -> ArrayGrid:       # noqa: A002, the name is that of the class above
        """Read the message; ``data`` becomes an array (W * H,) int8."""
        self.header, self.info, self.data = Header(), MapMetaData(), np.zeros(0, np.int8)
        at = _read(self.info, str, _read(self.header, str, 0))
        count, = _COUNT.unpack_from(str, at)
        self.data = np.frombuffer(str, np.int8, count, at + _COUNT.size)
        return self


def _read(part: Union[Header, MapMetaData], data: bytes, start: int) -> int:
    """Read a message from the middle of bytes; return where it ends."""
    size = struct.calcsize
    if isinstance(part, Header):
        length, = _COUNT.unpack_from(data, start + 12)
        end = start + 16 + length
    else:
        end = start + size("<IIfII") + size("<7d")
    part.deserialize(data[start:end])
    return end


class ArrayMapAnswer(GetMapResponse):
    """The answer of ``dynamic_map``, written in one piece; ``map`` is an ArrayGrid."""

    def serialize(self, buff: BinaryIO) -> None:
        """Write the message."""
        self.map.serialize(buff)

    def deserialize(self, str: bytes) -> ArrayMapAnswer:       # noqa: A002
        """Read the message."""
        self.map = ArrayGrid()
        self.map.deserialize(str)
        return self


class ArrayPath(Path):
    """A Path that is written from arrays in one piece: ``stamps`` (K,) in seconds and ``plane`` (K, 3), x y theta.

    The standard message creates about thirty Python objects for each pose with every map.
    """

    def serialize(self, buff: BinaryIO) -> None:
        """Write the message."""
        self.header.serialize(buff)
        frame = self.header.frame_id.encode()
        rows = np.zeros(len(self.plane), [("seq", "<u4"), ("time", "<u4", 2), ("length", "<u4"),
                                          ("frame", "u1", (len(frame),)), ("pose", "<f8", 7)])
        seconds = np.floor(self.stamps)
        rows["time"][:, 0], rows["time"][:, 1] = seconds, np.minimum(np.rint(1e9 * (self.stamps - seconds)), 999999999)
        rows["length"], rows["pose"] = len(frame), pose_rows(self.plane)
        rows["frame"] = np.frombuffer(frame, np.uint8)
        buff.write(_COUNT.pack(len(rows)))
        buff.write(rows.data)


class ArrayPoses(PoseArray):
    """A PoseArray that is written from an array ``plane`` (K, 3), x y theta, in one piece."""

    def serialize(self, buff: BinaryIO) -> None:
        """Write the message."""
        self.header.serialize(buff)
        buff.write(_COUNT.pack(len(self.plane)))
        buff.write(pose_rows(self.plane).data)


def pose_rows(poses: FloatArray) -> FloatArray:
    """Return position and quaternion (K, 7) of poses (K, 3), x y theta."""
    rows = np.zeros((len(poses), 7))
    rows[:, :2], rows[:, 5], rows[:, 6] = poses[:, :2], np.sin(0.5 * poses[:, 2]), np.cos(0.5 * poses[:, 2])
    return rows


def path_message(poses: ArrayLike, stamps: ArrayLike, header: Header) -> ArrayPath:
    """Return a path.

    Parameters
    ----------
    poses : (K, 3) float
        [m, m, rad]
    stamps : (K,) float
        [s]
    header : std_msgs.msg.Header
        Its frame is that of all poses.
    """
    message = ArrayPath(header=header)
    message.plane, message.stamps = np.asarray(poses, float).reshape(-1, 3), np.asarray(stamps, float)
    return message


def poses_message(poses: ArrayLike, frame: str, stamp: genpy.Time) -> ArrayPoses:
    """Return an array of poses.

    Parameters
    ----------
    poses : (K, 3) float
        [m, m, rad]
    frame : str
        Frame of the poses.
    stamp : genpy.Time
    """
    message = ArrayPoses()
    message.header.frame_id, message.header.stamp = frame, stamp
    message.plane = np.asarray(poses, float).reshape(-1, 3)
    return message


def pose_message(pose: Union[Sequence[float], FloatArray]) -> Pose:
    """Return a Pose from x, y, theta."""
    return Pose(Point(float(pose[0]), float(pose[1]), 0.0),
                Quaternion(0.0, 0.0, math.sin(0.5 * pose[2]), math.cos(0.5 * pose[2])))


def grid_message(data: Int8Array, resolution: float, origin: Union[Sequence[float], FloatArray], frame: str,
                 stamp: genpy.Time) -> ArrayGrid:
    """Return the message of a map.

    Parameters
    ----------
    data : (H, W) int8
        -1 unknown, 0 free to 100 occupied; row 0 is the lowest y.
    resolution : float
        Cell size [m].
    origin : (3,) float
        x, y [m], yaw [rad] of the map's lower left corner in its frame.
    frame : str
        Frame of the map.
    stamp : genpy.Time
    """
    message = ArrayGrid()
    message.header.frame_id, message.header.stamp = frame, stamp
    message.info.map_load_time = stamp
    message.info.resolution = resolution
    message.info.height, message.info.width = data.shape
    message.info.origin = pose_message(origin)
    message.data = data.ravel()
    return message


def covariance36(covariance: FloatArray) -> List[float]:
    """Return the 36 numbers of a PoseWithCovariance from the covariance (3, 3) of x, y, theta."""
    full = np.zeros((6, 6))
    at = np.array([0, 1, 5])
    full[np.ix_(at, at)] = covariance
    numbers: List[float] = full.ravel().tolist()
    return numbers
