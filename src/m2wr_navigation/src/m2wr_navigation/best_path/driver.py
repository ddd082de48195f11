# SPDX-License-Identifier: BSD-3-Clause
"""Chooses a path, drives it, and looks again while driving.

A path through unknown space is a hope: it may end at a wall. One rule keeps each run at least as good as the best one
before. The robot follows a hope only while the way driven so far and the best way on known cells from here to the goal
score together no worse than that best run. So it can still fall back in time. Without such a run, or without a way on
known cells, it follows every hope, and plans again where the way ends; it has been everywhere before it says that there
is no way.
"""
from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING, List, Optional, Tuple

import numpy as np

from m2wr_navigation.best_path.candidates import (
    Candidate,
    Task,
    candidates,
    costs_along,
    planned,
    samples,
    scored,
)
from m2wr_navigation.best_path.pilot import ARRIVED, Pilot, passable
from m2wr_navigation.best_path.track import HALF_WIDTH, ObstacleField, Track
from m2wr_navigation.costmap.cost_layout import INSCRIBED, NO_INFORMATION
from m2wr_navigation.methods.method import REACHED, RUNNING, STUCK, UNREACHABLE, Decision

if TYPE_CHECKING:
    from m2wr_navigation.best_path.memory import Run
    from m2wr_navigation.best_path.settings import Settings
    from m2wr_navigation.best_path.survey import Survey
    from m2wr_node.array_types import FloatArray

log = logging.getLogger(__name__)

REVIEW = 1.0                # s between two looks whether the path is still free, and a hope still affordable
MARGIN = 0.01               # a new path must be better by this share than the best one driven: rehearsals are not exact
FALL_BACK = "ThetaStar"     # gives the way back while a hope is followed
BLOCKED_AHEAD = 3.0         # m of the plan in which a newly seen obstacle counts
NEW = 0.1                   # m by which a new obstacle is nearer than all others were: two cells
HELD_UP = 2.0               # s without a valid command, after which another path is chosen
SAME_PLACE = 0.5            # m: a robot that is held up again so near to the last time waits
MOST_PLANS = 200            # in one drive


class BestPath:
    """One drive to a goal.

    Parameters
    ----------
    settings : Settings
    survey : Survey
        Grows while the robot drives.
    goal : (2,) float64
        [m]
    record : (int, Run) or None
        Number and record of the best run before, from the same start to the same goal.

    Attributes
    ----------
    candidates : list of Candidate
        Of the last choice, the best first.
    chosen : Candidate or None
        The one that is driven.
    plans : int
        Number of choices so far.
    """

    def __init__(self, settings: Settings, survey: Survey, goal: FloatArray,
                 record: Optional[Tuple[int, Run]] = None) -> None:
        self._settings, self._survey, self._record = settings, survey, record
        self.goal = np.array(goal[:2], float)
        self.candidates: List[Candidate] = []
        self.chosen: Optional[Candidate] = None
        self.plans = 0
        self._hopeful = settings.unknown
        self._pilot: Optional[Pilot] = None
        self._samples: List[Tuple[float, float, float, float]] = []
        self._reviewed = 0.0
        self._obstacles: Optional[ObstacleField] = None         # when the path was chosen
        self._held_up_at: Optional[FloatArray] = None
        self._end: Optional[Decision] = None

    @property
    def track(self) -> Optional[Track]:
        """What was driven so far, from the first command on."""
        if not self._samples:
            return None
        rows = np.array(self._samples)
        return Track(rows[:, 0], rows[:, 1:], self.goal)

    def step(self, now: float, pose: FloatArray, velocity: FloatArray) -> Decision:
        """Return the command of a cycle; a cycle with a choice takes seconds, and its command is zero.

        Parameters
        ----------
        now : float
            [s]
        pose : (3,) float64
            Of the axle [m, m, rad].
        velocity : (3,) float64
            Of the axle [m/s, m/s, rad/s].
        """
        if self._end is not None:
            return self._end
        if self._samples and now > self._samples[-1][0]:
            self._samples.append((now, pose[0], pose[1], pose[2]))
        if self._pilot is None:
            return self._choose(now, pose)
        if now - self._reviewed >= REVIEW:
            self._reviewed = now
            why = self._review(pose)
            if why:
                return self._choose_again(why)
        decision = self._pilot.step(now, pose, velocity)
        if decision.outcome == REACHED and np.hypot(*(self.goal - pose[:2])) > ARRIVED:
            return self._choose_again("the path of the best run before ends before the goal")
        if decision.outcome in (STUCK, REACHED):
            return self._finish(decision)
        if not self._samples:
            self._samples.append((now, pose[0], pose[1], pose[2]))
        if self._pilot.idle(now) > HELD_UP and (
                self._held_up_at is None or np.hypot(*(self._held_up_at - pose[:2])) > SAME_PLACE):
            self._held_up_at = np.array(pose[:2], float)
            return self._choose_again(decision.reason)
        return decision

    def _choose_again(self, why: str) -> Decision:
        log.info("%s; choosing again", why)
        self._pilot = None
        return Decision(0.0, 0.0, RUNNING, why)

    def _finish(self, decision: Decision) -> Decision:
        self._end = Decision(0.0, 0.0, decision.outcome, decision.reason)
        return self._end

    # ---- choosing ----------------------------------------------------------------------------------------------

    def _task(self, pose: FloatArray) -> Task:
        return Task(self._survey.inflated(), ObstacleField(self._survey.snapshot()), self._settings.scorer,
                    self._settings.make, np.array(pose, float), self.goal)

    def _choose(self, now: float, pose: FloatArray) -> Decision:
        """Make candidates and take the best."""
        self.plans += 1
        if self.plans > MOST_PLANS:
            return self._finish(Decision(0.0, 0.0, STUCK, "{} paths were chosen".format(MOST_PLANS)))
        task = self._task(pose)
        found = candidates(task, self._settings.planners, self._hopeful)
        if not self._hopeful and self._settings.unknown and all(candidate.score is None for candidate in found):
            self._hopeful = True        # there is nothing to fall back on
            found = candidates(task, self._settings.planners, True)
        if self._record is not None and self.plans == 1:
            found = self._with_record(task, found)
        known = [candidate for candidate in found if candidate.known and candidate.score is not None]
        hopes = [candidate for candidate in found if not candidate.known and candidate.score is not None]
        best = known[0] if known else None
        remembered = next((candidate for candidate in known if candidate.name.startswith("run ")), None)
        if best is not None and remembered is not None and best.total > (1.0 - MARGIN) * remembered.total:
            best = remembered
        if hopes and (best is None or hopes[0].total < (1.0 - MARGIN) * best.total
                      and (self._record is None or self._affordable(task, best))):
            best = hopes[0]
        self.candidates = sorted(found, key=lambda candidate: candidate.total)
        if best is None:
            reason = next((candidate.reason for candidate in found if candidate.reason), "no planner found a path")
            return self._finish(Decision(0.0, 0.0, UNREACHABLE, reason))
        self.chosen, self._reviewed, self._obstacles = best, now, task.obstacles
        self._pilot = Pilot(self._settings.make(), best.plan, passable(task.costmap))
        return Decision(0.0, 0.0, RUNNING, "chosen: {}, score {:.2f} m".format(best.name, best.total))

    def _with_record(self, task: Task, found: List[Candidate]) -> List[Candidate]:
        """Add the best run before as a candidate: its plan, or its track if it had more than one plan.

        Both end near the goal, not at it.
        """
        assert self._record is not None
        number, run = self._record
        plan = run.plan if len(run.plan) else run.track.thinned(0.5).poses
        left = self.goal - plan[-1, :2]
        if left.any():
            plan = np.vstack([plan, [*self.goal, np.arctan2(left[1], left[0])]])
        again = scored(task, "run {} again".format(number), plan)
        # it was driven, so that its cells are free, whatever the grid says
        again = replace(again, name="run {} again".format(number), known=True)
        return sorted(found + [again], key=lambda candidate: candidate.total)

    # ---- looking again -----------------------------------------------------------------------------------------

    def _review(self, pose: FloatArray) -> str:
        """Return why another path has to be chosen; empty: the chosen one is still good."""
        assert self.chosen is not None and self._pilot is not None and self._obstacles is not None
        task = self._task(pose)
        self._pilot.costmap = passable(task.costmap)
        plan = self._pilot.plan
        rest = plan[int(np.argmin(np.hypot(*(plan[:, :2] - pose[:2]).T))):]
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rest[:, :2], axis=0).T))])
        ahead = rest if not self.chosen.known else rest[along <= BLOCKED_AHEAD]
        costs = costs_along(task.costmap, ahead)
        blocked = (costs >= INSCRIBED) & (costs != NO_INFORMATION)
        if not self.chosen.known and blocked.any():
            return "the way through unknown space is blocked"
        points = samples(ahead)
        near, before = task.obstacles.distances(points), self._obstacles.distances(points)
        if self.chosen.known and ((near <= HALF_WIDTH) & (near <= before - NEW)).any():
            return "an obstacle is in the way"
        if self.chosen.known or not (costs == NO_INFORMATION).any() or self._record is None:
            return ""
        # a way back that takes longer is not affordable, and its rehearsal would take long while the robot drives
        task = replace(task, longest=self._record[1].track.time)
        back = planned(task, FALL_BACK, FALL_BACK, {"cost_factor": 0.0}, False)
        if len(back.plan) and (back.score is None or not self._affordable(task, back)):
            self._hopeful = False
            return "the way through unknown space could become longer than the best one known"
        return ""

    def _affordable(self, task: Task, back: Candidate) -> bool:
        """Return whether the robot can follow a hope for another period, then fall back, and be as good as the record.

        Parameters
        ----------
        task : Task
        back : Candidate
            On known cells, from here.
        """
        assert self._record is not None and back.track is not None
        driven, track = self.track, back.track
        if driven is not None:
            track = driven.then(track)
        whole = self._settings.scorer.score(track, task.obstacles)
        # to follow the hope for a period and to come back costs at most what two periods of driving cost
        reserve = 2.0 * REVIEW * whole.total / max(track.time, REVIEW)
        return whole.total + reserve <= self._record[1].total
