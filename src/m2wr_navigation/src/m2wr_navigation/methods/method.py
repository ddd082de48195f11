# SPDX-License-Identifier: BSD-3-Clause
"""The interface of methods without a map, and what they share: nearby obstacles, steering, arrival, and giving up.

A method sees one scan, the pose and the velocity in each cycle, and answers with a command. It knows no ROS and no map.
The robot turns about its axle, and a disc around the axle holds it at every heading; its measures are those of a
:class:`~m2wr_navigation.methods.body.RobotBody`, by default of m2wr.
"""
from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation.methods.body import M2WR, RobotBody
from m2wr_navigation.methods.compiled_surroundings import CompiledSurroundings
from m2wr_navigation.methods.standstill import Standstill
from m2wr_navigation.parameters import Configurable, Parameter
from motion_plan.surroundings import KEEP_RANGE

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Vector
    from motion_plan.surroundings import Surroundings

RUNNING, REACHED, UNREACHABLE, STUCK = "running", "reached", "unreachable", "stuck"
TURN_ON_SPOT = 0.6          # rad: with a larger error of the heading the robot turns without driving
_TURN_GAIN = 2.5            # 1/s
RADIUS_MARGIN = 0.05        # m: around the robot, if the radius is not given

#: Parameters of all methods.
COMMON: Dict[str, Parameter] = {
    "max_vel_x": Parameter(0.5, "m/s", 0.05, 5.0, "greatest speed"),
    "max_vel_theta": Parameter(1.0, "rad/s", 0.1, 10.0, "greatest rate of turning"),
    "braking": Parameter(0.5, "m/s^2", 0.01, 50.0, "deceleration that is counted on before an obstacle"),
    "radius": Parameter(0.0, "m", 0.0, 5.0, "of the disc around the axle that is kept free; 0: that in which the robot "
                        "can turn, and {:g} m".format(RADIUS_MARGIN)),
    "sight": Parameter(KEEP_RANGE, "m", 0.5, 30.0, "readings of the laser beyond are not used"),
    "goal_tolerance": Parameter(0.2, "m", 0.02, 5.0, "distance to the goal at which it is reached"),
    "patience": Parameter(120.0, "s", 1.0, 1e6, "the robot is stuck if it moved less than 1 m in this time"),
}


@dataclass(frozen=True)
class Sensing:
    """What a method sees in one cycle.

    Attributes
    ----------
    stamp : float
        ROS time [s].
    pose : (3,) float
        Of link_chassis in the odometry frame when the scan was taken [m, m, rad].
    velocity : (float, float)
        Forward [m/s] and turning [rad/s].
    ranges : (B,) array_like
        Readings [m]; +inf, -inf and NaN as in REP 117.
    angle_min, angle_increment : float
        Of the scan [rad].
    """

    stamp: float
    pose: Tuple[float, float, float]
    velocity: Tuple[float, float]
    ranges: Any
    angle_min: float
    angle_increment: float


@dataclass(frozen=True)
class Decision:
    """What a method answers.

    Attributes
    ----------
    linear, angular : float
        Command [m/s, rad/s].
    outcome : str
        RUNNING, REACHED, UNREACHABLE or STUCK. After any but the first the command is zero.
    reason : str
        What the method does, or why it ended.
    """

    linear: float
    angular: float
    outcome: str = RUNNING
    reason: str = ""


@dataclass
class View:
    """The situation of a cycle, as methods use it.

    Attributes
    ----------
    stamp : float
        ROS time [s].
    x, y, yaw : float
        Axle and heading in the odometry frame [m, m, rad].
    velocity : (float, float)
        Forward [m/s] and turning [rad/s].
    goal_distance, goal_direction : float
        From the axle [m], in the odometry frame [rad].
    surroundings : Surroundings
        Obstacle points nearby in the odometry frame.
    sensing : Sensing
        From which all this is.
    """

    stamp: float
    x: float
    y: float
    yaw: float
    velocity: Tuple[float, float]
    goal_distance: float
    goal_direction: float
    surroundings: Surroundings
    sensing: Sensing


class Method(Configurable, ABC):
    """A method. A subclass implements :meth:`decide`, and :meth:`restart` if it has a state.

    Parameters
    ----------
    values : mapping of str to object
        Value of every parameter of :attr:`PARAMETERS`, converted and clipped.
    body : RobotBody, optional
        Of the robot; None: of m2wr.
    """

    PARAMETERS = COMMON

    def __init__(self, values: Mapping[str, Any], body: Optional[RobotBody] = None) -> None:
        super().__init__(values)
        self.body = M2WR if body is None else body
        self.goal = np.zeros(2)
        self._end: Optional[Decision] = None
        self._standstill = Standstill()
        self.surroundings = self._new_surroundings()

    def begin(self, goal: Vector) -> None:
        """Take a new goal and forget everything else.

        Parameters
        ----------
        goal : (2,) float
            In the odometry frame [m].

        Raises
        ------
        ValueError
            If it is not finite.
        """
        if not np.isfinite(np.asarray(goal[:2], float)).all():
            raise ValueError("goal {}; expected finite numbers".format(tuple(goal[:2])))
        self.goal = np.array(goal[:2], float)
        self._end, self._standstill = None, Standstill()
        self.surroundings = self._new_surroundings()
        self.restart()

    def restart(self) -> None:
        """Begin with a new goal; for methods with a state."""

    def _new_surroundings(self) -> Surroundings:
        return CompiledSurroundings(self.body.laser[:2], self.body.own_parts, self.values["sight"])

    @property
    def radius(self) -> float:
        """Of the disc around the axle that is kept free [m]."""
        return float(self.values["radius"]) or self.body.turning_radius + RADIUS_MARGIN

    def step(self, sensing: Sensing) -> Decision:
        """Return the command of a cycle.

        Parameters
        ----------
        sensing : Sensing
        """
        if self._end is not None:
            return self._end
        if len(sensing.ranges) == 0 or not np.isfinite(sensing.pose + sensing.velocity).all():
            return Decision(0.0, 0.0, RUNNING, "{} readings, pose {}; expected readings and finite numbers".format(
                len(sensing.ranges), sensing.pose))
        self.surroundings.update(sensing.ranges, sensing.angle_min + self.body.laser[2], sensing.angle_increment,
                                 sensing.pose)
        x, y = self.body.axle(sensing.pose)
        across, up = self.goal[0] - x, self.goal[1] - y
        view = View(sensing.stamp, x, y, sensing.pose[2], sensing.velocity, math.hypot(across, up),
                    math.atan2(up, across), self.surroundings, sensing)
        decision = self._arrival(view) or self.decide(view)
        if decision.outcome != RUNNING:
            self._end = decision = Decision(0.0, 0.0, decision.outcome, decision.reason)
        return decision

    def _arrival(self, view: View) -> Optional[Decision]:
        """Return the end of the drive, if it is there."""
        if view.goal_distance <= self.values["goal_tolerance"]:
            return Decision(0.0, 0.0, REACHED, "{:.2f} m from the goal".format(view.goal_distance))
        stuck = self._standstill.look(view.stamp, view.x, view.y, self.values["patience"])
        return Decision(0.0, 0.0, STUCK, "the robot " + stuck) if stuck else None

    @abstractmethod
    def decide(self, view: View) -> Decision:
        """Return the command of a cycle in which the goal is not reached.

        Parameters
        ----------
        view : View
        """

    def travel(self, view: View, direction: float) -> Tuple[float, Optional[FloatArray]]:
        """Return how far the disc can travel [m], inf: no end is known, and the point (2,) that ends it.

        Parameters
        ----------
        view : View
        direction : float
            In the odometry frame [rad].
        """
        lengths, blockers = view.surroundings.free_travel(view.x, view.y, [direction], self.radius)
        return float(lengths[0]), None if blockers[0] < 0 else view.surroundings.points[blockers[0]].copy()

    def is_goal_free(self, view: View, look: float) -> bool:
        """Return whether the disc can travel so far towards the goal, or to the goal if that is nearer.

        Parameters
        ----------
        view : View
        look : float
            [m]
        """
        return self.travel(view, view.goal_direction)[0] >= min(look, view.goal_distance)

    def steer(self, view: View, direction: float, reason: str, speed: float = math.inf) -> Decision:
        """Return a command that turns to a direction and drives, slower before obstacles.

        Parameters
        ----------
        view : View
        direction : float
            In the odometry frame [rad].
        reason : str
            For the decision.
        speed : float
            Greatest speed [m/s].
        """
        error = math.remainder(direction - view.yaw, 2.0 * math.pi)
        limit = self.values["max_vel_theta"]
        angular = min(max(_TURN_GAIN * error, -limit), limit)
        if abs(error) > TURN_ON_SPOT:
            return Decision(0.0, angular, RUNNING, reason)
        free = self.travel(view, view.yaw)[0]
        before_obstacle = math.sqrt(2.0 * self.values["braking"] * free)
        linear = min(self.values["max_vel_x"], speed, before_obstacle, view.goal_distance + 0.1)
        return Decision(linear * math.cos(error), angular, RUNNING, reason)
