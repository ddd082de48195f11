# SPDX-License-Identifier: BSD-3-Clause
"""``m2wr_navigation/BackUpRecovery``: backwards out of a place in which the robot cannot turn."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation.parameters import Parameter
from m2wr_navigation.recoveries.collisions import collides, is_turn_free
from m2wr_navigation.recoveries.recovery import Recovery, Step

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation
    from m2wr_navigation.recoveries.recovery import Costmaps
    from m2wr_node.array_types import FloatArray

CURVATURES = (0.0, 0.5, -0.5, 1.0, -1.0, 2.0, -2.0)     # 1/m: of the arcs that are tried, the straightest first
SAMPLED = 0.02              # m: step in which an arc is checked
TURN_SAMPLED = 0.01         # rad: step in which a turn is checked, 4 mm at the corners of m2wr
STALLED = 0.02, 3.0         # m, s: a robot that moves less in this time is stuck


class BackUp(Recovery):
    """Drives backwards on the straightest free arc until the robot can turn on the spot in both senses.

    An elongated robot can drive into a place in which it cannot turn. A turn on the spot does not help there.
    """

    PARAMETERS = {
        "distance": Parameter(1.0, "m", 0.05, 10.0, "greatest way backwards"),
        "speed": Parameter(0.15, "m/s", 0.01, 2.0, "speed backwards"),
        "room": Parameter(1.6, "rad", 0.0, 3.15, "turn to each side that has to be free at the end"),
    }

    def __init__(self, name: str, values: Mapping[str, Any], costmaps: Costmaps) -> None:
        super().__init__(name, values, costmaps)
        self._start: FloatArray = np.zeros(2)
        self._marked: Tuple[FloatArray, float] = (np.zeros(2), 0.0)

    def begin(self, situation: Situation) -> None:
        self._start = np.array(situation.pose[:2], float)
        self._marked = self._start, situation.stamp

    def step(self, situation: Situation) -> Step:
        place = np.array(situation.pose[:2], float)
        moved = float(np.hypot(*(place - self._start)))
        if self._can_turn(situation):
            return Step(None, True, "{}: the robot can turn after {:.2f} m backwards".format(self.name, moved)
                        if moved > STALLED[0] else "")
        if moved >= self.values["distance"]:
            return Step(None, True, "{} ends: the robot cannot turn after {:.2f} m backwards".format(self.name, moved))
        if np.hypot(*(place - self._marked[0])) > STALLED[0]:
            self._marked = place, situation.stamp
        elif situation.stamp - self._marked[1] > STALLED[1]:
            return Step(None, True, "{} ends: the robot has moved less than {:g} m in {:g} s".format(
                self.name, *STALLED))
        curvature = self._free_arc(situation, self.values["distance"] - moved)
        if curvature is None:
            return Step(None, True, "{} ends: the robot at ({:.2f}, {:.2f}) would collide backwards".format(
                self.name, place[0], place[1]))
        speed = -self.values["speed"]
        return Step(np.array([speed, 0.0, curvature * speed]), False)

    def _free_arc(self, situation: Situation, length: float) -> Optional[float]:
        """Return the curvature of the arc that is free the farthest, the straightest of equals; None: none is."""
        reaches = [self._free_length(situation, curvature, length) for curvature in CURVATURES]
        best = int(np.argmax(reaches))
        return CURVATURES[best] if reaches[best] >= min(length, 2.0 * SAMPLED) else None

    @staticmethod
    def _free_length(situation: Situation, curvature: float, length: float) -> float:
        """Return how far an arc backwards is free [m]."""
        x, y, yaw = situation.pose
        for count in range(1, int(math.ceil(length / SAMPLED)) + 1):
            x, y = x - SAMPLED * math.cos(yaw), y - SAMPLED * math.sin(yaw)
            yaw -= curvature * SAMPLED
            if collides(situation, x, y, yaw):
                return (count - 1) * SAMPLED
        return length

    def _can_turn(self, situation: Situation) -> bool:
        return all(is_turn_free(situation, sense * self.values["room"], TURN_SAMPLED) for sense in (1.0, -1.0))
