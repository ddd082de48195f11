# SPDX-License-Identifier: BSD-3-Clause
"""Bug 1: once round each obstacle, then back to its point nearest to the goal (Lumelsky, Stepanov 1987).

Complete. The path is at most D + 1.5 times the perimeters of the obstacles. The goal cannot be reached if the way
towards it is obstructed at the nearest point.
"""
from __future__ import annotations

import math
from typing import Optional

from m2wr_navigation.methods.boundary import CLOSED, HIT, BoundaryMethod, no_way
from m2wr_navigation.methods.method import Decision, View


class Bug1(BoundaryMethod):
    """Bug 1."""

    def restart(self) -> None:
        super().restart()
        self._leave = (0.0, 0.0)
        self._least, self._least_at, self._round = math.inf, 0.0, 0.0

    def hit(self, view: View) -> None:
        self._leave, self._least, self._least_at, self._round = (view.x, view.y), view.goal_distance, 0.0, 0.0

    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        assert self.circuit is not None
        if self._round == 0.0:
            if view.goal_distance < self._least:
                self._leave, self._least, self._least_at = (view.x, view.y), view.goal_distance, self.circuit.length
            if not closed:
                return None
            self._round = self.circuit.length
            if self._least_at > 0.5 * self._round:
                self.turn_back()        # the shorter way
        if math.hypot(view.x - self._leave[0], view.y - self._leave[1]) > CLOSED:
            # farther than a whole round: the place was passed
            return no_way(view, self.circuit) if self.circuit.length > 2.5 * self._round else None
        if self.travel(view, view.goal_direction)[0] < min(HIT, view.goal_distance):
            if view.goal_distance > self._least + 0.02 and self.circuit.length < 2.5 * self._round:
                return None             # a little farther
            return no_way(view, self.circuit)
        return self.leave(view, "at the place nearest to the goal")
