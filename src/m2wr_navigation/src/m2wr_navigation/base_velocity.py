# SPDX-License-Identifier: BSD-3-Clause
"""The velocity of the base: by messages of odometry, or by tf where there are none or they do not say it."""
from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Deque, Tuple

import numpy as np

from m2wr_maps.se2 import between

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

SILENT = 0.5                # s without a message after which tf is asked, as of a laser that stops
WINDOW = 0.3                # s over which tf's poses give a velocity: a few periods of 10 to 50 Hz
LEAST_SPAN = 0.05           # s: poses that are nearer in time differ by noise
JUDGED = 1.0                # s over which messages and tf are compared
#: Speeds by tf from which messages are compared with it [m/s, rad/s]: above what a localization corrects in a second.
MOVING = (0.1, 0.2)
LEAST_PART = 0.5            # of the motion by tf that the messages have to tell
AT_ONCE = 200               # poses that are kept


class BaseVelocity:
    """Takes messages and poses, and decides which of them the velocity comes from.

    Attributes
    ----------
    by_poses : str
        Why the velocity is that of the poses; empty: it is that of the messages.
    """

    def __init__(self) -> None:
        self._told: FloatArray = np.zeros(3)
        self._arrived = -math.inf
        self._poses: Deque[Tuple[float, FloatArray]] = deque(maxlen=AT_ONCE)
        self._since = math.inf              # the messages do not tell the motion
        self._differ = False
        self.by_poses = ""

    def take_message(self, now: float, velocity: FloatArray) -> None:
        """Take a message of odometry.

        Parameters
        ----------
        now : float
            [s]
        velocity : (3,) float64
            In the frame of the base [m/s, m/s, rad/s].
        """
        self._told, self._arrived = np.array(velocity, float), now

    def take_pose(self, stamp: float, pose: FloatArray) -> None:
        """Take a pose of the base in a frame that does not jump; one that is not newer is ignored.

        Parameters
        ----------
        stamp : float
            [s]; when it goes back, the older poses are forgotten.
        pose : (3,) float64
            [m, m, rad]
        """
        if self._poses and stamp <= self._poses[-1][0]:
            if stamp == self._poses[-1][0]:
                return
            self._poses.clear()
        self._poses.append((stamp, np.array(pose, float)))
        while stamp - self._poses[0][0] > WINDOW and len(self._poses) > 2:
            self._poses.popleft()

    @property
    def by_motion(self) -> FloatArray:
        """Velocity (3,) in the frame of the base by the poses [m/s, m/s, rad/s]; zeros, if there are not enough."""
        if len(self._poses) < 2:
            return np.zeros(3)
        (before, start), (after, end) = self._poses[0], self._poses[-1]
        if not LEAST_SPAN <= after - before <= 2.0 * SILENT:
            return np.zeros(3)
        step = between(start, end) / (after - before)
        half = -0.5 * step[2] * (after - before)        # the chord of an arc is turned by half of it
        cos, sin = math.cos(half), math.sin(half)
        return np.array([cos * step[0] - sin * step[1], sin * step[0] + cos * step[1], step[2]])

    def velocity(self, now: float) -> FloatArray:
        """Return the velocity (3,) in the frame of the base [m/s, m/s, rad/s].

        Parameters
        ----------
        now : float
            [s]
        """
        motion = self.by_motion
        if not 0.0 <= now - self._arrived <= SILENT:
            self.by_poses = "sends nothing" if self._arrived == -math.inf else "is silent"
            return motion
        self._compare(now, motion)
        self.by_poses = "does not tell the velocity of the base" if self._differ else ""
        return motion if self._differ else self._told

    def _compare(self, now: float, motion: FloatArray) -> None:
        """Decide whether messages tell what the poses do; at rest they cannot be judged."""
        told, speed, turn = self._told, float(np.hypot(*motion[:2])), abs(float(motion[2]))
        tells = []
        if speed > MOVING[0]:
            tells.append(float(told[:2] @ motion[:2]) >= LEAST_PART * speed * speed)
        if turn > MOVING[1]:
            tells.append(float(told[2] * motion[2]) >= LEAST_PART * turn * turn)
        if not tells:
            self._since = math.inf
            return
        wrong = not all(tells)
        if wrong == self._differ:
            self._since = math.inf
            return
        self._since = now if self._since > now else self._since
        if now - self._since >= JUDGED:
            self._differ, self._since = wrong, math.inf
