# SPDX-License-Identifier: BSD-3-Clause
"""Runs of the best path in one process: Bug 2 explores, each later run chooses among the paths known by then."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, List, Optional, Tuple

import numpy as np

from m2wr_navigation.best_path.driver import BestPath
from m2wr_navigation.best_path.memory import PERIOD as STORED
from m2wr_navigation.best_path.memory import REACHED, Memory, Run
from m2wr_navigation.best_path.pilot import PERIOD
from m2wr_navigation.best_path.survey import Survey
from m2wr_navigation.best_path.track import ObstacleField, Track
from m2wr_navigation.methods.method import RUNNING
from m2wr_sim.api.sim import Sim
from m2wr_tools.bug2_runner import LIMIT, TURN, Bug2Driver
from motion_plan.bug2 import State
from motion_plan.pose_history import PoseHistory
from motion_plan.surroundings import axle_of

if TYPE_CHECKING:
    from m2wr_navigation.best_path.candidates import Candidate
    from m2wr_navigation.best_path.settings import Settings
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_sim.api.records import Odometry, Scan

SIZE = 40.0                 # m: side of the surveyed square
EXPLORER = "Bug 2"


@dataclass(frozen=True)
class Result:
    """What a run was.

    Attributes
    ----------
    run : Run
    candidates : list of Candidate
        Of the first choice, the best first; empty for the exploring run.
    contacts : int
        Contacts of the robot with obstacles that began.
    known_area : float
        Area that is known after the run [m^2].
    """

    run: Run
    candidates: List[Candidate]
    contacts: int
    known_area: float


class _Eyes:
    """Adds each scan to a survey, at the pose of its time."""

    def __init__(self, sim: Sim, robot: str, survey: Survey) -> None:
        self._survey, self._history = survey, PoseHistory()
        sim.drive(robot).callbacks.append(self._on_odometry)
        sim.lasers(robot)[0].callbacks.append(self._on_scan)
        self.speed = (0.0, 0.0)

    def _on_odometry(self, odometry: Odometry) -> None:
        self._history.add(odometry.time, odometry.pose)
        self._survey.incline(odometry.orientation)
        self.speed = (odometry.linear_x, odometry.angular_z)

    def _on_scan(self, scan: Optional[Scan]) -> None:
        pose = None if scan is None else self._history.at(scan.time)
        if scan is not None and pose is not None:
            self._survey.add(scan.time, pose, scan)


def run_once(world: Any, memory: Memory, start: Vector, goal: Vector, settings: Settings, seed: int = 0,
             limit: float = LIMIT, **options: Any) -> Result:
    """Drive once: without a map by Bug 2, otherwise on the best path; map and experience go into the memory.

    Parameters
    ----------
    world : World or str
        As for :class:`~m2wr_sim.api.sim.Sim`.
    memory : Memory
        Changed, not saved.
    start : (3,) float
        Pose of link_chassis [m, m, rad].
    goal : (2,) float
        [m]
    settings : Settings
    seed : int
        Of the noise of the sensors.
    limit : float
        Simulated time after which to give up [s].
    **options
        Of Sim.

    Returns
    -------
    Result
    """
    end = np.array([goal[0], goal[1]], float)
    begin = float(start[0]), float(start[1]), float(start[2])
    survey = Survey(SIZE, 0.5 * (np.array(begin[:2]) + end))
    found: List[Candidate] = []
    explores = memory.cells is None
    if memory.cells is not None:
        survey.seed(memory.cells, memory.resolution, memory.origin)
        memory.rescore(settings.scorer, ObstacleField(survey.costs))
    with Sim(world, "m2wr", begin, seed, command_timeout=1.0, **options) as sim:
        eyes = _Eyes(sim, sim.robots[0], survey)
        if explores:
            track, outcome, reason, contacts = _explore(sim, begin, end, limit)
            run = Run(EXPLORER, outcome, reason, track, np.zeros((0, 3)), {}, 0.0)
        else:
            driver = BestPath(settings, survey, end, memory.best(axle_of(begin), end))
            run, found, contacts = _drive(sim, driver, eyes, limit)
    score = settings.scorer.score(run.track, ObstacleField(survey.costs))
    run = Run(run.how, run.outcome, run.reason, run.track, run.plan, score.amounts, score.total)
    memory.cells, memory.resolution = survey.occupancy(), survey.costs.resolution
    memory.origin = float(survey.costs.origin[0]), float(survey.costs.origin[1])
    run = memory.add(run)
    return Result(run, found, contacts, survey.known_area)


def _explore(sim: Sim, start: Tuple[float, float, float], goal: FloatArray,
             limit: float) -> Tuple[Track, str, str, int]:
    """Drive by Bug 2; return track, outcome, reason and contacts."""
    bug = Bug2Driver(sim, sim.robots[0], (start[0], start[1]), (float(goal[0]), float(goal[1])))
    rows, contacts, over = [], 0, False
    now = sim.observe()
    while not over and now.time < limit:
        contacts += len(now.contacts)
        rows.append((now.time, *axle_of(now.pose), now.pose[2]))
        now = sim.step(None, TURN)
        over = bug.turn()
    found = np.array(rows)
    outcome = REACHED if bug.bug.state is State.GOAL_REACHED else bug.bug.state.value
    return Track(found[:, 0], found[:, 1:], goal).thinned(STORED), outcome, bug.bug.reason, contacts


def _drive(sim: Sim, driver: BestPath, eyes: _Eyes, limit: float) -> Tuple[Run, List[Candidate], int]:
    """Drive on the best path."""
    first: List[Candidate] = []
    now, contacts = sim.step((0.0, 0.0), 2 * PERIOD), 0
    while True:
        pose = np.array([*axle_of(now.pose), now.pose[2]])
        decision = driver.step(now.time, pose, np.array([eyes.speed[0], 0.0, eyes.speed[1]]))
        first = first or driver.candidates
        if decision.outcome != RUNNING or now.time > limit:
            break
        now = sim.step((decision.linear, decision.angular), PERIOD)
        contacts += len(now.contacts)
    track = driver.track or Track(np.array([now.time]), pose[None], driver.goal)
    outcome = decision.outcome if decision.outcome != RUNNING else "time out"
    chosen = driver.chosen
    plan = chosen.plan if chosen is not None and driver.plans == 1 else np.zeros((0, 3))
    return Run(first[0].name if chosen is None else chosen.name, outcome, decision.reason, track.thinned(STORED), plan,
               {}, 0.0), first, contacts
