# SPDX-License-Identifier: BSD-3-Clause
"""Turns on the spot that lead nowhere: a robot that has seen every heading from a place takes the best drive of all."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

FULL_TURN = 2.0 * math.pi   # rad: after it every heading was looked at
ALIGNED = 0.1               # rad from the best heading: more than half of what a robot turns in a cycle


class TurnMemory:
    """Remembers what drives cost in the headings of a turn on the spot.

    A turn on the spot is cheap wherever the robot has room for it, also before a gap that costs more than the turn,
    whatever the heading. It is made to find a better heading; after a full turn the best one is known, and the robot
    drives there until the circle in which it turned lies behind it.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the place."""
        self._place: FloatArray = np.full(2, np.nan)
        self._heading, self._turned = 0.0, 0.0
        self._least, self._best = math.inf, 0.0         # cost of the best drive, and its heading
        self._drives = False

    def look(self, pose: FloatArray, reach: float) -> None:
        """Take note of where the robot is.

        Parameters
        ----------
        pose : (3,) float64
            [m, m, rad]
        reach : float
            Radius of the circle in which the robot turns [m].
        """
        if math.hypot(pose[0] - self._place[0], pose[1] - self._place[1]) > reach:
            self.reset()
        if np.isfinite(self._place[0]):
            self._turned += abs(math.remainder(pose[2] - self._heading, FULL_TURN))
            self._heading = float(pose[2])

    def allowed_turns(self, drive: float, margin: float) -> Tuple[float, float]:
        """Return the sides, -1 and 1, to which the robot may turn instead of driving: 0, 0 if it has to drive.

        After a full turn it is one side, that of the best heading.

        Parameters
        ----------
        drive : float
            Cost of the best drive in the present heading; infinite: there is none.
        margin : float
            Difference between costs that means nothing.
        """
        if not np.isfinite(self._place[0]):         # what a drive costs in other places says nothing
            return -1.0, 1.0
        if math.isinf(drive):
            self._drives = False
        elif drive < self._least:
            self._least, self._best = drive, self._heading
        if self._turned < FULL_TURN or math.isinf(self._least):
            return -1.0, 1.0
        rest = math.remainder(self._best - self._heading, FULL_TURN)
        if math.isfinite(drive) and (drive <= self._least + margin or abs(rest) < ALIGNED):
            self._drives = True
        side = 0.0 if self._drives else math.copysign(1.0, rest)
        return side, side

    def note_turn(self, pose: FloatArray) -> None:
        """Take note that the robot turns on the spot.

        Parameters
        ----------
        pose : (3,) float64
        """
        if not np.isfinite(self._place[0]):
            self._place, self._heading = np.array(pose[:2], float), float(pose[2])
