# SPDX-License-Identifier: BSD-3-Clause
"""What bug algorithms share: driving towards the goal, and following the boundary of an obstacle to where it began.

The boundary is that of the obstacles inflated by the disc of the robot. The robot follows it with the obstacle on its
right: of all directions, counter-clockwise from the point that it follows, it takes the first that is free.
"""
from __future__ import annotations

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, Any, Mapping, Optional

import numpy as np

from m2wr_navigation.methods.method import STUCK, UNREACHABLE, Decision, Method, View

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody
    from m2wr_node.array_types import FloatArray

LOOK = 0.3                  # m: a direction is free if the disc can travel so far; the boundary is approached over it
HIT = 0.15                  # m: the path to the goal is obstructed if the disc cannot travel so far
LEAVE = 0.5                 # m: it is free again if the disc can travel so far
SWEEP = np.radians(np.arange(0.0, 360.0, 3.0))
AWAY, CLOSED = 1.0, 0.35    # m: a circuit has begun, and is closed, at these distances from its start


class Circuit:
    """The way along a boundary since the hit point.

    Attributes
    ----------
    x, y : float
        Hit point [m].
    length : float
        Travelled since [m].
    """

    def __init__(self, view: View) -> None:
        self.x, self.y = view.x, view.y
        self.length, self._far = 0.0, False
        self._last = (view.x, view.y)

    def closed(self, view: View) -> bool:
        """Take note of the place of a cycle, and return whether the robot is back at the hit point.

        Parameters
        ----------
        view : View
        """
        self.length += math.hypot(view.x - self._last[0], view.y - self._last[1])
        self._last = (view.x, view.y)
        away = math.hypot(view.x - self.x, view.y - self.y)
        self._far = self._far or away > AWAY
        return self._far and away < CLOSED


class BoundaryMethod(Method):
    """A bug algorithm: towards the goal until an obstacle is hit, along its boundary until a rule lets the robot leave.

    Attributes
    ----------
    circuit : Circuit or None
        While the boundary is followed.
    """

    def __init__(self, values: Mapping[str, Any], body: Optional[RobotBody] = None) -> None:
        super().__init__(values, body)
        self.restart()

    def restart(self) -> None:
        self.circuit: Optional[Circuit] = None
        self._contact: FloatArray = np.zeros(2)
        self._side = 1.0

    def decide(self, view: View) -> Decision:
        if self.circuit is None:
            free, blocker = self.travel(view, view.goal_direction)
            if blocker is None or free >= min(HIT, view.goal_distance):
                return self.steer(view, view.goal_direction, "towards the goal")
            self.circuit, self._contact, self._side = Circuit(view), blocker, 1.0
            self.hit(view)
        closed = self.circuit.closed(view)
        decision = self.follow(view, closed)
        return decision or self.along(view)

    def leave(self, view: View, reason: str) -> Decision:
        """Return the command that leaves the boundary and drives towards the goal.

        Parameters
        ----------
        view : View
        reason : str
        """
        self.circuit = None
        return self.steer(view, view.goal_direction, reason)

    @abstractmethod
    def hit(self, view: View) -> None:
        """Take note of a hit point.

        Parameters
        ----------
        view : View
        """

    @abstractmethod
    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        """Return a decision that ends or replaces following the boundary, or None.

        Parameters
        ----------
        view : View
        closed : bool
            Whether the robot is back at the hit point.
        """

    def turn_back(self) -> None:
        """Follow the boundary in the other direction."""
        self._side = -self._side

    def along(self, view: View) -> Decision:
        """Return a command along the boundary.

        Parameters
        ----------
        view : View
        """
        toward = math.atan2(self._contact[1] - view.y, self._contact[0] - view.x)
        directions = toward + self._side * SWEEP
        first, blocker = view.surroundings.first_free(view.x, view.y, directions, self.radius, LOOK)
        if first < 0:
            return Decision(0.0, 0.0, STUCK, "no direction is free at ({:.2f}, {:.2f})".format(view.x, view.y))
        if blocker >= 0:
            self._contact = view.surroundings.points[blocker].copy()
        return self.steer(view, float(directions[first]), "along the boundary")


def no_way(view: View, circuit: Circuit) -> Decision:
    """Return the decision that the goal cannot be reached, after a circuit.

    Parameters
    ----------
    view : View
    circuit : Circuit
    """
    return Decision(0.0, 0.0, UNREACHABLE, "went round the obstacle ({:.1f} m) and found no place to leave it, hit at "
                    "({:.2f}, {:.2f})".format(circuit.length, circuit.x, circuit.y))
