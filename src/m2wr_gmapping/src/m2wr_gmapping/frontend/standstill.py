# SPDX-License-Identifier: BSD-3-Clause
"""Time in which the wheels were at rest. Only then can a person turn the robot without odometry noticing it."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

from m2wr_gmapping import tuning
from m2wr_maps.se2 import composed

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray


class Standstill:
    """Sums up how long the wheels were at rest: the time that odometry's motion does not need at its usual speed.

    The usual speed is a weighted mean. Speeds count by the distance that was driven at them, and rates of rotation by
    the square of the rotation: turns on the spot are larger than the corrections of a robot that drives straight on.

    Attributes
    ----------
    longest : float
        Longest standstill between two scans since the last processed one [s].
    unexplained : float
        Standstill since the last scan that laser and odometry agreed on [s].
    """

    def __init__(self) -> None:
        self.longest = self.unexplained = 0.0
        self._scans, self._first, self._last = 0, 0.0, 0.0
        self._step = (0.0, 0.0, 0.0)        # by odometry since the newest scan [m, m, rad]
        # distance and rotation: sums of weights, and of weights times speed
        self._driven = self._turned = (0.0, 0.0)

    def add(self, stamp: float, step: FloatArray) -> None:
        """Take note of a scan. One that arrives too late is a part of the step to the next one.

        Parameters
        ----------
        stamp : float
            Its time [s].
        step : (3,) float64
            Motion by odometry since the last scan that has arrived [m, m, rad].
        """
        self._step = composed(self._step, step.tolist())
        if not self._scans:
            self._first = self._last = stamp
        interval = stamp - self._last
        if self._scans and not interval > 0.0:
            return
        self._scans += 1
        time = max(interval, (stamp - self._first) / max(1, self._scans - 1))       # some logs have stamps that jitter
        x, y, turn = self._step
        distance, turn = math.hypot(x, y), abs(turn)
        if 0.0 < distance + turn and distance < tuning.ODOMETRY.fastest * time:       # no reset of odometry
            self._driven = _added(self._driven, distance, distance, time)
            self._turned = _added(self._turned, turn * turn, turn, time)
        self._step, self._last = (0.0, 0.0, 0.0), stamp
        still = max(0.0, interval - max(_needed(self._driven, distance), _needed(self._turned, turn)))
        self.longest = max(self.longest, still)
        self.unexplained += still

    def restart(self) -> None:
        """Start again at a processed scan."""
        self.longest = 0.0

    def explain(self) -> None:
        """Tell that laser and odometry agree on the newest scan: so far the robot was not turned."""
        self.unexplained = 0.0


def _added(sums: Tuple[float, float], weight: float, motion: float, time: float) -> Tuple[float, float]:
    """Return the sums of a mean speed with one more motion [m or rad] in a time [s]."""
    return sums[0] + weight, sums[1] + weight * motion / time


def _needed(sums: Tuple[float, float], motion: float) -> float:
    """Return the time [s] that a motion [m or rad] needs at its usual speed; 0 if that is unknown."""
    return motion * (sums[0] / sums[1]) if sums[1] > 0.0 else 0.0


def turn_cost(angle: float, still: float) -> float:
    """Return the negative log-likelihood of a turn that the wheels have not measured.

    It is that of a slip, and more by as much as the turn needs more time than the wheels were at rest.

    Parameters
    ----------
    angle : float
        Of the turn [rad].
    still : float
        Time in which the wheels were at rest [s].
    """
    needed = tuning.TURNS.half_turn * abs(angle) / math.pi
    return tuning.SLIPS.cost * (max(1.0, needed / still) if still > 0.0 else math.inf)
