# SPDX-License-Identifier: BSD-3-Clause
"""Runs planners and methods in one world, and measures their paths against the exact shortest one."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Mapping, Optional, Sequence, Union

import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.compare.clearance import Clearances
from m2wr_navigation.compare.drive import M2WR_ROBOT, Drive, Robot, drive, method_decisions
from m2wr_navigation.compare.movers import movers_of
from m2wr_navigation.compare.planned import Follower, costmap_of, plan_with
from m2wr_navigation.methods.method import UNREACHABLE
from m2wr_navigation.optimum.shortest_path import ShortestPath, shortest_path
from m2wr_navigation.parameters import read
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_view.outlines import FLOOR

if TYPE_CHECKING:
    from m2wr_navigation.methods.method import Decision
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_sim.api import StepResult
    from m2wr_sim.model.types import World

    Decide = Callable[[StepResult], Decision]

_NO_COMPARISON = ("carrot_planner/CarrotPlanner",)      # ends before the first obstacle
#: Names of all planners and methods that are compared.
NAMES = [registry.short_name(name) for name in registry.PLANNERS if name not in _NO_COMPARISON] \
    + list(registry.METHODS)


@dataclass(frozen=True)
class Entry:
    """What one planner or method did.

    Attributes
    ----------
    name : str
    kind : str
        ``planner``, with the true map, ``method``, without a map, or ``program``, which is not ours.
    outcome, reason : str
    path : (N, 2) float64
        Of the axle [m].
    length : float
        Of the path, and of the rest to the goal in a straight line [m].
    ratio : float
        Over the optimum.
    time : float
        Simulated time of the drive [s].
    clearance : float
        Least distance of the robot's outline from an obstacle [m].
    contacts : int
    cpu_ms : float
        CPU time: of one plan, or of a cycle of a method [ms].
    met, struck : int
        Meetings with obstacles that move, and those of them in which the obstacle ran into the robot.
    """

    name: str
    kind: str
    outcome: str
    reason: str
    path: FloatArray
    length: float
    ratio: float
    time: float
    clearance: float
    contacts: int
    cpu_ms: float
    met: int = 0
    struck: int = 0

    @property
    def success(self) -> bool:
        """Whether the goal was reached without a contact."""
        return self.outcome == "reached" and self.contacts == 0

    def record(self) -> Dict[str, Any]:
        """Return everything for JSON, which knows no infinity: a clearance without obstacles is None."""
        found = {key: value if not isinstance(value, float) or math.isfinite(value) else None
                 for key, value in self.__dict__.items() if key != "path"}
        return dict(found, success=self.success, path=np.round(self.path, 3).tolist())


class Comparison:
    """One world with a start and a goal.

    Parameters
    ----------
    world : World or str
        As :func:`m2wr_sim.api.read_world` takes it.
    start : (3,) float
        Pose of the robot [m, m, rad].
    goal : (2,) float
        [m]
    limit : float
        Greatest simulated time of a drive [s].
    seed : int
        Of the noise of the sensors.
    robot : Robot, optional
    patience : float, optional
        As of :func:`m2wr_navigation.compare.drive.drive` [s].

    Attributes
    ----------
    obstacles : list of Outline
        What stands, up to the robot's height.
    movers : list of Mover
    optimum : ShortestPath
        Of the disc inscribed in the robot around its axle, from there to the goal: no path without contacts is shorter.

    Raises
    ------
    NoShortestPathError
        If start or goal are in an obstacle, or nothing connects them.
    """

    def __init__(self, world: Union[World, str], start: Vector, goal: Vector, limit: float = 600.0, seed: int = 0,
                 robot: Robot = M2WR_ROBOT, patience: float = math.inf) -> None:
        self._world, self._limit, self._seed, self._patience = read_world(world), limit, seed, patience
        self.name = world if isinstance(world, str) else world.name
        self.start, self.goal = tuple(map(float, start)), tuple(map(float, goal))
        self.obstacles = obstacle_outlines(self._world, FLOOR, robot.body.height, (self.start[0], self.start[1]))
        self.movers = movers_of(self._world, FLOOR, robot.body.height)
        self.robot, self.inscribed = robot, robot.body.inscribed_radius
        self._clearances = Clearances(self.obstacles, robot.body.footprint)
        self._axle = robot.body.axle(self.start)
        self.optimum: ShortestPath = shortest_path(self.obstacles, self.inscribed, self._axle, self.goal)
        self._costmap = costmap_of(self.obstacles, np.array([self._axle, self.goal]), robot.body.turning_radius)

    def entries(self, names: Sequence[str]) -> Iterator[Entry]:
        """Yield an entry for each name of NAMES, as soon as its drive has ended.

        Parameters
        ----------
        names : sequence of str
        """
        for name in names:
            yield self.entry(name)

    def entry(self, name: str, seed: Optional[int] = None, parameters: Optional[Mapping[str, Any]] = None,
              around: Optional[Callable[[Decide], Decide]] = None) -> Entry:
        """Return what one planner or method did.

        Parameters
        ----------
        name : str
            Of NAMES.
        seed : int, optional
            Of the noise of the sensors; None: that of the comparison.
        parameters : mapping of str to object, optional
            Of the planner or method, which win over the limits of the robot.
        around : callable, optional
            Takes the function that decides in each cycle, and returns the one that is called, such as one that keeps
            a record.
        """
        seed, parameters = self._seed if seed is None else seed, parameters or {}
        around = around or (lambda decide: decide)
        if name in registry.METHODS:
            return self._method(name, seed, parameters, around)
        return self._planner(name, seed, parameters, around)

    def decided(self, name: str, decide: Decide, seed: int) -> Entry:
        """Return what a robot did whose commands come from elsewhere, such as from a ROS program.

        Parameters
        ----------
        name : str
        decide : callable
            Gives a decision for the result of each step.
        seed : int
            Of the noise of the sensors.
        """
        run = self._drive(decide, seed)
        return self._entry(name, "program", run, run.cpu_ms)

    def _method(self, name: str, seed: int, parameters: Mapping[str, Any],
                around: Callable[[Decide], Decide]) -> Entry:
        kind = registry.find(registry.METHODS, name)
        made = kind(read(kind.PARAMETERS, dict(self.robot.limits, **parameters), name)[0], self.robot.body)
        decide = around(method_decisions(made, self.goal))
        run = self._drive(decide, seed)
        return self._entry(name, "method", run, run.cpu_ms)

    def _planner(self, name: str, seed: int, parameters: Mapping[str, Any],
                 around: Callable[[Decide], Decide]) -> Entry:
        plan, spent = plan_with(name, self._costmap, self._axle + self.start[2:], self.goal, parameters)
        if not len(plan.poses):
            run = Drive(UNREACHABLE, plan.reason, np.array([self.start]), 0.0, 0, spent)
        else:
            decide = around(Follower(plan.poses, self._costmap, self.robot))
            run = self._drive(decide, seed)
        return self._entry(name, "planner", run, spent)

    def _drive(self, decide: Decide, seed: int) -> Drive:
        return drive(self._world, self.start, decide, self._limit, seed, self.robot, self._patience)

    def _entry(self, name: str, kind: str, run: Drive, spent: float) -> Entry:
        path = np.concatenate([[self._axle], self.robot.body.axles(run.poses)])
        left = float(np.hypot(*(path[-1] - self.goal)))
        length = float(np.sum(np.hypot(*np.diff(path, axis=0).T))) + left
        clearance = min(self._clearances.least(run.poses), run.moving_clearance)
        return Entry(name, kind, run.outcome, run.reason, path, length, length / max(self.optimum.length, 1e-9),
                     run.time, clearance, run.contacts, spent, run.met, run.struck)


def order(entries: Sequence[Entry]) -> List[Entry]:
    """Return the entries with success first, the shortest path first."""
    return sorted(entries, key=lambda entry: (not entry.success, entry.kind != "planner" and not entry.success,
                                              entry.length))
