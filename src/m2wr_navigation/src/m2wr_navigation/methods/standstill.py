# SPDX-License-Identifier: BSD-3-Clause
"""Notices a robot that stays at one place."""
from __future__ import annotations

import math

PROGRESS = 1.0              # m: a robot that moves less in its patience is stuck


class Standstill:
    """Remembers when and where the robot had last moved by PROGRESS."""

    def __init__(self) -> None:
        self._since, self._x, self._y = 0.0, math.inf, math.inf

    def look(self, now: float, x: float, y: float, patience: float) -> str:
        """Return why the robot is stuck, without a subject; empty: it is not.

        Parameters
        ----------
        now : float
            Simulated or ROS time [s].
        x, y : float
            Of the robot [m].
        patience : float
            Time in which it has to move by PROGRESS [s].
        """
        if math.hypot(x - self._x, y - self._y) > PROGRESS:
            self._since, self._x, self._y = now, x, y
        elif now - self._since > patience:
            return "moved less than {:g} m from ({:.2f}, {:.2f}) in {:.0f} s".format(
                PROGRESS, self._x, self._y, now - self._since)
        return ""
