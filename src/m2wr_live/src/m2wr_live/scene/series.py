# SPDX-License-Identifier: BSD-3-Clause
"""Speed, clearance and distance of a robot over the last minute, and the real-time factor."""
from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Deque, Dict, Optional, Sequence, Tuple

import numpy as np

from m2wr_view.outlines import least_clearance

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline

PERIOD = 0.5            # s of simulated time between two samples
WINDOW = 60.0           # s of simulated time that is kept
_FACTOR_WINDOW = 2.0    # s of wall time over which the real-time factor is measured
NEAR = 10.0             # m; obstacles whose corners are all further away do not count for the clearance
_JUMP = 0.5             # m between two samples above which a robot was placed, if it is also faster than this
_FASTEST = 5.0          # m/s


class Series:
    """Samples of one robot.

    Attributes
    ----------
    distance : float
        Driven so far [m].
    clearance : float or None
        The newest one [m]; None without obstacles.
    speed : float
        The newest one [m/s].
    """

    def __init__(self) -> None:
        self.distance, self.speed = 0.0, 0.0
        self.clearance: Optional[float] = None
        self._samples: Deque[Tuple[float, float, float, float]] = deque()
        self._last: Optional[Tuple[float, FloatArray]] = None

    def _restart(self) -> None:
        self.distance, self.speed, self.clearance, self._last = 0.0, 0.0, None, None
        self._samples.clear()

    def sample(self, now: float, pose: Optional[FloatArray], obstacles: Sequence[Outline],
               footprint: Sequence[Outline]) -> bool:
        """Add a sample if one is due, and return whether one was added.

        Parameters
        ----------
        now : float
            Simulated time [s]; the series begins again where it goes back.
        pose : (3,) float64 or None
            x, y [m], yaw [rad] of the robot.
        obstacles, footprint : sequence of Outline

        Returns
        -------
        bool
        """
        if self._last is not None and now < self._last[0]:
            self._restart()
        if pose is None or self._last is not None and now - self._last[0] < PERIOD:
            return False
        if self._last is not None:
            before, place = self._last
            step = math.hypot(pose[0] - place[0], pose[1] - place[1])
            if step <= _JUMP or step <= _FASTEST * (now - before):
                self.distance += step
                self.speed = step / (now - before)
        self._last = (now, pose)
        self.clearance = clearance_of(pose, obstacles, footprint)
        self._samples.append((now, self.speed, math.nan if self.clearance is None else self.clearance, self.distance))
        while self._samples and self._samples[0][0] < now - WINDOW:
            self._samples.popleft()
        return True

    def columns(self) -> FloatArray:
        """Return time [s], speed [m/s], clearance [m] and distance [m] as rows (4, n)."""
        return np.array(self._samples, dtype=float).reshape(-1, 4).T


def clearance_of(pose: FloatArray, obstacles: Sequence[Outline], footprint: Sequence[Outline]) -> Optional[float]:
    """Return the distance [m] of a robot from the nearest obstacle, or None if none is near.

    Parameters
    ----------
    pose : (3,) float64
        x, y [m] and yaw [rad].
    obstacles, footprint : sequence of Outline
    """
    near = [outline for outline in obstacles if _nearest(outline, pose) - outline.radius < NEAR]
    if not near:
        return None
    return float(least_clearance(np.array([pose]), near, footprint).distance)


def _nearest(outline: Outline, pose: FloatArray) -> float:
    """Return the distance from a point to the box around the corners of an outline [m]."""
    low, high = outline.vertices.min(axis=0), outline.vertices.max(axis=0)
    return float(np.hypot(*np.maximum(0.0, np.maximum(low - pose[:2], pose[:2] - high))))


class RealTimeFactor:
    """Simulated seconds per second, over the last two seconds."""

    def __init__(self) -> None:
        self._times: Deque[Tuple[float, float]] = deque()

    def update(self, wall: float, now: float) -> float:
        """Return the factor.

        Parameters
        ----------
        wall, now : float
            Wall time and simulated time [s].
        """
        if self._times and now < self._times[-1][1]:
            self._times.clear()
        self._times.append((wall, now))
        while len(self._times) > 2 and self._times[0][0] < wall - _FACTOR_WINDOW:
            self._times.popleft()
        first = self._times[0]
        return (now - first[1]) / (wall - first[0]) if wall - first[0] > 0.1 else 0.0


def contacts_of(values: Dict[str, str]) -> Dict[str, int]:
    """Return the number of contacts by robot, from the values of the simulation's diagnostics."""
    mark = "touches of "
    return {key[len(mark):]: int(value) for key, value in values.items()
            if key.startswith(mark) and value.isdigit()}
