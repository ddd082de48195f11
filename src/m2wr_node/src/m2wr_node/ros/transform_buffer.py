# SPDX-License-Identifier: BSD-3-Clause
"""Transforms from other nodes: refused where tf2 would end the process or return infinite poses."""
from __future__ import annotations

import math
from typing import Any

import rospy
import tf2_ros

LATEST = 2**31          # s: beyond, sums and differences of stamps leave the range of ROS's times
FARTHEST = 1e9          # m: beyond any frame on earth (geocentric coordinates reach 6.4e6); sums stay exact to 1e-7 m


def frame(name: str) -> str:
    """Return a frame's name without the leading slash of tf 1."""
    return name.lstrip("/")


def is_out_of_range(stamp: Any) -> bool:
    """Return whether tf2 cannot calculate with a stamp (genpy.Time)."""
    return not 0 <= stamp.secs < LATEST


def fault_of(header: Any, child: str = "") -> str:
    """Return a sentence why a message with this header is refused, or an empty text.

    Parameters
    ----------
    header : std_msgs.msg.Header
    child : str
        Child frame, of a transform.
    """
    if is_out_of_range(header.stamp):
        return "its stamp is %d s; expected 0 to %d" % (header.stamp.secs, LATEST)
    if "\0" in header.frame_id or "\0" in child:
        return "a frame id holds a NUL character; expected a name"
    return ""


def fault_of_transform(transform: Any) -> str:
    """Return a sentence why a transform (geometry_msgs/TransformStamped) is refused, or an empty text.

    tf2 itself refuses NaN and quaternions that are not normalised, but neither infinite nor huge translations.
    """
    fault = fault_of(transform.header, transform.child_frame_id)
    if fault:
        return fault
    shift, turn = transform.transform.translation, transform.transform.rotation
    if not all(abs(value) <= FARTHEST for value in (shift.x, shift.y, shift.z)):
        return "its translation is (%g, %g, %g) m; expected numbers up to %g" % (shift.x, shift.y, shift.z, FARTHEST)
    if not all(map(math.isfinite, (turn.x, turn.y, turn.z, turn.w))):
        return "its rotation is (%g, %g, %g, %g); expected finite numbers" % (turn.x, turn.y, turn.z, turn.w)
    return ""


class TransformBuffer(tf2_ros.Buffer):
    """A buffer that refuses such transforms, for a ``tf2_ros.TransformListener``."""

    def set_transform(self, transform: Any, authority: str) -> None:
        """Add a transform.

        Parameters
        ----------
        transform : geometry_msgs.msg.TransformStamped
        authority : str
            Name of the sender, for messages.
        """
        if not self._refused(transform, authority):
            super().set_transform(transform, authority)

    def set_transform_static(self, transform: Any, authority: str) -> None:
        """Add a transform that is valid at all times.

        Parameters
        ----------
        transform : geometry_msgs.msg.TransformStamped
        authority : str
            Name of the sender, for messages.
        """
        if not self._refused(transform, authority):
            super().set_transform_static(transform, authority)

    @staticmethod
    def _refused(transform: Any, authority: str) -> bool:
        fault = fault_of_transform(transform)
        if fault:
            rospy.logwarn_throttle(10.0, "transform %s -> %s of %s refused: %s" % (
                transform.header.frame_id, transform.child_frame_id, authority, fault))
        return bool(fault)
