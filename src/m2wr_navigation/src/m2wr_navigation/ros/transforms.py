# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses from tf, with a sentence where there is none: frames, age, tolerance."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Optional, Tuple

import numpy as np
import rospy
import tf2_ros

from m2wr_node.ros.transform_buffer import TransformBuffer, frame

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray


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
            raise TransformError("there is no transform from {} to {}{}: {}".format(
                frame(source), frame(target), " at %.3f" % stamp.to_sec() if stamp else "",
                str(error).split("when looking up")[0].strip())) from error

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
                                 "(transform_tolerance)".format(frame(source), frame(target), age, tolerance))
        return pose
