# SPDX-License-Identifier: BSD-3-Clause
"""The interface of global planners, and what they share: checks with reasons, nearest reachable goals, headings."""
from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Callable, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import INSCRIBED, LETHAL, NO_INFORMATION
from m2wr_navigation.parameters import Configurable
from m2wr_navigation.planners import wave_kernels
from m2wr_navigation.planners.free_sides import with_free_sides
from m2wr_navigation.planners.narrow_ways import with_narrow_ways

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import Float32Array, FloatArray

ESCAPE = 0.5                # m: a robot whose centre is in an inscribed cell may cross others this far to get out
Cell = Tuple[int, int]


class PlanningError(ValueError):
    """There is no plan; the message says why."""


@dataclass(frozen=True)
class Plan:
    """A path.

    Attributes
    ----------
    poses : (N, 3) float64
        From the robot to the goal, in the frame of the costmap [m, m, rad]; N = 0: there is none.
    reason : str
        Why there is none, one sentence; empty for a path.
    remark : str
        What a user may wonder about a path, one sentence; may be empty.
    """

    poses: FloatArray
    reason: str = ""
    remark: str = ""

    @classmethod
    def none(cls, reason: str) -> Plan:
        """Return a failure with its reason."""
        return cls(np.zeros((0, 3)), reason)

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(np.sum(np.hypot(*np.diff(self.poses[:, :2], axis=0).T)))


class Planner(Configurable, ABC):
    """A global planner.

    Parameters
    ----------
    values : mapping of str to object
        Value of every parameter of :attr:`PARAMETERS`, converted and clipped.
    clock : callable, optional
        Returns a time [s]; for planners that have a limit of time. Without it they have none, and equal input gives
        equal plans.
    """

    def __init__(self, values: Mapping[str, Any], clock: Optional[Callable[[], float]] = None) -> None:
        super().__init__(values)
        self.clock = clock

    def plan(self, costmap: Costmap, start: FloatArray, goal: FloatArray, tolerance: float = 0.0) -> Plan:
        """Return a path, or why there is none.

        Parameters
        ----------
        costmap : Costmap
            Not changed.
        start, goal : (3,) float64
            In its frame [m, m, rad].
        tolerance : float
            If the goal cannot be reached: half the side of a square around it in which another place will do [m].

        Returns
        -------
        Plan
        """
        start, goal = np.asarray(start, float), np.asarray(goal, float)
        remark = ""
        if costmap.least_clearance > 0.0:
            wide = self.plan(replace(costmap, least_clearance=0.0), start, goal)
            if len(wide.poses):
                return wide
            costmap = with_narrow_ways(costmap, costmap.least_clearance)
        try:
            if costmap.beside > 0.0:
                try:
                    return self.search(with_free_sides(costmap, goal), start, goal, tolerance)
                except PlanningError:       # as the original does: cells are coarse, and the controller has the outline
                    remark = "the plan leads through a place that is narrower than the robot, {:.2f} m".format(
                        2.0 * costmap.beside)
            return replace(self.search(costmap, start, goal, tolerance), remark=remark)
        except PlanningError as error:
            return Plan.none(str(error))

    @abstractmethod
    def search(self, costmap: Costmap, start: FloatArray, goal: FloatArray, tolerance: float) -> Plan:
        """Return a path; raises PlanningError with the reason if there is none.

        Parameters
        ----------
        costmap : Costmap
        start, goal : (3,) float64
            [m, m, rad]
        tolerance : float
            [m]
        """


def cost_table(neutral: float, factor: float, allow_unknown: bool) -> Float32Array:
    """Return the cost (256,) float32 to cross a cell of each value; free cells cost 1, inf: blocked.

    navfn has 50 + 0.8 c up to 253 (``navfn.h``), and takes 253 for unknown cells.

    Parameters
    ----------
    neutral : float
        Cost of a free cell.
    factor : float
        Weight of a cell's value.
    allow_unknown : bool
        Whether unknown cells may be crossed, like the most expensive known ones.
    """
    table = np.full(256, np.inf, np.float32)
    table[:INSCRIBED] = (neutral + factor * np.arange(INSCRIBED)) / neutral
    if allow_unknown:
        table[NO_INFORMATION] = table[INSCRIBED - 1]
    return table


def _place(costmap: Costmap, cell: Cell) -> str:
    return "({:.2f}, {:.2f})".format(*costmap.centre(*cell))


def _kind_of(cost: int) -> str:
    return {LETHAL: "in an obstacle", INSCRIBED: "so near to an obstacle that the robot would collide",
            NO_INFORMATION: "in unknown space"}.get(cost, "free")


def cell_of(costmap: Costmap, pose: FloatArray, what: str) -> Cell:
    """Return the cell of a pose.

    Parameters
    ----------
    costmap : Costmap
    pose : (3,) float64
    what : str
        ``start`` or ``goal``, for messages.

    Raises
    ------
    PlanningError
        If it is not on the costmap.
    """
    if not np.isfinite(pose).all():
        raise PlanningError("the {} is ({}, {}, {}); expected finite numbers".format(what, *pose))
    cell = costmap.cell(pose[0], pose[1])
    if cell is None:
        far = costmap.origin + costmap.resolution * np.array([costmap.columns, costmap.rows])
        raise PlanningError("the {} ({:.2f}, {:.2f}) is outside of the map, which is x {:.2f} to {:.2f}, y {:.2f} to "
                            "{:.2f} in {}".format(what, pose[0], pose[1], costmap.origin[0], far[0],
                                                  costmap.origin[1], far[1], costmap.frame))
    return cell


def leave_inscribed(costmap: Costmap, table: Float32Array, start: Cell) -> FloatArray:
    """Return cells (N, 2) from the start to the nearest cell that is not blocked, the start first.

    Parameters
    ----------
    costmap : Costmap
    table : (256,) float32
    start : (row, column)

    Raises
    ------
    PlanningError
        If the start is in an obstacle, or there is no such cell nearby.
    """
    cost = int(costmap.costs[start])
    if table[cost] < np.inf:
        return np.array([start], float)
    if cost != INSCRIBED:
        raise PlanningError("the start {} is {}".format(_place(costmap, start), _kind_of(cost)))
    reach = int(math.ceil(ESCAPE / costmap.resolution))
    top, left = max(0, start[0] - reach), max(0, start[1] - reach)
    window = np.ascontiguousarray(costmap.costs[top:start[0] + reach + 1, left:start[1] + reach + 1])
    passable = np.where(np.arange(256) < LETHAL, 1.0, np.inf).astype(np.float32)
    passable[NO_INFORMATION] = table[NO_INFORMATION]
    potential = np.full(window.shape, np.inf, np.float32)
    begin = start[0] - top, start[1] - left
    wave_kernels.wave(window, passable, begin, (-1, -1), potential, np.zeros((0, 0), np.uint8), True)
    free = np.where(table[window] < np.inf, potential, np.inf)
    nearest = np.unravel_index(int(np.argmin(free)), free.shape)
    if not free[nearest] * costmap.resolution < ESCAPE:
        raise PlanningError("the start {} is {}, and there is no free cell within {:g} m".format(
            _place(costmap, start), _kind_of(cost), ESCAPE))
    cells = wave_kernels.descend(potential, (int(nearest[0]), int(nearest[1])), begin, False)[::-1]
    return cells + np.array([top, left], float)


def reachable_goal(costmap: Costmap, table: Float32Array, start: Cell, goal: Cell, tolerance: float) -> Cell:
    """Return the goal, or the nearest cell to it that can be reached.

    Parameters
    ----------
    costmap : Costmap
    table : (256,) float32
    start, goal : (row, column)
    tolerance : float
        [m]

    Raises
    ------
    PlanningError
        With the reason why the goal cannot be reached.
    """
    found, count = wave_kernels.connected(costmap.costs, table, start)
    if found[goal] == 1:
        return goal
    reach = int(math.floor(tolerance / costmap.resolution + 1e-9))
    top, left = max(0, goal[0] - reach), max(0, goal[1] - reach)
    window = found[top:goal[0] + reach + 1, left:goal[1] + reach + 1]
    rows, columns = np.nonzero(window)
    if len(rows):
        nearest = int(np.argmin((rows + top - goal[0]) ** 2 + (columns + left - goal[1]) ** 2))
        return int(rows[nearest] + top), int(columns[nearest] + left)
    cost = int(costmap.costs[goal])
    within = ", and no place within the tolerance of {:g} m can be reached".format(tolerance) if reach else ""
    if not table[cost] < np.inf:
        raise PlanningError("the goal {} is {}{}".format(_place(costmap, goal), _kind_of(cost), within))
    raise PlanningError("there is no way through from {} to the goal {}: {:.1f} m^2 can be reached, and the goal is "
                        "not in it{}".format(_place(costmap, start), _place(costmap, goal),
                                             count * costmap.resolution ** 2, within))


def poses_of(costmap: Costmap, cells: FloatArray, start: FloatArray, goal: FloatArray, exact_goal: bool) -> FloatArray:
    """Return the poses of a path through cells, with headings along it.

    Parameters
    ----------
    costmap : Costmap
    cells : (N, 2) float64
        Row and column; centres are whole numbers.
    start, goal : (3,) float64
        [m, m, rad]
    exact_goal : bool
        Whether the path ends at the goal itself; otherwise at its last cell, with the goal's heading.

    Returns
    -------
    (M, 3) float64
    """
    points = (cells[:, ::-1] + 0.5) * costmap.resolution + costmap.origin
    ends = goal[None, :2] if exact_goal else points[-1:]
    points = np.concatenate([start[None, :2], points[1:-1], ends])
    steps = np.diff(points, axis=0)
    keep = np.concatenate([[True], np.hypot(*steps.T) > 1e-6])
    keep[-1] = True
    points = points[keep]
    if len(points) > 2 and np.hypot(*(points[-1] - points[-2])) <= 1e-6:
        points = np.delete(points, -2, 0)
    poses = np.empty((len(points), 3))
    poses[:, :2] = points
    steps = np.diff(points, axis=0)
    poses[:-1, 2] = np.arctan2(steps[:, 1], steps[:, 0])
    poses[-1, 2] = goal[2]
    return poses
