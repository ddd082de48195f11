# SPDX-License-Identifier: BSD-3-Clause
"""What a Kobuki does when it bumps, finds a cliff or hangs with a wheel in the air, without ROS."""
from __future__ import annotations

from typing import Optional, Set, Tuple

BUMPER, CLIFF, WHEEL = "bumper", "cliff", "wheel"
LEFT, CENTRE, RIGHT = 0, 1, 2       # numbers of the sensors in the messages; a wheel is LEFT or 1
BACK = -0.1                         # m/s
TURN = 0.4                          # rad/s, away from the side


class Reaction:
    """Remembers which sensors are active, and commands the robot away from what they found.

    Parameters
    ----------
    extension : float
        So long the last command is repeated after the last event [s].
    """

    def __init__(self, extension: float = 0.0) -> None:
        self.enabled = True
        self._extension = extension
        self._active: Set[Tuple[str, int]] = set()
        self._last: Tuple[float, float] = (0.0, 0.0)
        self._last_event = float("-inf")

    def event(self, kind: str, sensor: int, active: bool, now: float) -> None:
        """Note that a sensor has changed.

        Parameters
        ----------
        kind : str
            BUMPER, CLIFF or WHEEL.
        sensor : int
            LEFT, CENTRE or RIGHT.
        active : bool
            Pressed, over a cliff, or in the air.
        now : float
            Time [s].
        """
        (self._active.add if active else self._active.discard)((kind, sensor))
        if active and kind != WHEEL:
            self._last_event = now

    def reset(self) -> None:
        """Forget all sensors that are active."""
        self._active.clear()
        self._last_event = float("-inf")

    def command(self, now: float) -> Optional[Tuple[float, float]]:
        """Return the velocities to command [m/s, rad/s]; None if the robot is safe.

        Parameters
        ----------
        now : float
            Time [s].
        """
        if not self.enabled:
            return None
        found = {sensor for kind, sensor in self._active if kind != WHEEL}
        if any(kind == WHEEL for kind, _ in self._active):
            self._last = 0.0, 0.0
        elif CENTRE in found:
            self._last = BACK, 0.0
        elif found:
            self._last = BACK, -TURN if LEFT in found else TURN
        elif not 0.0 <= now - self._last_event < self._extension:
            return None
        return self._last
