# SPDX-License-Identifier: BSD-3-Clause
"""Decides where to drive next until nothing reachable is left; without ROS."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Tuple

import numpy as np

from m2wr_exploration.frontiers import Frontier, View, look
from m2wr_exploration.set_aside import SetAside
from m2wr_navigation.costmap.cost_layout import NO_INFORMATION
from m2wr_navigation.parameters import Parameter, flag

if TYPE_CHECKING:
    from m2wr_exploration.strategies.strategy import Strategy
    from m2wr_gmapping.array_types import FloatArray
    from m2wr_navigation.costmap.costmap import Costmap

PARAMETERS: Dict[str, Parameter] = {
    "robot_radius": Parameter(0.0, "m", 0.0, 10.0, "radius of the disc in which the robot can turn; frontiers are "
                              "looked at from where it has room. 0: any place that the costmap allows"),
    "min_frontier_size": Parameter(0.5, "m", 0.0, 100.0, "size of the smallest frontier"),
    "progress_timeout": Parameter(30.0, "s", 1.0, 1e6, "time without coming nearer, until a frontier is set aside"),
    "retry_after": Parameter(20.0, "s", 0.0, 1e6, "time until a frontier that was set aside is tried again, at first"),
    "tries": Parameter(3, "", 1, 100, "tries of a frontier while the map around it does not change"),
    "max_distance": Parameter(1000.0, "m", 1.0, 1e6, "distance from the start beyond which nothing is explored"),
    "stall_timeout": Parameter(300.0, "s", 10.0, 1e6, "time in which the known area has to grow, or exploration ends"),
    "time_limit": Parameter(0.0, "s", 0.0, 1e9, "time after which exploration ends; 0: none"),
    "return_to_start": flag(False, "whether the robot drives back to where it began"),
}
EXPLORING, RETURNING, DONE = "exploring", "returning", "done"
NEARER = 0.05               # m: by which the distance to the goal has to shrink to count as progress
SAME_GOAL = 0.1             # m: a goal that has moved less is not sent again
SAME_FRONTIER = 0.5         # m: frontiers whose centres are nearer are one
GROWTH = 0.5                # m^2: by which the known area has to grow to count as progress
SETTLE = 3.0                # s: so long no frontier has to be left, for maps are late


@dataclass(frozen=True)
class Decision:
    """What to do now.

    Attributes
    ----------
    goal : (3,) float64 or None
        A new goal in the frame of the map [m, m, rad]; None: the last one stays.
    cancel : bool
        Whether the present goal is to be given up.
    messages : tuple of str
        What a user should be told.
    state : str
        EXPLORING, RETURNING or DONE.
    """

    goal: Optional[FloatArray] = None
    cancel: bool = False
    messages: Tuple[str, ...] = ()
    state: str = EXPLORING


class Explorer:
    """Chooses goals.

    Parameters
    ----------
    values : mapping of str to object
        Value of every one of :data:`PARAMETERS`.
    strategy : Strategy
    """

    def __init__(self, values: Mapping[str, Any], strategy: Strategy) -> None:
        self.values, self.strategy = values, strategy
        self.state = EXPLORING
        self.view: Optional[View] = None
        self.target: Optional[Frontier] = None
        self.aside = SetAside(SAME_FRONTIER, values["retry_after"], values["tries"])
        self.summary = ""
        self._goal: Optional[FloatArray] = None
        self._start: Optional[FloatArray] = None
        self._began: Optional[float] = None
        self._best, self._progress = math.inf, 0.0
        self._empty_since: Optional[float] = None
        self._known, self._grew = -math.inf, 0.0
        self._told = ""

    def step(self, now: float, costmap: Costmap, pose: FloatArray, result: str = "", text: str = "") -> Decision:
        """Decide.

        Parameters
        ----------
        now : float
            [s]
        costmap : Costmap
            The map so far.
        pose : (3,) float64
            Of the robot in its frame [m, m, rad].
        result : str
            Of the last goal, once: ``succeeded``, ``aborted`` or ``preempted``; empty: none yet.
        text : str
            Why it was aborted.

        Returns
        -------
        Decision
        """
        if self._start is None:
            self._start, self._began = np.array(pose, float), now
        messages: List[str] = []
        if self.state == DONE:
            return Decision(state=DONE)
        if self.state == RETURNING:
            return self._return(now, pose, result, text)
        self.view = self._look(costmap, pose)
        if self.view.reason:
            return Decision(messages=self._once(self.view.reason))
        for entry in self.aside.forget_changed(costmap):
            messages.append("the map around {} has changed: it may be explored again".format(entry.place))
        messages += self._judge_last(now, costmap, pose, result, text)
        if self._stalls(now, costmap):
            return self._finish("the known area of {:.1f} m^2 has not grown for stall_timeout, {:g} s".format(
                self._known, self.values["stall_timeout"]), messages)
        if self.values["time_limit"] and now - (self._began or 0.0) > self.values["time_limit"]:
            return self._finish("time_limit of {:g} s is over".format(self.values["time_limit"]), messages)
        return self._choose(now, pose, messages)

    def _look(self, costmap: Costmap, pose: FloatArray) -> View:
        """Return the frontiers around the robot; if there are none, those around its start, from where it has come.

        A robot in a place in which it cannot turn is cut off from the rest on the map.
        """
        least, radius = self.values["min_frontier_size"], self.values["robot_radius"]
        view = look(costmap, pose[:2], least, radius)
        if not view.frontiers and self._start is not None:
            around_start = look(costmap, self._start[:2], least, radius)
            if around_start.frontiers:
                return around_start
        return view

    def _stalls(self, now: float, costmap: Costmap) -> bool:
        """Return whether nothing new was seen for too long: so exploration ends, whatever the frontiers do."""
        known = float(np.count_nonzero(costmap.costs != NO_INFORMATION)) * costmap.resolution ** 2
        if known > self._known + GROWTH:
            self._known, self._grew = known, now
        return now - self._grew > self.values["stall_timeout"]

    def _once(self, message: str) -> Tuple[str, ...]:
        found = () if message == self._told else (message,)
        self._told = message
        return found

    # ---- the last goal -----------------------------------------------------------------------------------------

    def _judge_last(self, now: float, costmap: Costmap, pose: FloatArray, result: str, text: str) -> List[str]:
        """Set the target aside if it failed, made no progress, or shows nothing new."""
        target = self.target
        if target is None or self._goal is None:
            return []
        away = float(np.hypot(*(self._goal[:2] - pose[:2])))
        if away < self._best - NEARER:
            self._best, self._progress = away, now
        reason = ""
        if result == "aborted":
            reason = "could not be reached: " + (text or "the goal was aborted")
        elif result == "succeeded" and self._still_there(target) is not None:
            reason = "was looked at, and shows nothing new"
        elif not result and now - self._progress > self.values["progress_timeout"]:
            reason = "the robot came no nearer within {:g} s".format(self.values["progress_timeout"])
        if result or reason:
            self.target, self._goal = None, None
        if not reason:
            return []
        entry = self.aside.add(now, costmap, self._still_there(target) or target, reason)
        return ["the frontier at {} is set aside: {}".format(entry.place, reason)]

    def _still_there(self, target: Frontier) -> Optional[Frontier]:
        assert self.view is not None
        for frontier in self.view.frontiers:
            if np.hypot(*(frontier.centre - target.centre)) < SAME_FRONTIER:
                return frontier
        return None

    # ---- the next goal -----------------------------------------------------------------------------------------

    def _choose(self, now: float, pose: FloatArray, messages: List[str]) -> Decision:
        view, start = self.view, self._start
        assert view is not None and start is not None
        inside = [frontier for frontier in view.frontiers
                  if np.hypot(*(frontier.goal - start[:2])) <= self.values["max_distance"]]
        if len(inside) < len(view.frontiers):
            messages += self._once("frontiers more than max_distance, {:g} m, from the start are not explored".format(
                self.values["max_distance"]))
        allowed = [frontier for frontier in inside if self.aside.allows(now, frontier)]
        if not allowed:
            return self._nothing_left(now, inside, messages)
        self._empty_since = None
        # committed to a frontier until it is gone: otherwise a robot between two equal ones turns to and fro
        kept = None if self.target is None else self._still_there(self.target)
        chosen = kept if kept is not None and kept in allowed else self.strategy.order(view, allowed)[0]
        same = self.target is not None and self._goal is not None \
            and float(np.hypot(*(chosen.goal - self._goal[:2]))) < SAME_GOAL
        if same:
            self.target = chosen
            return Decision(messages=tuple(messages))
        heading = math.atan2(*(chosen.centre - chosen.goal)[::-1]) if np.any(chosen.centre != chosen.goal) else pose[2]
        if chosen is not kept:
            self._best, self._progress = float(np.hypot(*(chosen.goal - pose[:2]))), now
        self.target, self._goal = chosen, np.array([chosen.goal[0], chosen.goal[1], heading])
        return Decision(self._goal.copy(), messages=tuple(messages))

    def _nothing_left(self, now: float, inside: List[Frontier], messages: List[str]) -> Decision:
        """Wait for frontiers that may be tried later; end if there are none."""
        cancel = self._goal is not None
        self.target, self._goal = None, None
        if any(self.aside.may_later(frontier) for frontier in inside):
            self._empty_since = None
            messages += self._once("all frontiers that are left were set aside; they will be tried again")
            return Decision(cancel=cancel, messages=tuple(messages))
        self._empty_since = now if self._empty_since is None else self._empty_since
        if now - self._empty_since < SETTLE:
            return Decision(cancel=cancel, messages=tuple(messages))
        left = ["({:.2f}, {:.2f}): {}".format(frontier.centre[0], frontier.centre[1], self.aside.reason(frontier))
                for frontier in inside]
        return self._finish("no reachable frontier is left" + (
            "; given up: " + "; ".join(left) if left else ""), messages, cancel)

    def _finish(self, reason: str, messages: List[str], cancel: bool = True) -> Decision:
        self.summary, self.target = reason, None
        messages.append("exploration ended: " + reason)
        if self.values["return_to_start"] and self._start is not None:
            self.state, self._goal = RETURNING, self._start
            return Decision(self._start.copy(), messages=tuple(messages), state=RETURNING)
        self.state, self._goal = DONE, None
        return Decision(cancel=cancel, messages=tuple(messages), state=DONE)

    def _return(self, now: float, pose: FloatArray, result: str, text: str) -> Decision:
        if not result:
            return Decision(state=RETURNING)
        self.state = DONE
        told = "the robot is back at its start" if result == "succeeded" else \
            "the robot did not get back to its start: " + (text or result)
        return Decision(messages=(told,), state=DONE)
