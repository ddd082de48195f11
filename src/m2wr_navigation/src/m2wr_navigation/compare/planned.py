# SPDX-License-Identifier: BSD-3-Clause
"""Planners on the true world: its costmap, and pure pursuit along planned paths."""
from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any, Mapping, Optional, Sequence, Tuple

import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.compare.drive import PERIOD, Robot
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.controllers.pure_pursuit import PurePursuit
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.inflation_kernels import cost_table, inflate
from m2wr_navigation.methods.method import REACHED, RUNNING, STUCK, Decision
from m2wr_navigation.parameters import read
from m2wr_view.outlines import point_distances

if TYPE_CHECKING:
    from m2wr_navigation.planners.planner import Plan
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_sim.api import StepResult
    from m2wr_view.outlines import Outline

RESOLUTION = 0.05           # m
MARGIN = 2.0                # m of free space around all that is known
INFLATION, SCALING = 1.2, 3.0           # m, 1/m
LARGEST = 4000              # cells along a side
ARRIVED = 0.2               # m, as for methods
PATIENCE = 10.0             # s without a valid command, after which the robot is stuck


def costmap_of(obstacles: Sequence[Outline], ends: FloatArray, radius: float, margin: float = MARGIN) -> Costmap:
    """Return the true costmap of a world, in which a disc is free of obstacles.

    Parameters
    ----------
    obstacles : sequence of Outline
    ends : (N, 2) float64
        Places that have to be on it [m].
    radius : float
        Of the disc [m], such as the one in which the robot can turn.
    margin : float
        Free space around all that is known [m].

    Raises
    ------
    ValueError
        If the world is larger than LARGEST cells.
    """
    points = np.concatenate([ends] + [outline.vertices for outline in obstacles])
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    columns, rows = (int(count) for count in np.ceil((high - low) / RESOLUTION))
    if max(rows, columns) > LARGEST:
        raise ValueError("the world is {:.0f} x {:.0f} m; expected at most {:.0f} m a side".format(
            *(high - low), LARGEST * RESOLUTION))
    costmap = Costmap.filled((rows, columns), RESOLUTION, low, 0, "world")
    for outline in obstacles:
        reach = outline.radius + RESOLUTION
        first = np.maximum(((outline.vertices.min(axis=0) - reach - low) / RESOLUTION).astype(int), 0)
        last = ((outline.vertices.max(axis=0) + reach - low) / RESOLUTION).astype(int) + 1
        window = costmap.costs[first[1]:last[1], first[0]:last[0]]
        row, column = np.mgrid[first[1]:first[1] + window.shape[0], first[0]:first[0] + window.shape[1]]
        centres = low + (np.stack([column.ravel(), row.ravel()], -1) + 0.5) * RESOLUTION
        window[(point_distances(centres, outline) <= 0.5 * RESOLUTION).reshape(window.shape)] = LETHAL
    cells = int(math.ceil(INFLATION / RESOLUTION))
    table = cost_table(cells, RESOLUTION, radius, SCALING)
    inflate(costmap.costs, table, cells, 0, rows, 0, columns, False)
    return costmap


def plan_with(name: str, costmap: Costmap, start: Vector, goal: Vector,
              parameters: Optional[Mapping[str, Any]] = None) -> Tuple[Plan, float]:
    """Return the plan of a planner, and the CPU time that it took [ms].

    Parameters
    ----------
    name : str
        As in ``registry.PLANNERS``.
    costmap : Costmap
    start : (3,) float
        Pose of the axle [m, m, rad].
    goal : (2,) float
        [m]
    parameters : mapping of str to object, optional
        Of the planner.
    """
    kind = registry.find(registry.PLANNERS, name)
    given = dict({"any_goal_heading": True}, **(parameters or {}))         # a drive ends at a place
    planner = kind(read(kind.PARAMETERS, given, name)[0])
    begun = time.process_time()
    plan = planner.plan(costmap, np.array(start[:3], float), np.array([goal[0], goal[1], 0.0]))
    return plan, 1e3 * (time.process_time() - begun)


class Follower:
    """Pure pursuit along a plan, as decisions.

    Parameters
    ----------
    plan : (N, 3) float64
        Of the axle [m, m, rad].
    costmap : Costmap
    robot : Robot
    """

    def __init__(self, plan: FloatArray, costmap: Costmap, robot: Robot) -> None:
        self._controller = PurePursuit(read(PurePursuit.PARAMETERS, robot.limits, "~PurePursuit")[0])
        self._controller.set_plan(plan, True)
        self._plan, self._costmap, self._body = plan, costmap, robot.body
        self._footprint, self._valid = self._body.hull - (self._body.axle_x, 0.0), 0.0

    def __call__(self, result: StepResult) -> Decision:
        odometry = result.odometry
        assert odometry is not None
        x, y = self._body.axle(result.pose)
        left = math.hypot(self._plan[-1, 0] - x, self._plan[-1, 1] - y)
        if left <= ARRIVED:
            return Decision(0.0, 0.0, REACHED, "{:.2f} m from the goal".format(left))
        command = self._controller.compute(Situation(
            result.time, PERIOD, np.array([x, y, result.pose[2]]),
            np.array([odometry.linear_x, odometry.linear_y, odometry.angular_z]), self._plan, self._costmap,
            self._footprint))
        if command.velocity is not None:
            self._valid = result.time
            return Decision(float(command.velocity[0]), float(command.velocity[2]), RUNNING, command.reason)
        return Decision(0.0, 0.0, STUCK if result.time - self._valid > PATIENCE else RUNNING, command.reason)
