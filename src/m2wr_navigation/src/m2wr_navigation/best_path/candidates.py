# SPDX-License-Identifier: BSD-3-Clause
"""Paths of all planners from the robot to its goal, each rehearsed and scored."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.best_path.pilot import LONGEST, passable, rehearse
from m2wr_navigation.costmap.cost_layout import NO_INFORMATION
from m2wr_navigation.parameters import read

if TYPE_CHECKING:
    from m2wr_navigation.best_path.pilot import Maker
    from m2wr_navigation.best_path.scoring import Score, Scorer
    from m2wr_navigation.best_path.track import ObstacleField, Track
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

#: Planners that give candidates; CarrotPlanner ends before the first obstacle.
PLANNERS = [registry.short_name(name) for name in registry.PLANNERS if "carrot" not in name]
#: A planner that weighs the costs of cells gives a second path, for which only its length counts.
SHORT = ", short"
UNKNOWN = ", through unknown space"
STEP = 0.025                # m: a plan is looked up on the costmap at least so often


@dataclass(frozen=True)
class Candidate:
    """A path that the robot could drive.

    Attributes
    ----------
    name : str
    plan : (N, 3) float64
        Of the axle [m, m, rad]; N = 0: there is none.
    track : Track or None
        Of its rehearsal.
    score : Score or None
        None: it cannot be driven.
    reason : str
        Why it cannot be driven.
    known : bool
        Whether all its cells are known to be free; otherwise the score is a hope.
    """

    name: str
    plan: FloatArray
    track: Optional[Track] = None
    score: Optional[Score] = None
    reason: str = ""
    known: bool = True

    @property
    def total(self) -> float:
        """Score [m]; inf if it cannot be driven."""
        return float("inf") if self.score is None else self.score.total


@dataclass(frozen=True)
class Task:
    """What candidates are made for.

    Attributes
    ----------
    costmap : Costmap
        Inflated, with unknown cells.
    obstacles : ObstacleField
    scorer : Scorer
    make : callable
        Returns a new controller.
    pose : (3,) float64
        Of the axle [m, m, rad].
    goal : (2,) float64
        [m]
    longest : float
        Candidates that take longer are refused [s].
    """

    costmap: Costmap
    obstacles: ObstacleField
    scorer: Scorer
    make: Maker
    pose: FloatArray
    goal: FloatArray
    longest: float = LONGEST


def samples(plan: FloatArray) -> FloatArray:
    """Return points (M, 2) along a plan, ``STEP`` apart [m].

    Parameters
    ----------
    plan : (N, 3) float64
        [m, m, rad], N >= 1.
    """
    steps = np.hypot(*np.diff(plan[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.append(np.arange(0.0, along[-1], STEP), along[-1])
    return np.stack([np.interp(at, along, plan[:, k]) for k in (0, 1)], -1)


def costs_along(costmap: Costmap, plan: FloatArray) -> Any:
    """Return the costs (M,) uint8 of the cells of its samples; NO_INFORMATION off the grid.

    Parameters
    ----------
    costmap : Costmap
    plan : (N, 3) float64
        [m, m, rad], N >= 1.
    """
    cells = costmap.cells(samples(plan))
    inside = costmap.inside(cells)
    costs = np.full(len(cells), NO_INFORMATION, np.uint8)
    costs[inside] = costmap.costs[cells[inside, 0], cells[inside, 1]]
    return costs


def scored(task: Task, name: str, plan: FloatArray) -> Candidate:
    """Return a plan as a candidate, after its rehearsal.

    Parameters
    ----------
    task : Task
    name : str
    plan : (N, 3) float64
        Of the axle [m, m, rad], N >= 1.
    """
    known = not (costs_along(task.costmap, plan) == NO_INFORMATION).any()
    track, reason = rehearse(task.make, plan, passable(task.costmap), task.pose, task.goal, task.longest)
    score = None if reason else task.scorer.score(track, task.obstacles)
    return Candidate(name if known else name + UNKNOWN, plan, track, score, reason, known)


def _settings(name: str) -> Iterator[Tuple[str, Dict[str, object]]]:
    """Yield name and parameters of each path that a planner is asked for."""
    table = registry.find(registry.PLANNERS, name).PARAMETERS
    yield name, {}
    if "cost_factor" in table:
        yield name + SHORT, {"cost_factor": table["cost_factor"].low}


def planned(task: Task, label: str, planner: str, given: Dict[str, object], unknown: bool) -> Candidate:
    """Return the candidate of one planner.

    Parameters
    ----------
    task : Task
    label : str
        Name of the candidate.
    planner : str
        As in ``registry.PLANNERS``.
    given : dict of str to object
        Parameters of the planner.
    unknown : bool
        Whether the path may lead through unknown cells.
    """
    kind = registry.find(registry.PLANNERS, planner)
    # the goal is a position; planners without a heading at the goal ignore this
    values = read(kind.PARAMETERS, dict(given, allow_unknown=unknown, any_goal_heading=True), planner)[0]
    plan = kind(values).plan(task.costmap, task.pose, np.append(task.goal, 0.0))
    if not len(plan.poses):
        return Candidate(label + UNKNOWN if unknown else label, plan.poses, reason=plan.reason, known=not unknown)
    return scored(task, label, plan.poses)


def candidates(task: Task, planners: Sequence[str], unknown: bool) -> List[Candidate]:
    """Return the candidates of planners, the best first; those that cannot be driven are last, with their reasons.

    Parameters
    ----------
    task : Task
    planners : sequence of str
        As in ``registry.PLANNERS``.
    unknown : bool
        Whether there are candidates through unknown cells, too. A path of a planner that stays on known cells although
        it need not is its only one.
    """
    found: List[Candidate] = []
    for planner in planners:
        for label, given in _settings(planner):
            hopeful = planned(task, label, planner, given, True) if unknown else None
            if hopeful is not None:
                found.append(hopeful)
            if hopeful is None or not hopeful.known:
                found.append(planned(task, label, planner, given, False))
    return sorted(found, key=lambda candidate: candidate.total)
