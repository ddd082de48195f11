# SPDX-License-Identifier: BSD-3-Clause
"""Drive along way points on a smooth path, so that a laser sees a whole world. Uses only the pose."""
from __future__ import annotations

import logging
import math
from typing import Iterable, Optional, Sequence

from motion_plan.angles import wrap_angle
from motion_plan.planar_types import Command, Pose

LOG = logging.getLogger(__name__)

#: A way point is reached within this [m].
REACHED = 0.25
#: Beyond this heading error [rad] the robot turns on the spot.
TURN_FIRST = 0.4
#: Gain from heading error to rotation rate [1/s], and the limit of the rate [rad/s].
TURN_GAIN, TURN_MOST = 1.5, 0.7
#: Within this distance of a way point [m] the robot slows down, to this fraction of its speed.
SLOW_DOWN, SLOWEST = 0.8, 0.4
#: Maximum speed [m/s]; also the limit of the simulation.
FASTEST = 1e4
#: A robot that has not come nearer for this time [s] is stuck.
PATIENCE = 20.0
#: Least progress in distance [m], and in heading [rad].
PROGRESS, PROGRESS_TURN = 0.05, 0.05


class TourError(ValueError):
    """A tour cannot be driven; the text gives the expected value."""


class Tour:
    """Drives to several points one after another.

    Parameters
    ----------
    way_points : sequence of (float, float)
        x, y [m] in the odometry frame.
    speed : float
        [m/s].

    Attributes
    ----------
    index : int
        Index of the next way point; the number of way points at the end.
    finished, stuck : bool
        Whether the last one has been reached; whether the robot does not come nearer.

    Raises
    ------
    TourError
        If there is no way point, one is not a pair of finite numbers, or the speed is not a number above 0.
    """

    def __init__(self, way_points: Iterable[Sequence[float]], speed: float = 0.5) -> None:
        try:
            points = [(float(x), float(y)) for x, y in way_points]
        except (TypeError, ValueError, OverflowError):
            points = []
        if not points or not all(math.isfinite(value) for point in points for value in point):
            raise TourError('way points are %r: expected a list of [x, y] with finite numbers' % (way_points,))
        if isinstance(speed, bool) or not isinstance(speed, (int, float)) or not 0.0 < speed < FASTEST:
            raise TourError('speed is %r: expected a number above 0 and below %g m/s' % (speed, FASTEST))
        self.way_points, self._speed = points, float(speed)
        self.restart()

    def restart(self) -> None:
        """Begin with the first way point."""
        self.index, self.stuck = 0, False
        self._forget()

    def _forget(self) -> None:
        self._nearest = self._least_turn = math.inf
        self._since: Optional[float] = None

    @property
    def finished(self) -> bool:
        """Whether all way points have been reached."""
        return self.index >= len(self.way_points)

    def update(self, now: float, pose: Pose) -> Command:
        """Return the command for one period.

        Parameters
        ----------
        now : float
            Time [s].
        pose : (float, float, float)
            x, y [m], yaw [rad] in the odometry frame.

        Returns
        -------
        (float, float)
            linear_x [m/s] and angular_z [rad/s], positive to the left; zeros at the end and if the robot is stuck.
        """
        while not self.finished and self._distance(pose) <= REACHED:
            LOG.info('way point %d of %d reached: (%.2f, %.2f)', self.index + 1, len(self.way_points),
                     *self.way_points[self.index])
            self.index += 1
            self._forget()
        if self.finished or self._is_stuck(now, pose):
            return 0.0, 0.0
        error, distance = self._turn(pose), self._distance(pose)
        turn = max(-TURN_MOST, min(TURN_MOST, TURN_GAIN * error))
        if abs(error) > TURN_FIRST:
            return 0.0, turn
        slow = max(SLOWEST, min(1.0, distance / SLOW_DOWN))
        return self._speed * slow * math.cos(error), turn

    def _distance(self, pose: Pose) -> float:
        x, y = self.way_points[self.index]
        return math.hypot(x - pose[0], y - pose[1])

    def _turn(self, pose: Pose) -> float:
        x, y = self.way_points[self.index]
        return wrap_angle(math.atan2(y - pose[1], x - pose[0]) - pose[2])

    def _is_stuck(self, now: float, pose: Pose) -> bool:
        distance, turn = self._distance(pose), abs(self._turn(pose))
        if self._since is None or distance < self._nearest - PROGRESS or turn < self._least_turn - PROGRESS_TURN:
            self._nearest, self._least_turn = min(self._nearest, distance), min(self._least_turn, turn)
            self._since = now
        if not self.stuck and now - self._since > PATIENCE:
            self.stuck = True
            LOG.error('no nearer to way point %d, (%.2f, %.2f), for %g s: the robot is at (%.2f, %.2f)',
                      self.index + 1, *self.way_points[self.index], PATIENCE, pose[0], pose[1])
        return self.stuck
