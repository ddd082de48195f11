# SPDX-License-Identifier: BSD-3-Clause
"""A controller on a plan of the axle: with the real robot, and in a rehearsal with a simple one."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Callable, List, Tuple

import numpy as np

from m2wr_navigation.best_path.track import OUTLINE, Track
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap.cost_layout import FREE, NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.methods.method import REACHED, RUNNING, STUCK, Decision

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Controller
    from m2wr_node.array_types import FloatArray

PERIOD = 0.05               # s: a command is given at 20 Hz
REHEARSED = 0.1             # s: period in a rehearsal
ARRIVED = 0.2               # m: distance of the axle from the goal at which it is reached
PATIENCE = 10.0             # s without a valid command, after which the robot is stuck
LONGEST = 900.0             # s: greatest duration of a rehearsal
ACCELERATION = 1.0, 3.0     # m/s^2, rad/s^2: of the robot in a rehearsal, as the defaults of PurePursuit

Maker = Callable[[], "Controller"]


def passable(costmap: Costmap) -> Costmap:
    """Return a costmap for controllers, with unknown cells as free ones: their checks end at an unknown cell."""
    costs = costmap.costs.copy()
    costs[costs == NO_INFORMATION] = FREE
    return Costmap(costs, costmap.resolution, costmap.origin, costmap.frame)


class Pilot:
    """Follows a plan.

    Parameters
    ----------
    controller : Controller
    plan : (N, 3) float64
        Of the axle [m, m, rad].
    costmap : Costmap
        Of :func:`passable`; may be replaced by a newer one.
    """

    def __init__(self, controller: Controller, plan: FloatArray, costmap: Costmap) -> None:
        self.plan, self.costmap = plan, costmap
        self._controller = controller
        self._controller.set_plan(plan, True)
        self._valid = -math.inf

    def idle(self, now: float) -> float:
        """Return for how long the controller has given no valid command [s]; 0 before the first cycle."""
        return now - self._valid if math.isfinite(self._valid) else 0.0

    def step(self, now: float, pose: FloatArray, velocity: FloatArray, period: float = PERIOD) -> Decision:
        """Return the command of a cycle.

        Parameters
        ----------
        now : float
            [s]
        pose : (3,) float64
            Of the axle [m, m, rad].
        velocity : (3,) float64
            Of the axle [m/s, m/s, rad/s].
        period : float
            [s]
        """
        left = math.hypot(*(self.plan[-1, :2] - pose[:2]))
        if left <= ARRIVED:
            return Decision(0.0, 0.0, REACHED, "{:.2f} m from the goal".format(left))
        command = self._controller.compute(Situation(now, period, pose, velocity, self.plan, self.costmap, OUTLINE))
        if self._valid == -math.inf:
            self._valid = now
        if command.velocity is not None:
            self._valid = now
            return Decision(float(command.velocity[0]), float(command.velocity[2]), RUNNING, command.reason)
        return Decision(0.0, 0.0, STUCK if self.idle(now) > PATIENCE else RUNNING, command.reason)


def rehearse(make: Maker, plan: FloatArray, costmap: Costmap, pose: FloatArray, goal: FloatArray,
             longest: float = LONGEST) -> Tuple[Track, str]:
    """Return the track of a simple robot on a plan, and why it does not reach the goal; empty: it does.

    The robot follows commands within limits of acceleration, one cycle late.

    Parameters
    ----------
    make : callable
        Returns a new controller.
    plan : (N, 3) float64
        Of the axle [m, m, rad].
    costmap : Costmap
        Of :func:`passable`.
    pose : (3,) float64
        Of the axle, at rest [m, m, rad].
    goal : (2,) float64
        [m]
    longest : float
        Time after which it ends [s].
    """
    pilot, now, velocity = Pilot(make(), plan, costmap), 0.0, np.zeros(3)
    pose, command = np.array(pose, float), np.zeros(3)
    limits = REHEARSED * np.array([ACCELERATION[0], 0.0, ACCELERATION[1]])
    poses: List[FloatArray] = [pose]
    reason = "it takes longer than {:.0f} s".format(longest)
    while now < longest:
        decision = pilot.step(now, pose, velocity, REHEARSED)
        if decision.outcome != RUNNING:
            reason = "" if decision.outcome == REACHED else "the robot stops at ({:.2f}, {:.2f}): {}".format(
                pose[0], pose[1], decision.reason)
            break
        velocity = velocity + np.clip(command - velocity, -limits, limits)
        command = np.array([decision.linear, 0.0, decision.angular])
        middle = pose[2] + 0.5 * velocity[2] * REHEARSED
        pose = pose + REHEARSED * np.array([velocity[0] * math.cos(middle), velocity[0] * math.sin(middle),
                                            velocity[2]])
        poses.append(pose)
        now += REHEARSED
    return Track(REHEARSED * np.arange(len(poses)), np.array(poses), np.array(goal[:2], float)), reason
