# SPDX-License-Identifier: BSD-3-Clause
"""Detects that the robot drives along its own track again: the circuit around an obstacle is closed."""
from __future__ import annotations

import math

import numpy as np

from motion_plan.angles import wrap_angle
from motion_plan.planar_types import Pose

#: Spacing of the recorded track [m].
SPACING = 0.1
#: The old track is reached again within this distance [m] and heading difference [rad].
NEAR = 0.3
ALIGNED = math.radians(50.0)
#: The track [samples] must have at least this length before it can be reached again.
GAP = 20
#: The robot must have been this far from the place in between [m].
AWAY = 0.8
#: The closed circuit passes the hit point within this distance [m]; the hit is up to 0.7 m before the wall.
NEAR_START = 1.0
#: Samples at the start that do not count: the robot still joins the wall.
JOINING = 5
#: This number of consecutive samples (1 m of travel) must lie on the old track.
CONFIRM = 10
#: A loop shorter than this [samples] must be driven twice: in a place about as wide as the robot, noise may cause one
#: loop in free space.
SHORT_LOOP = 80


class Circuit:
    """The track since the hit point.

    A whole metre is compared with the old track, not one point with the hit point, so no fine tolerance is needed: the
    hit point is at some distance from the path around the obstacle, and the robot may pass near its own track in the
    other direction.
    """

    def __init__(self) -> None:
        self._track = np.empty((256, 3))
        self._count = 0
        self._matches = 0
        self.length = 0.0

    def passes_start(self, pose: Pose) -> bool:
        """Whether the circuit that closed at ``pose`` passes the place where the track began."""
        loop = self._track[self._count - self._loop_length(pose):self._count]
        distance = np.hypot(loop[:, 0] - self._track[0, 0], loop[:, 1] - self._track[0, 1])
        return bool(len(loop) and np.min(distance) < NEAR_START)

    def add(self, pose: Pose) -> bool:
        """Add the present pose (x, y [m], yaw [rad]); return True once the track has closed."""
        if self._count:
            step = math.hypot(pose[0] - self._track[self._count - 1, 0], pose[1] - self._track[self._count - 1, 1])
            if step < SPACING:
                return False
            self.length += step
        if self._count == len(self._track):
            self._track = np.concatenate((self._track, np.empty_like(self._track)))
        self._track[self._count] = pose
        self._count += 1
        loop = self._loop_length(pose)
        self._matches = self._matches + 1 if loop else 0
        return self._matches >= (loop if loop < SHORT_LOOP else CONFIRM) > 0

    def _loop_length(self, pose: Pose) -> int:
        """Samples since the newest place of the old track that ``pose`` reaches; 0 if there is none."""
        old = self._track[JOINING:max(JOINING, self._count - GAP)]
        if len(old) == 0:
            return 0
        near = (np.hypot(old[:, 0] - pose[0], old[:, 1] - pose[1]) < NEAR) \
            & (np.abs(wrap_angle(old[:, 2] - pose[2])) < ALIGNED)
        if not near.any():
            return 0
        met = JOINING + int(np.flatnonzero(near)[-1])
        since = self._track[met:self._count]
        if np.max(np.hypot(since[:, 0] - pose[0], since[:, 1] - pose[1])) < AWAY:
            return 0
        return self._count - met
