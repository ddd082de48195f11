# SPDX-License-Identifier: BSD-3-Clause
"""TangentBug: towards the goal by the edges of the obstacles in sight (Kamon, Rimon, Rivlin 1998).

Towards the goal the robot drives to the edge O of an obstacle for which d(robot, O) + d(O, goal) is least. When this
gets longer, the robot is in a local minimum and follows the boundary until a place in sight is nearer to the goal than
the boundary followed so far: d_reach < d_followed. Complete; the goal cannot be reached if the circuit closes.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np

from m2wr_navigation.methods.boundary import HIT, LOOK, SWEEP, BoundaryMethod, no_way
from m2wr_navigation.methods.method import Decision, View

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray

PROGRESS = 0.05             # m: d_reach has to be less than d_followed by so much
MINIMUM = 0.3               # m: the way by an edge may grow by so much before it counts as a local minimum


class TangentBug(BoundaryMethod):
    """TangentBug."""

    def restart(self) -> None:
        super().restart()
        self._least, self._followed = math.inf, math.inf

    def hit(self, view: View) -> None:
        self._followed = view.goal_distance

    def decide(self, view: View) -> Decision:
        if self.circuit is not None:
            return super().decide(view)
        seen = self.values["sight"] - self.radius
        if self.is_goal_free(view, seen):
            self._least = min(self._least, view.goal_distance)
            return self.steer(view, view.goal_direction, "towards the goal")
        direction, way = self._best_edge(view, seen)
        if way > self._least + MINIMUM or direction is None:
            return super().decide(view) if self.travel(view, view.goal_direction)[0] < HIT \
                else self.steer(view, view.goal_direction, "to the obstacle")
        self._least = min(self._least, way)
        return self.steer(view, direction, "to an edge of the obstacle")

    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        assert self.circuit is not None
        seen = self.values["sight"] - self.radius
        lengths = np.minimum(self._lengths(view), min(seen, view.goal_distance))
        directions = view.goal_direction + SWEEP
        reached = np.hypot(view.x + lengths * np.cos(directions) - self.goal[0],
                           view.y + lengths * np.sin(directions) - self.goal[1])
        if self.circuit.length > LOOK and reached.min() < self._followed - PROGRESS \
                and self.travel(view, float(directions[np.argmin(reached)]))[0] >= LOOK:
            self._least = math.inf
            self.circuit = None
            return self.steer(view, float(directions[np.argmin(reached)]), "a place in sight is nearer to the goal")
        self._followed = min(self._followed, view.goal_distance)
        return no_way(view, self.circuit) if closed else None

    def _lengths(self, view: View) -> FloatArray:
        """Return how far the disc can travel in each direction of the sweep from the goal's (D,) [m]."""
        return view.surroundings.free_travel(view.x, view.y, view.goal_direction + SWEEP, self.radius)[0]

    def _best_edge(self, view: View, seen: float) -> Tuple[Optional[float], float]:
        """Return the direction of the best edge [rad], None: there is none, and the way to the goal by it [m]."""
        lengths = self._lengths(view)
        open_ahead = lengths >= seen
        edges = open_ahead & ~(np.roll(open_ahead, 1) & np.roll(open_ahead, -1))
        if not edges.any():
            return None, math.inf
        directions = view.goal_direction + SWEEP[edges]
        x, y = view.x + seen * np.cos(directions), view.y + seen * np.sin(directions)
        ways = seen + np.hypot(self.goal[0] - x, self.goal[1] - y)
        best = int(np.argmin(ways))
        return float(directions[best]), float(ways[best])
