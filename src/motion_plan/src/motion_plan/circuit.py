# SPDX-License-Identifier: BSD-3-Clause
"""Noticing that the robot drives along its own track again: the way round an obstacle has closed."""
from __future__ import annotations

import math

import numpy as np

from motion_plan.angles import wrap_angle
from motion_plan.planar_types import Pose

#: Spacing of the recorded track [m].
SPACING = 0.1
#: The track counts as met again within this distance [m] and heading difference [rad].
NEAR = 0.3
ALIGNED = math.radians(50.0)
#: So much of the track [samples] must have been left behind before it can be met again.
GAP = 20
#: The robot must have been this far from the place in between [m].
AWAY = 0.8
#: The closed way passes the hit point within this distance [m]; it met the wall up to 0.7 m before reaching it.
NEAR_START = 1.0
#: Samples at the start that do not count: the robot still joins the wall.
JOINING = 5
#: So many samples in a row (1 m of way) must lie on the old track.
CONFIRM = 10
#: A loop shorter than this [samples] must be driven twice: in a place about as wide as the robot needs, measuring noise
#: can send it round in the open once.
SHORT_LOOP = 80


class Circuit:
    """The track since the wall was met.

    Comparing a whole metre with the old track, and not one point with the hit point, needs no fine tolerance: the
    robot meets the wall some way off the border along which it then goes round, and it may pass near its own track in
    the other direction.
    """

    def __init__(self) -> None:
        self._track = np.empty((256, 3))
        self._count = 0
        self._matches = 0
        self.length = 0.0

    def passes_start(self, pose: Pose) -> bool:
        """Whether the way that has closed at ``pose`` leads past the place where the track began."""
        loop = self._track[self._count - self._loop_length(pose):self._count]
        distance = np.hypot(loop[:, 0] - self._track[0, 0], loop[:, 1] - self._track[0, 1])
        return bool(len(loop) and np.min(distance) < NEAR_START)

    def add(self, pose: Pose) -> bool:
        """Take the pose (x, y [m], yaw [rad]) of now; return True once the track has closed."""
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
        """Samples between the newest place of the old track that ``pose`` meets and now; 0 when it meets none."""
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
