# SPDX-License-Identifier: BSD-3-Clause
"""Time in which the wheels stood still. Only then can somebody turn the robot without odometry noticing it."""
from __future__ import annotations

import math

import numpy as np

from m2wr_gmapping import tuning


class Standstill:
    """Sums up how long the wheels stood still: the time that odometry's motion does not need at its usual speed.

    The usual speed is that at which the mean metre was driven, and the mean rotation was made: slow motion counts less.

    Attributes
    ----------
    longest : float
        Longest standstill between two scans since the last processed one [s].
    unexplained : float
        Standstill since the last scan that laser and odometry agreed on [s].
    """

    def __init__(self) -> None:
        self.longest = self.unexplained = 0.0
        self._scans, self._time = 0, 0.0
        self._motion = np.zeros((2, 2))     # rows distance and rotation; sums of motion, and of motion times speed

    def add(self, interval: float, distance: float, turn: float) -> None:
        """Take note of a scan.

        Parameters
        ----------
        interval : float
            Time since the last scan [s]; not negative.
        distance, turn : float
            Motion by odometry since the last scan [m], [rad]; not negative.
        """
        self._scans += 1
        self._time += interval
        mean, needed = self._time / self._scans, 0.0
        for motion, sums in zip((distance, turn), self._motion):
            if mean > 0.0:
                sums += motion, motion * motion / max(interval, mean)       # some logs have stamps that jitter
            if sums[1] > 0.0:
                needed = max(needed, motion * float(sums[0] / sums[1]))
        still = max(0.0, interval - needed)
        self.longest = max(self.longest, still)
        self.unexplained += still

    def restart(self) -> None:
        """Start again at a processed scan."""
        self.longest = 0.0

    def explain(self) -> None:
        """Tell that laser and odometry agree on the newest scan: so far the robot was not turned."""
        self.unexplained = 0.0


def turn_cost(angle: float, still: float) -> float:
    """Return the negative log-likelihood of a turn that the wheels have not measured.

    It is that of a slip, and more by as much as the turn needs more time than the wheels stood still.

    Parameters
    ----------
    angle : float
        Of the turn [rad].
    still : float
        Time in which the wheels stood still [s].
    """
    needed = tuning.TURNS.half_turn * abs(angle) / math.pi
    return tuning.SLIPS.cost * (max(1.0, needed / still) if still > 0.0 else math.inf)
