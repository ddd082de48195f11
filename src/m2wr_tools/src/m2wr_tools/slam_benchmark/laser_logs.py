# SPDX-License-Identifier: BSD-3-Clause
"""Laser logs with their ground truth, and conversion of CARMEN logs to bags."""
from __future__ import annotations

import glob
import gzip
import lzma
import math
import os
import shutil
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Optional, Sequence, Tuple

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

PACKED = ("", ".xz", ".gz")
EPOCH = 1000.0              # added to the stamps of a log, which may start at 0; ROS treats 0 as unset [s]
RANGE_MIN, RANGE_MAX = 0.05, 80.0       # a beam without a return is about 81.9 m in logs
ODOM = "odom"               # frame of odometry
FINE_FROM = 182             # logs with at least this number of beams have a resolution of 0.5 degrees


class LogError(ValueError):
    """A log or a ground truth file cannot be read; the message names it and gives the reason."""


@dataclass(frozen=True)
class Log:
    """One recording.

    Attributes
    ----------
    name, path : str
    truth : dict
        Kind (``relations``, ``graph`` or ``ref``) -> path.
    """

    name: str
    path: str
    truth: Dict[str, str]

    @property
    def is_bag(self) -> bool:
        """Whether the log is a bag."""
        return ".bag" in os.path.basename(self.path)


def opened(path: str) -> Any:
    """Open a text file, compressed or not."""
    if path.endswith(".xz"):
        return lzma.open(path, "rt", errors="replace")
    if path.endswith(".gz"):
        return gzip.open(path, "rt", errors="replace")
    return open(path, errors="replace")


def find(folder: str, names: Optional[Sequence[str]] = None) -> List[Log]:
    """Return the logs of a folder: NAME.clf or NAME.bag, compressed or not.

    Parameters
    ----------
    folder : str
        Folder.
    names : sequence of str or None
        Names of the logs; default all.

    Raises
    ------
    LogError
        If there is none, or one of ``names`` is missing.
    """
    found: Dict[str, Log] = {}
    for path in sorted(glob.glob(os.path.join(folder, "*"))):
        for ending in (kind + packed for kind in (".clf", ".bag") for packed in PACKED):
            if path.endswith(ending):
                name = os.path.basename(path)[:-len(ending)]
                truth = {kind: file for kind in ("relations", "graph", "ref") for file in (
                    os.path.join(folder, "{}.{}{}".format(name, kind, packed)) for packed in PACKED)
                    if os.path.isfile(file)}
                found.setdefault(name, Log(name, path, truth))
    missing = [name for name in names or () if name not in found]
    if missing or not found:
        raise LogError("{}: no log {}; expected NAME.clf or NAME.bag, or packed (.xz, .gz); found {}".format(
            folder, ", ".join(missing) or "at all", ", ".join(sorted(found)) or "nothing"))
    return [found[name] for name in names or sorted(found)]


def records(path: str) -> Iterator[Tuple[float, List[float], Optional[List[float]]]]:
    """Yield stamp, raw odometry (3,) and ranges or None of each ODOM and FLASER line of a CARMEN log."""
    with opened(path) as stream:
        for number, line in enumerate(stream, 1):
            words = line.split()
            try:
                if words[:1] == ["ODOM"]:
                    yield float(words[7]), [float(word) for word in words[1:4]], None
                elif words[:1] == ["FLASER"]:
                    end = 2 + int(words[1])
                    yield (float(words[end + 6]), [float(word) for word in words[end + 3:end + 6]],
                           [float(word) for word in words[2:end]])
            except (ValueError, IndexError) as error:
                raise LogError("{}: line {} cannot be read: {}".format(path, number, error)) from error


def odometry(path: str) -> Tuple[FloatArray, FloatArray]:
    """Return stamps (K,) and raw odometry poses (K, 3) of a CARMEN log, sorted by time."""
    rows = sorted((stamp, pose) for stamp, pose, _ in records(path))
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows]).reshape(-1, 3)


def bag_odometry(path: str) -> Optional[Tuple[FloatArray, FloatArray]]:
    """Return stamps (K,) and poses (K, 3) of the odometry in a bag, sorted by time; None if it has none.

    These are the transforms from ``odom`` to one of its children, the one that comes first.

    Parameters
    ----------
    path : str

    Raises
    ------
    LogError
        If the bag cannot be read.
    """
    found: List[Tuple[float, float, float, float]] = []
    child: Optional[str] = None
    try:
        with rosbag.Bag(path) as bag:
            for _, message, _ in bag.read_messages(topics=["/tf"]):
                for one in message.transforms:
                    if one.header.frame_id.lstrip("/") != ODOM or child not in (None, one.child_frame_id):
                        continue
                    child, place, turn = one.child_frame_id, one.transform.translation, one.transform.rotation
                    found.append((one.header.stamp.to_sec(), place.x, place.y, math.atan2(
                        2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y ** 2 + turn.z ** 2))))
    except (OSError, rosbag.ROSBagException) as error:
        raise LogError("{}: {}".format(path, error)) from error
    if not found:
        return None
    table = np.array(sorted(found))
    return table[:, 0], table[:, 1:]


def planar_transform(parent: str, child: str, stamp: Any, x: float, y: float, yaw: float) -> TransformStamped:
    """Return the message of a transform in the plane.

    Parameters
    ----------
    parent, child : str
        Frames.
    stamp : rospy.Time
    x, y, yaw : float
        Pose of the child in the parent [m, m, rad].
    """
    message = TransformStamped(child_frame_id=child)
    message.header.stamp, message.header.frame_id = stamp, parent
    message.transform.translation.x, message.transform.translation.y = x, y
    message.transform.rotation.z, message.transform.rotation.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    return message


def _scan(ranges: List[float], stamp: Any) -> LaserScan:
    step = math.radians(0.5 if len(ranges) >= FINE_FROM else 1.0)
    message = LaserScan(angle_min=-0.5 * math.pi, angle_max=-0.5 * math.pi + step * (len(ranges) - 1),
                        angle_increment=step, range_min=RANGE_MIN, range_max=RANGE_MAX, ranges=ranges)
    message.header.stamp, message.header.frame_id = stamp, "laser"
    return message


def write_bag(log: Log, path: str, laser_x: float = 0.0) -> None:
    """Write a log as a bag with /scan and /tf (odom -> base_link -> laser); a log that is a bag is copied.

    ``EPOCH`` is added to the stamps of a CARMEN log. Its first beam points to the right.

    Parameters
    ----------
    log : Log
        The log.
    path : str
        Bag to write.
    laser_x : float
        Offset of the laser in front of odometry's reference point [m].

    Raises
    ------
    LogError
        If the log cannot be read or the bag cannot be written.
    """
    try:
        if log.is_bag:
            packed = lzma.open(log.path) if log.path.endswith(".xz") else gzip.open(log.path) if log.path.endswith(
                ".gz") else open(log.path, "rb")
            with packed, open(path, "wb") as stream:
                shutil.copyfileobj(packed, stream)
            return
        with rosbag.Bag(path, "w") as bag:
            for seconds, pose, ranges in records(log.path):
                stamp = rospy.Time.from_sec(EPOCH + seconds)
                bag.write("/tf", TFMessage([planar_transform("odom", "base_link", stamp, *pose),
                                            planar_transform("base_link", "laser", stamp, laser_x, 0.0, 0.0)]), stamp)
                if ranges is not None:
                    bag.write("/scan", _scan(ranges, stamp), stamp)
    except (OSError, EOFError, lzma.LZMAError) as error:
        raise LogError("{}: {}".format(log.path, error)) from error
