# SPDX-License-Identifier: BSD-3-Clause
"""Limits of velocity, acceleration and jerk of a commanded speed, as the parameters of diff_drive_controller say."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Tuple

_UNLIMITED = (-math.inf, math.inf)


@dataclass(frozen=True)
class SpeedLimiter:
    """Limits of one speed; without limits it changes nothing.

    Parameters
    ----------
    velocity, acceleration, jerk : (float, float)
        Least and greatest value, in m or rad and s.
    """

    velocity: Tuple[float, float] = _UNLIMITED
    acceleration: Tuple[float, float] = _UNLIMITED
    jerk: Tuple[float, float] = _UNLIMITED

    def limit(self, speed: float, last: float, before_last: float, dt: float) -> float:
        """Return a speed within the limits: first jerk, then acceleration, then velocity.

        Parameters
        ----------
        speed : float
            Wanted speed.
        last, before_last : float
            The last two results.
        dt : float
            Time between the results [s].
        """
        if self.jerk != _UNLIMITED:
            change, scale = last - before_last, 2.0 * dt * dt
            speed = last + change + _clamp(speed - last - change, self.jerk[0] * scale, self.jerk[1] * scale)
        if self.acceleration != _UNLIMITED:
            speed = last + _clamp(speed - last, self.acceleration[0] * dt, self.acceleration[1] * dt)
        return _clamp(speed, *self.velocity)


def _clamp(value: float, low: float, high: float) -> float:
    return min(high, max(low, value))
