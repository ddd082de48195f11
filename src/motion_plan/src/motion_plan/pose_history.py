# SPDX-License-Identifier: BSD-3-Clause
"""The poses of the last second, to transform a scan by the pose at its stamp."""
from __future__ import annotations

import math
from collections import deque
from typing import Deque, Optional, Tuple

from motion_plan.angles import wrap_angle
from motion_plan.planar_types import Pose

#: Largest possible distance between two poses: a constant [m], plus this speed [m/s] times the interval.
JUMP_DISTANCE = 0.3
JUMP_SPEED = 3.0


class PoseHistory:
    """Time-stamped planar poses.

    Parameters
    ----------
    length : int
        Number of poses kept.
    """

    def __init__(self, length: int = 40) -> None:
        self._poses: Deque[Tuple[float, Pose]] = deque(maxlen=length)

    def add(self, stamp: float, pose: Pose) -> None:
        """Add a pose; a stamp in the past starts a new history.

        Parameters
        ----------
        stamp : float
            Time of the pose [s].
        pose : (float, float, float)
            x, y [m] and yaw [rad].
        """
        if self._poses and stamp < self._poses[-1][0]:
            self._poses.clear()
        if self._poses and stamp == self._poses[-1][0]:
            self._poses.pop()
        self._poses.append((stamp, pose))

    def is_jump(self, stamp: float, pose: Pose) -> bool:
        """Return whether the robot was moved to a pose: it cannot have driven there by ``stamp``.

        Parameters
        ----------
        stamp : float
            Time of the pose [s].
        pose : (float, float, float)
            x, y [m] and yaw [rad].
        """
        if not self._poses or stamp < self._poses[-1][0]:
            return False
        before, (x, y, _) = self._poses[-1]
        return math.hypot(pose[0] - x, pose[1] - y) > JUMP_DISTANCE + JUMP_SPEED * (stamp - before)

    def clear(self) -> None:
        """Forget all poses."""
        self._poses.clear()

    def latest(self) -> Optional[Pose]:
        """Return the newest pose, or None."""
        return self._poses[-1][1] if self._poses else None

    def at(self, stamp: float) -> Optional[Pose]:
        """Return the pose at ``stamp`` [s], interpolated; the first or last one for a time outside, None if empty."""
        if not self._poses:
            return None
        later: Optional[Tuple[float, Pose]] = None
        for time, pose in reversed(self._poses):
            if time <= stamp:
                if later is None:
                    return pose
                part = (stamp - time) / (later[0] - time)
                turn = wrap_angle(later[1][2] - pose[2])
                return (pose[0] + part * (later[1][0] - pose[0]), pose[1] + part * (later[1][1] - pose[1]),
                        wrap_angle(pose[2] + part * turn))
            later = (time, pose)
        assert later is not None
        return later[1]
