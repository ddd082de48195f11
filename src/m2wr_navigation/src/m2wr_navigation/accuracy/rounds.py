# SPDX-License-Identifier: BSD-3-Clause
"""A drive without a map that sees much and stays near obstacles: along each boundary, then on to the next one.

Where nothing is seen, it drives along a spiral: the rings are as far apart as two ranges of the laser, so that between
them nothing is missed, and no place is visited twice. (A straight line away from the last wall never sees one again.)
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, Optional, Tuple

import numpy as np

from m2wr_navigation.methods.boundary import LEAVE, BoundaryMethod
from m2wr_navigation.methods.method import COMMON, RUNNING, Decision, View
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

FAR = 1000.0                # m: a goal in a direction, that is never reached
ROUND = 2.0 * math.pi       # rad: who has turned so far and is back at the start, has been round an obstacle
BACK = 0.5                  # m: nearer to the start than this is back
TRAIL_STEP = 0.3            # m between two points of the way so far
NEW = 1.5                   # m from the way so far, from which an obstacle is another one
TURN = 0.5                  # rad/s, where no direction is free


class Rounds(BoundaryMethod):
    """Drives to the nearest obstacle, round it with the obstacle on the right, and then to one that is new.

    Without anything in sight it drives along a spiral until there is something.
    """

    PARAMETERS = dict(COMMON, patience=Parameter(1e6, "s", 1.0, 1e6, "it never gives up"))

    def restart(self) -> None:
        super().restart()
        self._trail: List[Tuple[float, float]] = []
        self._turned, self._yaw = 0.0, math.nan
        self._direction = math.nan
        self._centre: Optional[Tuple[float, float]] = None      # of the spiral
        self._reach = 0.0                                       # greatest reading so far [m]
        self.goal = np.array([FAR, 0.0])        # there is none; the origin would be reached at once

    def decide(self, view: View) -> Decision:
        if not self._trail or math.hypot(view.x - self._trail[-1][0], view.y - self._trail[-1][1]) > TRAIL_STEP:
            self._trail.append((view.x, view.y))
        points = seen_points(view)
        self._reach = float(np.hypot(points[:, 0] - view.x, points[:, 1] - view.y).max(initial=self._reach))
        if self.circuit is None and not len(points):
            return self._spiral(view)
        if math.isnan(self._direction) or self._centre is not None:
            self._centre = None
            self._head_for(view, direction_to_nearest(view, points))
        decision = super().decide(view)
        return decision if decision.outcome == RUNNING else Decision(0.0, TURN, RUNNING, decision.reason)

    def _head_for(self, view: View, direction: float) -> None:
        self._direction = direction
        self.goal = np.array([view.x + FAR * math.cos(direction), view.y + FAR * math.sin(direction)])
        view.goal_distance, view.goal_direction = FAR, direction

    def _spiral(self, view: View) -> Decision:
        """Return the command along an Archimedean spiral, dr / dphi = pitch / (2 pi), about where sight was lost."""
        if self._centre is None:
            self._centre = view.x, view.y
        x, y = view.x - self._centre[0], view.y - self._centre[1]
        radius = math.hypot(x, y)
        outwards = math.atan2(y, x) if radius > TRAIL_STEP else view.yaw
        pitch = 2.0 * (self._reach or self.values["sight"])
        return self.steer(view, outwards + math.atan2(ROUND * radius, pitch), "nothing is in sight")

    def hit(self, view: View) -> None:
        self._turned, self._yaw = 0.0, view.yaw

    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        assert self.circuit is not None
        self._turned += math.remainder(view.yaw - self._yaw, ROUND)
        self._yaw = view.yaw
        if abs(self._turned) < ROUND or math.hypot(view.x - self.circuit.x, view.y - self.circuit.y) > BACK:
            return None
        direction = self._to_something_new(view)
        if direction is None or self.travel(view, direction)[0] < LEAVE:
            return None
        self._head_for(view, direction)
        return self.leave(view, "to another obstacle")

    def _to_something_new(self, view: View) -> Optional[float]:
        """Return the direction of the nearest thing seen away from the way so far [rad]; None: there is none."""
        points = seen_points(view)
        if not len(points):
            return None
        away = np.hypot(*(points[:, None] - np.array(self._trail)).transpose(2, 0, 1)).min(axis=1)
        points = points[away > NEW]
        if not len(points):
            return None
        return direction_to_nearest(view, points)


def direction_to_nearest(view: View, points: FloatArray) -> float:
    """Return the direction from the robot to the nearest of points (N, 2) [rad], in the odometry frame; N > 0.

    Parameters
    ----------
    view : View
    points : (N, 2) float64
        [m]
    """
    x, y = points[np.argmin(np.hypot(points[:, 0] - view.x, points[:, 1] - view.y))]
    return math.atan2(y - view.y, x - view.x)


def seen_points(view: View) -> FloatArray:
    """Return where the beams with a return end (N, 2) [m], in the odometry frame; from the axle, as good as the laser.

    Parameters
    ----------
    view : View
    """
    ranges = np.asarray(view.sensing.ranges, float)
    angles = view.yaw + view.sensing.angle_min + view.sensing.angle_increment * np.arange(len(ranges))
    hit = np.isfinite(ranges)
    return np.stack([view.x + ranges[hit] * np.cos(angles[hit]), view.y + ranges[hit] * np.sin(angles[hit])], -1)
