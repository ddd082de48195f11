# SPDX-License-Identifier: BSD-3-Clause
"""One run of a study, in this process: a row of the results from a task."""
from __future__ import annotations

import json
import math
import os
import platform
import time
import traceback
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Tuple

import numba
import numpy as np

from m2wr_campaign.faults.fault import seen_through
from m2wr_campaign.faults.registry import FAULTS, make_fault
from m2wr_campaign.programs.examination import ExaminerLost, examined
from m2wr_campaign.runner.last_seconds import LastSeconds
from m2wr_campaign.store.result_file import packed_path
from m2wr_campaign.study.expansion import with_noise
from m2wr_navigation.compare.comparison import Comparison
from m2wr_navigation.compare.drawing import thinned
from m2wr_navigation.compare.drive import PERIOD
from m2wr_navigation.methods.method import COMMON
from m2wr_navigation.optimum.shortest_path import NoShortestPathError
from m2wr_sim.api import read_world
from m2wr_sim.api.loading import package_folder
from m2wr_sim.errors import SimError
from m2wr_view.outlines import point_distances

if TYPE_CHECKING:
    from m2wr_campaign.faults.fault import Fault
    from m2wr_campaign.study.factors import RunTask
    from m2wr_navigation.compare.comparison import Decide
    from m2wr_navigation.methods.method import Decision
    from m2wr_node.array_types import FloatArray
    from m2wr_sim.api import StepResult

KEPT = 64                   # worlds that a worker keeps ready, about 0.2 MB each
APART = 0.1                 # m between two points of a stored path, more where it has MOST_POINTS
MOST_POINTS = 5000
LONGEST_LOG = 8000          # characters
DONE, FAILED, MISSED = "done", "failed", "missed"
GOAL_TOLERANCE = float(COMMON["goal_tolerance"].default)    # m
ALIKE = 0.02                # m between the place where a method stops and the true one that are no mistake


class RunError(Exception):
    """A run without a result."""


class _Place:
    """A world with a robot, ready for runs.

    Parameters
    ----------
    task : RunTask
    """

    def __init__(self, task: RunTask) -> None:
        self.key = (task.world.key, task.robot.key, task.noise, task.limit, task.patience)
        robot = task.robot.robot
        if task.noise >= 0.0:
            assert not isinstance(robot.model, str)
            robot = replace(robot, model=with_noise(robot.model, task.noise))
        self.comparison = Comparison(read_world(task.world.world), task.world.start, task.world.goal, task.limit, 0,
                                     robot, task.patience)
        optimum = self.comparison.optimum
        straight = math.hypot(*(optimum.points[-1] - optimum.points[0]))
        self.measures = {"optimum": optimum.length, "tortuosity": optimum.length / max(straight, 1e-9),
                         "openness": _openness(self.comparison)}


def _openness(comparison: Comparison) -> float:
    """Return the mean distance of the shortest path from the nearest obstacle [m], NaN without obstacles."""
    points = comparison.optimum.points
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.linspace(0.0, lengths[-1], max(2, int(lengths[-1] / APART)))
    places = np.column_stack([np.interp(at, lengths, points[:, axis]) for axis in range(2)])
    nearest = np.min([point_distances(places, outline) for outline in comparison.obstacles]
                     + [np.full(len(places), np.inf)], axis=0)
    return float(nearest.mean())


@lru_cache(maxsize=1)
def _places() -> List[_Place]:
    return []


def place_of(task: RunTask) -> _Place:
    """Return the world of a task with its robot, kept from an earlier run if there was one."""
    places = _places()
    key = (task.world.key, task.robot.key, task.noise, task.limit, task.patience)
    for number, place in enumerate(places):
        if place.key == key:
            places.append(places.pop(number))       # the ones used longest ago are dropped
            return place
    places.append(_Place(task))
    del places[:-KEPT]
    return places[-1]


def watched(decide: Decide, fault: Optional[Fault] = None, poses: Optional[List[Tuple[float, float, float]]] = None,
            last: Optional[LastSeconds] = None) -> Decide:
    """Return a function that decides through a fault, keeps a record, and ends the run if a command is not finite.

    Parameters
    ----------
    decide : callable
    fault : Fault, optional
    poses : list of (3,) float, optional
        Gets the robot's true pose at each decision [m, m, rad], for the path of a run that fails.
    last : LastSeconds, optional
        Gets all else that is known at each decision, for the bag of a run that fails.
    """
    def checked(result: StepResult) -> Decision:
        if poses is not None:
            poses.append(result.pose)
        seen = result if fault is None else seen_through(fault, result)
        if last is not None:
            last.look(result, seen)
        decision = decide(seen)
        if last is not None:
            last.decided(decision.linear, decision.angular)
        if not (math.isfinite(decision.linear) and math.isfinite(decision.angular)):
            raise RunError("at {:.2f} s: command ({}, {}); expected finite numbers".format(
                result.time, decision.linear, decision.angular))
        if fault is None:
            return decision
        linear, angular = fault.command(result.time, decision.linear, decision.angular)
        return replace(decision, linear=linear, angular=angular)
    return checked


def perform(task: RunTask) -> Dict[str, Any]:
    """Return the row of a run, also of one that failed with a reason.

    Parameters
    ----------
    task : RunTask
    """
    if task.method.program is None:
        return perform_here(task)
    if task.method.program.problem:
        return row_of_failure(task, task.method.program.problem, "", 0.0)
    wall = time.monotonic()
    try:
        return examined(task)
    except ExaminerLost as error:
        return row_of_failure(task, str(error), "", time.monotonic() - wall)


def perform_here(task: RunTask, decide_with: Optional[Callable[[], Decide]] = None) -> Dict[str, Any]:
    """Return the row of a run in this process.

    Parameters
    ----------
    task : RunTask
    decide_with : callable, optional
        Starts the program of a method that is none of this workspace, and returns its decisions.
    """
    wall, cpu = time.monotonic(), time.process_time()
    row = dict(task.factors(), key=task.key, status=DONE, log="", versions=versions())
    poses: List[Tuple[float, float, float]] = []
    last, body = LastSeconds(PERIOD), task.robot.robot.body
    try:
        fault = make_fault(task.fault.name, dict(task.fault.parameters), task.seed) if task.fault.label else None
        row.update(_measured(task, lambda decide: watched(decide, fault, poses, last), decide_with))
    except (RunError, SimError, NoShortestPathError, ValueError) as error:
        row.update(failed(str(error)))
    except Exception as error:                  # a method of a user may raise anything
        row.update(failed("{}: {}".format(type(error).__name__, error), traceback.format_exc()))
    if row["status"] == FAILED and poses:
        row.update(path=_path_of(body.axles(np.array(poses))), time=_stored(PERIOD * len(poses)), bag=last.bag(body))
    row.update(wall=time.monotonic() - wall, cpu=time.process_time() - cpu)
    return row


def failed(reason: str, log: str = "") -> Dict[str, Any]:
    """Return the columns of a run without a result.

    Parameters
    ----------
    reason : str
    log : str, optional
    """
    return {"status": FAILED, "outcome": FAILED, "reason": reason, "success": 0, "log": log[-LONGEST_LOG:]}


def row_of_failure(task: RunTask, reason: str, log: str, wall: float) -> Dict[str, Any]:
    """Return the row of a run that its worker could not end.

    Parameters
    ----------
    task : RunTask
    reason : str
    log : str
        What the worker wrote.
    wall : float
        Wall time [s].
    """
    return dict(task.factors(), key=task.key, versions=versions(), wall=wall, **failed(reason, log))


def _measured(task: RunTask, around: Callable[[Decide], Decide],
              decide_with: Optional[Callable[[], Decide]]) -> Dict[str, Any]:
    place = place_of(task)
    if decide_with is not None:
        entry = place.comparison.decided(task.method.name, around(decide_with()), task.seed)
    else:
        entry = place.comparison.entry(task.method.name, task.seed, dict(task.method.parameters), around)
    found: Dict[str, Any] = dict(place.measures)
    found.update((name, getattr(entry, name)) for name in (
        "outcome", "reason", "length", "ratio", "time", "clearance", "contacts", "cpu_ms"))
    found.update(success=int(entry.success), turning=_turning(entry.path))
    if FAULTS[task.fault.name].MOVES_POSE and entry.success:
        found.update(_missed(float(np.hypot(*(entry.path[-1] - task.world.goal))), dict(task.method.parameters)))
    found = {name: _stored(value) if isinstance(value, float) else value for name, value in found.items()}
    return dict(found, path=_path_of(entry.path))


def _missed(distance: float, parameters: Dict[str, Any]) -> Dict[str, Any]:
    """Return what changes if a robot that took itself for arrived is too far from the goal [m]."""
    tolerance = float(parameters.get("goal_tolerance", GOAL_TOLERANCE))
    if distance <= tolerance + ALIKE:
        return {}
    reason = "it took itself for arrived {:.2f} m from the goal; the tolerance is {:g} m".format(distance, tolerance)
    return {"outcome": MISSED, "success": 0, "reason": reason}


def _path_of(path: FloatArray) -> bytes:
    """Return a path (N, 2) [m] as it is stored: with at most MOST_POINTS points."""
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    return packed_path(thinned(path, max(APART, length / (MOST_POINTS - 2))))


def _stored(value: float) -> Optional[float]:
    """Return a measure to a millionth, so that rounding errors make no difference; None for what is not finite."""
    return round(value, 6) if math.isfinite(value) else None


def _turning(path: FloatArray) -> float:
    """Return the sum of all changes of the heading along a path (N, 2) [rad]."""
    ways = np.diff(thinned(path, APART), axis=0)
    headings = np.unwrap(np.arctan2(ways[:, 1], ways[:, 0])) if len(ways) else np.zeros(0)
    return float(np.abs(np.diff(headings)).sum())


@lru_cache(maxsize=1)
def versions() -> str:
    """Return the versions of what a run depends on, as JSON."""
    manifest = os.path.join(package_folder("m2wr_campaign"), "package.xml")
    release = ElementTree.parse(manifest).getroot().findtext("version")
    return json.dumps({"m2wr": release, "python": platform.python_version(), "numpy": np.__version__,
                       "numba": numba.__version__, "machine": platform.machine()}, sort_keys=True)
