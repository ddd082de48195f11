# SPDX-License-Identifier: BSD-3-Clause
"""TangentBug: towards the goal by the edges of the obstacles in sight (Kamon, Rimon, Rivlin 1998).

Towards the goal T the robot x drives to the edge V of an obstacle for which d(x, V) + d(V, T), with the way that it
could drive while it turns to V, is least, of those that are nearer to T than x and than the place where it last left a
boundary. If there is none, it is in a local minimum and follows the boundary, to the side of the best edge, until a
place in sight is nearer to T than all that it has seen of this boundary: d_followed. Then it drives to that place until
it is itself nearer than d_followed. So the distances of the local minima from the goal decrease, and their number is
finite. The goal cannot be reached if the circuit closes and nothing was found a little further on: the hit point may
lie just before the place to leave.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional

import numpy as np

from m2wr_navigation.methods.boundary import AWAY, HIT, LOOK, SWEEP, BoundaryMethod, no_way
from m2wr_navigation.methods.method import Decision, View

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray

PROGRESS = 0.05             # m: by so much an edge, or a place to leave for, has to be nearer to the goal
JUMP = 0.5                  # m: between neighbouring directions; the nearer obstacle has an edge there
ARRIVED = 0.1               # m: the place to leave for is reached


class TangentBug(BoundaryMethod):
    """TangentBug."""

    def restart(self) -> None:
        super().restart()
        self._left, self._followed = math.inf, math.inf     # distances from the goal: d_leave, d_followed [m]
        self._closed = math.inf                             # length of the circuit when it came back to its start [m]
        self._place: Optional[FloatArray] = None            # to which the robot leaves a boundary (2,) [m]

    def hit(self, view: View) -> None:
        self._followed, self._closed = view.goal_distance, math.inf
        direction = self._best_edge(view, self.values["sight"] - self.radius, math.inf)
        if direction is not None and math.remainder(direction - view.goal_direction, 2.0 * math.pi) < 0.0:
            self.turn_back()

    def decide(self, view: View) -> Decision:
        if self.circuit is not None:
            return super().decide(view)
        if self._place is not None:
            decision = self._transition(view, self._place)
            if decision is not None:
                return decision
        seen = self.values["sight"] - self.radius
        if self.is_goal_free(view, seen):
            return self.steer(view, view.goal_direction, "towards the goal")
        direction = self._best_edge(view, seen, min(view.goal_distance, self._left) - PROGRESS)
        if direction is not None:
            return self.steer(view, direction, "to an edge of the obstacle")
        return super().decide(view) if self.travel(view, view.goal_direction)[0] < HIT \
            else self.steer(view, view.goal_direction, "to the obstacle")

    def _transition(self, view: View, place: FloatArray) -> Optional[Decision]:
        """Return the command towards the place for which the robot left the boundary; None: the transition is over."""
        across, up = place[0] - view.x, place[1] - view.y
        direction, left = math.atan2(up, across), math.hypot(across, up)
        if view.goal_distance < self._followed - PROGRESS or left < ARRIVED or self.travel(view, direction)[0] < HIT:
            self._left, self._place = view.goal_distance, None
            return None
        return self.steer(view, direction, "a place in sight is nearer to the goal")

    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        assert self.circuit is not None
        lengths = self._lengths(view, min(self.values["sight"] - self.radius, view.goal_distance))
        directions = view.goal_direction + SWEEP
        places = np.column_stack([view.x + lengths * np.cos(directions), view.y + lengths * np.sin(directions)])
        distances = np.hypot(*(places - self.goal).T)
        self._followed = min(self._followed, view.goal_distance,
                             float(distances[self._followed_part(view, lengths)].min()))
        best = int(np.argmin(distances))
        if self.circuit.length > LOOK and distances[best] < self._followed - PROGRESS and lengths[best] >= LOOK:
            self.circuit, self._place = None, places[best]
            return self.steer(view, float(directions[best]), "a place in sight is nearer to the goal")
        if closed:
            self._closed = min(self._closed, self.circuit.length)
        return no_way(view, self.circuit) if self.circuit.length > self._closed + AWAY else None

    def _followed_part(self, view: View, lengths: FloatArray) -> BoolArray:
        """Return which directions (D,) end at the obstacle that is followed, as far as it is seen without a gap."""
        toward = math.atan2(self._contact[1] - view.y, self._contact[0] - view.x)
        count, start = len(lengths), int(round((toward - view.goal_direction) / (SWEEP[1] - SWEEP[0]))) % len(lengths)
        joined = (np.abs(np.diff(lengths, append=lengths[:1])) <= JUMP) & (lengths < lengths.max())
        part = np.zeros(count, bool)
        for order in ((start + np.arange(count)) % count, (start - np.arange(count)) % count):
            # between k and k + 1 joined[k] tells whether there is a gap
            gaps = ~(joined[order[:-1]] if order[1] == (start + 1) % count else joined[order[1:]])
            end = int(np.argmax(gaps)) + 1 if gaps.any() else count
            part[order[:end]] = True
        return part

    def _lengths(self, view: View, most: float) -> FloatArray:
        """Return how far the disc can travel in each direction of the sweep from the goal's (D,), at most ``most``."""
        directions = view.goal_direction + SWEEP
        return np.minimum(view.surroundings.free_travel(view.x, view.y, directions, self.radius)[0], most)

    def _best_edge(self, view: View, seen: float, most: float) -> Optional[float]:
        """Return the direction [rad] of the best edge in sight that is nearer than ``most`` m to the goal, or None."""
        lengths = self._lengths(view, seen)
        nearer = np.minimum(np.roll(lengths, 1), np.roll(lengths, -1))
        edges = ((lengths >= seen) & (nearer < seen)) | (lengths - nearer > JUMP)
        directions = (view.goal_direction + SWEEP)[edges]
        reach = np.minimum(lengths, nearer + self.radius)[edges]
        rest = np.hypot(view.x + reach * np.cos(directions) - self.goal[0],
                        view.y + reach * np.sin(directions) - self.goal[1])
        usable = rest < most
        if not usable.any():
            return None
        turns = np.abs(np.remainder(directions - view.yaw + math.pi, 2.0 * math.pi) - math.pi)
        ways = reach + rest + turns * self.values["max_vel_x"] / self.values["max_vel_theta"]
        return float(directions[usable][np.argmin(ways[usable])])
