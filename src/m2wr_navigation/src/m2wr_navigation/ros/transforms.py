# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses from tf, with a sentence where there is none: frames, age, tolerance, and the node that lags."""
from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np
import rospy
import tf2_ros

from m2wr_node.ros.transform_buffer import TransformBuffer, frame

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray


# an entry of all_frames_as_yaml: child frame, parent frame, name of the node, newest stamp
_ENTRY = re.compile(r"^(.+): \n  parent: '(.*)'\n  broadcaster: '(.*)'\n  rate: .*\n"
                    r"  most_recent_transform: (\S+)$", re.M)


class TransformError(Exception):
    """A transform is not known; the text is a sentence that names it."""


def quaternion_yaw(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw of a quaternion [rad].

    Parameters
    ----------
    x, y, z, w : float
        Of any length but 0.
    """
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def yaw_of(rotation: Any) -> float:
    """Return the yaw of a quaternion message [rad]."""
    return quaternion_yaw(rotation.x, rotation.y, rotation.z, rotation.w)


def _to_root(frame_id: str, parents: Dict[str, str]) -> List[str]:
    """Return a frame and those above it."""
    chain = [frame_id]
    while parents.get(chain[-1]) and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    return chain


def oldest_part(frames: str, target: str, source: str) -> str:
    """Return which transform between two frames has the oldest newest stamp, and who sends it; empty: none is known.

    Parameters
    ----------
    frames : str
        Of ``tf2_ros.Buffer.all_frames_as_yaml``.
    target, source : str
        Frames.
    """
    entries = {child: (parent, sender, float(stamp)) for child, parent, sender, stamp in _ENTRY.findall(frames)}
    parents = {child: entry[0] for child, entry in entries.items()}
    one, other = _to_root(target, parents), _to_root(source, parents)
    between = set(one) ^ set(other)
    moving = [(entries[child][2], child) for child in between if child in entries and entries[child][2] > 0.0]
    if not moving or one[-1] != other[-1]:
        return ""
    child = min(moving)[1]
    return "from {} to {}, which {} sends".format(child, entries[child][0], entries[child][1])


class Transforms:
    """Listens to tf."""

    def __init__(self) -> None:
        self.buffer = TransformBuffer(rospy.Duration(30.0), debug=False)
        self._listener = tf2_ros.TransformListener(self.buffer)

    def message(self, target: str, source: str, stamp: Optional[rospy.Time] = None) -> Any:
        """Return the TransformStamped of ``source`` in ``target``.

        Parameters
        ----------
        target, source : str
            Frames.
        stamp : rospy.Time, optional
            Default: the newest that all transforms in between have.

        Raises
        ------
        TransformError
        """
        try:
            return self.buffer.lookup_transform(frame(target), frame(source), stamp or rospy.Time(0))
        except (tf2_ros.LookupException, tf2_ros.ConnectivityException, tf2_ros.ExtrapolationException,
                tf2_ros.InvalidArgumentException) as error:
            raise TransformError("there is no transform from {} to {}{}: {}{}".format(
                frame(source), frame(target), " at %.3f" % stamp.to_sec() if stamp else "",
                str(error).split("when looking up")[0].strip().rstrip(".,"), self._origin(target, source))) from error

    def pose(self, target: str, source: str, stamp: Optional[rospy.Time] = None) -> FloatArray:
        """Return x, y, yaw (3,) of a frame in another [m, m, rad].

        Parameters
        ----------
        target, source : str
            Frames.
        stamp : rospy.Time, optional
            Default: the newest.

        Raises
        ------
        TransformError
        """
        return self.stamped_pose(target, source, stamp)[0]

    def stamped_pose(self, target: str, source: str, stamp: Optional[rospy.Time] = None) -> Tuple[FloatArray, float]:
        """Return x, y, yaw (3,) of a frame in another [m, m, rad], and the stamp of this pose [s].

        Parameters
        ----------
        target, source : str
            Frames.
        stamp : rospy.Time, optional
            Default: the newest.

        Raises
        ------
        TransformError
        """
        found = self.message(target, source, stamp)
        shift = found.transform.translation
        return np.array([shift.x, shift.y, yaw_of(found.transform.rotation)]), found.header.stamp.to_sec()

    def fresh_pose(self, target: str, source: str, tolerance: float) -> FloatArray:
        """Return the newest pose (3,) of a frame in another, if it is not too old.

        Parameters
        ----------
        target, source : str
            Frames.
        tolerance : float
            Greatest age [s].

        Raises
        ------
        TransformError
        """
        pose, stamp = self.stamped_pose(target, source)
        age = rospy.get_time() - stamp
        if stamp > 0.0 and age > tolerance:         # a stamp of 0: all transforms are static
            raise TransformError("the transform from {} to {} is {:.2f} s old; expected at most {:g} s "
                                 "(transform_tolerance){}".format(frame(source), frame(target), age, tolerance,
                                                                  self._origin(target, source)))
        return pose

    def _origin(self, target: str, source: str) -> str:
        """Return the end of a sentence about a transform that is late: which part is the oldest."""
        part = oldest_part(self.buffer.all_frames_as_yaml(), frame(target), frame(source))
        return "; the oldest part is that " + part if part else ""
