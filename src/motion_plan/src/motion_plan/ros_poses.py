# SPDX-License-Identifier: BSD-3-Clause
"""Poses clicked in rviz or published by hand: checked, and transformed to another frame by tf."""
from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any, Callable, List

import rospy

from motion_plan.angles import wrap_angle, yaw_of_quaternion

if TYPE_CHECKING:
    from geometry_msgs.msg import Pose as PoseMessage

    from motion_plan.planar_types import Pose

#: Wall seconds to wait for a transform: each pose has a new listener, which needs time to receive transforms.
TF_PATIENCE = 2.0
TF_PAUSE = 0.02


class PoseError(Exception):
    """A pose cannot be used; the text is the reason, as a part of a sentence."""


def planar(pose: PoseMessage) -> Pose:
    """Return (x, y, yaw) of a geometry_msgs/Pose; an all-zero quaternion means no rotation.

    Raises
    ------
    PoseError
        If one of the numbers is not finite.
    """
    position, q = pose.position, pose.orientation
    if not all(math.isfinite(value) for value in (position.x, position.y, q.x, q.y, q.z, q.w)):
        raise PoseError('position (%s, %s), orientation (%s, %s, %s, %s): expected finite numbers'
                        % (position.x, position.y, q.x, q.y, q.z, q.w))
    return position.x, position.y, yaw_of_quaternion(q.x, q.y, q.z, q.w)


def moved_by(transform: Pose, pose: Pose) -> Pose:
    """Return a pose in the target frame of a transform.

    Parameters
    ----------
    transform : (float, float, float)
        x, y [m] and yaw [rad] of the frame of ``pose`` in the target frame.
    pose : (float, float, float)
        x, y [m] and yaw [rad].
    """
    cos, sin = math.cos(transform[2]), math.sin(transform[2])
    return (transform[0] + cos * pose[0] - sin * pose[1], transform[1] + sin * pose[0] + cos * pose[1],
            wrap_angle(transform[2] + pose[2]))


def look_up(target: str, source: str, patience: float = TF_PATIENCE) -> Pose:
    """Return (x, y, yaw) of the frame ``source`` in the frame ``target``, the newest that tf has.

    Listens to tf only for this answer: a permanent listener costs more than the node itself.

    Parameters
    ----------
    target : str
        Frame of the result.
    source : str
        Frame whose pose is wanted.
    patience : float
        Longest time to wait [s of wall time].

    Raises
    ------
    PoseError
        If tf does not connect the two within ``patience`` seconds of wall time.
    """
    import tf2_ros  # slow to import, and most runs do not need it

    from m2wr_node.ros.transform_buffer import TransformBuffer
    buffer = TransformBuffer(debug=False)
    listener = tf2_ros.TransformListener(buffer)
    try:
        deadline = time.monotonic() + patience
        while True:
            try:
                transform = buffer.lookup_transform_core(target, source, rospy.Time(0)).transform
                turn = transform.rotation
                return (transform.translation.x, transform.translation.y,
                        yaw_of_quaternion(turn.x, turn.y, turn.z, turn.w))
            except tf2_ros.TransformException as error:
                if time.monotonic() > deadline or rospy.is_shutdown():
                    raise PoseError('tf has no transform from frame "%s" to "%s" (%s); known frames: %s' % (
                        source, target, error, ', '.join(sorted(_frames(buffer))) or 'none')) from error
            time.sleep(TF_PAUSE)
    finally:
        listener.unregister()


def _frames(buffer: Any) -> List[str]:
    """Return the names of the frames of a buffer."""
    return [line.split(':')[0] for line in buffer.all_frames_as_yaml().splitlines()
            if line.rstrip().endswith(':') and not line.startswith(' ')]


def planar_in(frame: str, header_frame: str, pose: PoseMessage,
              transform: Callable[[str, str], Pose] = look_up) -> Pose:
    """Return (x, y, yaw) of a pose in ``frame``.

    Parameters
    ----------
    frame : str
        Target frame.
    header_frame : str
        Frame of the pose; empty: ``frame``.
    pose : geometry_msgs/Pose
    transform : callable
        As :func:`look_up`.

    Raises
    ------
    PoseError
        If a number is not finite, or the frames are not connected.
    """
    here, source = planar(pose), header_frame.lstrip('/')
    if source in ('', frame.lstrip('/')):
        return here
    return moved_by(transform(frame.lstrip('/'), source), here)
