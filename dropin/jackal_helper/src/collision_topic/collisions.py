# SPDX-License-Identifier: BSD-3-Clause
"""Collisions of a robot in the simulator's diagnostics, without ROS."""
from __future__ import annotations

from typing import Mapping

KEY = "touches of {}"          # of a value; the simulator counts contacts that begin, except with the ground


class Collisions:
    """Finds out from successive values whether a robot has collided in between.

    Parameters
    ----------
    robot : str
        Name of the model.
    """

    def __init__(self, robot: str) -> None:
        self._key, self._count = KEY.format(robot), 0

    def update(self, values: Mapping[str, str]) -> bool:
        """Return whether a contact has begun since the values before.

        Parameters
        ----------
        values : mapping
            Keys and values of the status. Without the robot's count, or with one that is no number, nothing has begun.
            A lower count is that of a simulation that was reset.
        """
        text = values.get(self._key, "")
        count = int(text) if text.isdecimal() and len(text) < 18 else 0
        before, self._count = self._count, count
        return count > before
