# SPDX-License-Identifier: BSD-3-Clause
"""Decides where to drive next until nothing reachable is left; without ROS."""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from m2wr_exploration.frontiers import Frontier, View, look, reachable_area
from m2wr_exploration.set_aside import SetAside, costs_at
from m2wr_exploration.team.auction import assign
from m2wr_exploration.team.making_room import paths, place_to_wait
from m2wr_navigation.costmap.cost_layout import NO_INFORMATION
from m2wr_navigation.parameters import Parameter, flag
from m2wr_navigation.planners.narrow_ways import with_narrow_ways

if TYPE_CHECKING:
    from m2wr_exploration.strategies.strategy import Strategy
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import Float32Array, FloatArray

PARAMETERS: Dict[str, Parameter] = {
    "robot_radius": Parameter(0.0, "m", 0.0, 10.0, "radius of the disc in which the robot can turn, not less than "
                              "the planner of its goals keeps free; frontiers are looked at from where it has room. 0: "
                              "any place that the costmap allows"),
    "least_clearance": Parameter(0.0, "m", 0.0, 10.0, "distance from obstacles at which the robot can drive on but not "
                                 "turn; when nothing else is left, it takes such ways, with one try. 0: none"),
    "min_frontier_size": Parameter(0.5, "m", 0.0, 100.0, "size of the smallest frontier"),
    "min_corner_size": Parameter(0.0, "m", 0.0, 100.0, "size of the smallest frontier in a place too narrow for the "
                                 "robot, into which it looks; 0: none"),
    "look_time": Parameter(0.0, "s", 0.0, 60.0, "time that a robot which has arrived waits for the map, until a "
                           "frontier that is still there counts as looked at"),
    "progress_timeout": Parameter(30.0, "s", 1.0, 1e6, "time without coming nearer, until a frontier is set aside"),
    "retry_after": Parameter(20.0, "s", 0.0, 1e6, "time until a frontier that was set aside is tried again, at first"),
    "tries": Parameter(3, "", 1, 100, "tries of a frontier while the map around it does not change"),
    "max_distance": Parameter(1000.0, "m", 1.0, 1e6, "distance from the start beyond which nothing is explored"),
    "stall_timeout": Parameter(300.0, "s", 10.0, 1e6, "time in which the known area has to grow, or exploration ends"),
    "time_limit": Parameter(0.0, "s", 0.0, 1e9, "time after which exploration ends; 0: none"),
    "return_to_start": flag(False, "whether the robot drives back to where it began"),
}
AUCTION_REACH = 10.0        # m: range of the laser, within which frontiers near to that of another robot are worth less
EXPLORING, RETURNING, DONE = "exploring", "returning", "done"
NEARER = 0.05               # m: by which the path to the goal has to become shorter to count as progress
SAME_GOAL = 0.1             # m: a goal that has moved less is not sent again
CLOSER = 0.5                # m: by which a path has to be shorter or longer to count as another one
BEHIND = 2.0                # m: size of the smallest frontier behind a narrow way; a room behind a door has a greater
SAME_FRONTIER = 0.5         # m: frontiers whose centres are nearer are one
GROWTH = 0.5                # m^2: by which the known area has to grow to count as progress
CLOSED = 2.0                # m^2: by which the reachable area has to shrink for a way to count as closed
LOOKED = "was looked at, and shows nothing new"     # why a frontier is set aside, by any robot of a team
TEAMMATE = 2.5              # m^2: that a teammate which stands takes from it: a disc in which the robot cannot be
SHOWN = 0.2                 # share of the cells of a frontier that have to become known for a look to count as new
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


@dataclass(frozen=True, eq=False)
class Teammate:
    """Another robot that explores.

    Attributes
    ----------
    place : (2,) float64
        In the frame of the map [m].
    target : (2,) float64 or None
        Centre of the frontier to which it drives [m]; None: it has none now.
    refused : (N, 2) float64 or None
        Centres of frontiers that it set aside, and does not bid for now [m]; None: there are none.
    goal : (2,) float64 or None
        Place to which it drives, to look at its target [m]; None: it does not drive.
    retries : bool
        Whether it has nothing to do now, but will try frontiers again that it has set aside.
    """

    place: FloatArray
    target: Optional[FloatArray] = None
    refused: Optional[FloatArray] = None
    goal: Optional[FloatArray] = None
    retries: bool = False

    def refuses(self, frontier: Frontier) -> bool:
        """Return whether it does not bid for a frontier."""
        return self.refused is not None and bool(
            (np.hypot(*(self.refused - frontier.centre).T) < SAME_FRONTIER).any())

    def drives_to(self, frontier: Frontier) -> bool:
        """Return whether a frontier is its target."""
        return self.goal is not None and self.target is not None and bool(
            np.hypot(*(self.target - frontier.centre)) < SAME_FRONTIER)


class Explorer:
    """Chooses goals.

    Alone, by the strategy. With others, by an auction among all robots that have no frontier now.

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
        self.retries = False                # whether all that is left was set aside, and will be tried again
        self._goal: Optional[FloatArray] = None
        self._narrow = False                # whether a narrow way may lead to the target
        self._start: Optional[FloatArray] = None
        self._began: Optional[float] = None
        self._points: FloatArray = np.empty((0, 2))     # of the target, unknown when its goal was sent [m]
        self._looks_from = False            # whether the goal is a place from which the target is in sight
        self._arrived: Optional[float] = None           # s: when the robot came to its goal, and looks since then
        self._best = self._path = math.inf  # m: the shortest path to the goal since the last detour, and that of now
        self._progress, self._detours = 0.0, 0
        self._empty_since: Optional[float] = None
        self._left: List[Frontier] = []     # that it has left to the others
        self._known, self._grew = -math.inf, 0.0
        self._area = self._reachable = 0.0  # m^2: that can be reached now, and once on wide ways
        self._told = ""

    def step(self, now: float, costmap: Costmap, pose: FloatArray, result: str = "", text: str = "",
             others: Sequence[Teammate] = (), known: Optional[Costmap] = None) -> Decision:
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
        others : sequence of Teammate
            The other robots.
        known : Costmap, optional
            The map without inflation, for ``min_corner_size``.

        Returns
        -------
        Decision
        """
        if self._start is None:
            self._start, self._began = np.array(pose, float), now
        messages: List[str] = []
        self.retries = False
        if self.state == DONE:
            return Decision(state=DONE)
        if self.state == RETURNING:
            return self._return(now, pose, result, text)
        self.view = self._look(now, costmap, pose, known)
        if self.view.reason:
            return Decision(messages=self._once(self.view.reason))
        if others and known is not None:
            self.view = self._with_target(self.view, known)
        self._measure_reachable(self.view.costmap, pose)
        for entry in self.aside.forget_changed(costmap, self.view.frontiers):
            messages.append("the map around {} has changed: it may be explored again".format(entry.place))
        messages += self._judge_last(now, costmap, pose, result, text, costmap if known is None else known)
        if self._stalls(now, costmap):
            return self._finish("the known area of {:.1f} m^2 has not grown for stall_timeout, {:g} s".format(
                self._known, self.values["stall_timeout"]), messages)
        if self.values["time_limit"] and now - (self._began or 0.0) > self.values["time_limit"]:
            return self._finish("time_limit of {:g} s is over".format(self.values["time_limit"]), messages)
        decision = self._choose(now, pose, messages, costmap, others)
        if decision.goal is not None and self.target is not None:
            self._points = _unknown_of(costmap if known is None else known, self.target.points)
        return decision

    @property
    def looks_at(self) -> Optional[FloatArray]:
        """Where the robot drives to look at its target (2,) [m], or None if it has none."""
        return None if self.target is None or self._goal is None else self._goal[:2]

    def give_up(self, now: float, reason: str) -> str:
        """Set the present frontier aside, as when the robot does not answer; it has no goal any more.

        Parameters
        ----------
        now : float
            [s]
        reason : str

        Returns
        -------
        str
            Place of the frontier, for a message; empty: there was none.
        """
        target, self.target, self._goal = self.target, None, None
        if target is None or self.view is None:
            return ""
        return self.aside.add(now, self.view.costmap, target, reason).place

    def _look(self, now: float, costmap: Costmap, pose: FloatArray, known: Optional[Costmap]) -> View:
        """Return the frontiers to which there are wide ways; if none is left, those behind narrow ones.

        A robot that is cut off looks for frontiers around its start, from where it has come.
        """
        least, radius, corner, clearance = (self.values[name] for name in (
            "min_frontier_size", "robot_radius", "min_corner_size", "least_clearance"))
        committed = self._narrow and self.target is not None        # the target is not in the view of wide ways
        wide = None if committed else look(costmap, pose[:2], least, radius, corner, known)
        self._narrow = False
        if wide is not None and self._any_allowed(now, wide):
            return wide
        if clearance > 0.0:
            behind = look(costmap, pose[:2], max(least, BEHIND), radius, 0.0, known, clearance)
            if wide is None or self._any_allowed(now, behind):
                self._narrow = True
                return behind
        assert wide is not None and self._start is not None
        around_start = wide if wide.frontiers else look(costmap, self._start[:2], least, radius, corner, known)
        return around_start if around_start.frontiers else wide

    def _with_target(self, view: View, known: Costmap) -> View:
        """Return the view with the robot's target, if its own costmap knows what is there, and the map does not yet.

        Costmaps show more than maps near to a robot. If it turned back where its own costmap shows enough, a hole that
        the map keeps would be a frontier of the next teammate, and of each one after it.
        """
        target, least = self.target, 0.0 if self.target is None else 0.5 * len(self.target.points)
        if target is None or _same(view.frontiers, target) is not None \
                or len(_unknown_of(known, target.points)) <= least \
                or len(_unknown_of(view.costmap, target.points)) >= least:
            return view
        cell = view.costmap.cell(*target.goal)
        if cell is None or not np.isfinite(view.distance[cell]):
            return view
        held = replace(target, cells=view.costmap.cells(target.points), goal_cell=cell, path=float(view.distance[cell]))
        return replace(view, frontiers=view.frontiers + [held])

    def _any_allowed(self, now: float, view: View) -> bool:
        return any(self.aside.allows(now, frontier) for frontier in view.frontiers)

    def _stalls(self, now: float, costmap: Costmap) -> bool:
        """Return whether nothing new was seen for too long: so exploration ends, whatever the frontiers do."""
        known = costmap.known_area
        if known > self._known + GROWTH:
            self._known, self._grew = known, now
        return now - self._grew > self.values["stall_timeout"]

    def _once(self, message: str) -> Tuple[str, ...]:
        found = () if message == self._told else (message,)
        self._told = message
        return found

    # ---- the last goal -----------------------------------------------------------------------------------------

    def _judge_last(self, now: float, costmap: Costmap, pose: FloatArray, result: str, text: str,
                    known: Costmap) -> List[str]:
        """Set the target aside if it failed, made no progress, or shows nothing new."""
        target = self.target
        if target is None and result:       # it has made room
            self._goal = None
        if target is None or self._goal is None:
            return []
        self._note_progress(now)
        if result == "succeeded":
            self._arrived = now
        there, reason, narrow = self._still_there(target), "", self._narrow
        if self._arrived is not None and there is not None and result in ("", "succeeded"):
            if now - self._arrived < self.values["look_time"]:
                return []
            result, reason = "succeeded", "" if self._shows_new(known) else LOOKED
        elif result == "aborted":
            reason = "could not be reached: " + (text or "the goal was aborted")
        elif not result and self._has_closed(costmap, target):
            reason = "the way to it has closed"
        elif not result and now - self._progress > self.values["progress_timeout"]:
            reason = "the robot came no nearer within {:g} s".format(self.values["progress_timeout"])
        if result or reason or self._arrived is not None:
            self.target, self._goal, self._arrived = None, None, None
        if not reason:
            return []
        entry = self.aside.add(now, costmap, there or target, reason, narrow)
        return ["the frontier at {} is set aside: {}".format(entry.place, reason)]

    def _note_progress(self, now: float) -> None:
        """Note whether the path to the goal has become shorter, or is another one because a way has closed.

        A path around an obstacle may lead away from the goal at first, so the straight distance tells nothing.
        """
        assert self.view is not None and self._goal is not None
        cell = self.view.costmap.cell(self._goal[0], self._goal[1])
        path = math.inf if cell is None else float(self.view.distance[cell])
        detour = self._path + CLOSER < path < math.inf and self._detours < self.values["tries"]
        if detour or path < self._best - NEARER:
            self._best, self._progress = path, now
        self._path, self._detours = path, self._detours + detour

    def _shows_new(self, known: Costmap) -> bool:
        """Return whether a good part of the target has become known since its goal was sent.

        So a large hole, whose middle stays where it is, is looked at again from its new border.
        """
        count = len(self._points)
        return count - len(_unknown_of(known, self._points)) > SHOWN * count

    def _has_closed(self, costmap: Costmap, target: Frontier) -> bool:
        """Return whether the target is still unknown, but no way leads to it any more, as behind a door that closes."""
        assert self.view is not None and self._goal is not None
        if self._still_there(target) is not None:
            return False
        cell = costmap.cell(self._goal[0], self._goal[1])
        unknown = np.count_nonzero(costs_at(costmap, target.points) == NO_INFORMATION)
        return 2 * unknown > len(target.points) and (cell is None or not np.isfinite(self.view.distance[cell]))

    def _still_there(self, target: Frontier) -> Optional[Frontier]:
        assert self.view is not None
        return _same(self.view.frontiers, target)

    # ---- the next goal -----------------------------------------------------------------------------------------

    def _choose(self, now: float, pose: FloatArray, messages: List[str], costmap: Costmap,
                others: Sequence[Teammate]) -> Decision:
        view, start = self.view, self._start
        assert view is not None and start is not None
        inside = [frontier for frontier in view.frontiers
                  if np.hypot(*(frontier.goal - start[:2])) <= self.values["max_distance"]]
        if len(inside) < len(view.frontiers):
            messages += self._once("frontiers more than max_distance, {:g} m, from the start are not explored".format(
                self.values["max_distance"]))
        allowed = [frontier for frontier in inside if self.aside.allows(now, frontier)]
        if not allowed:         # time opens ways; it does not show more to a sensor
            allowed = [frontier for frontier in inside if self.aside.may_later(frontier)
                       and self.aside.reason(frontier) == LOOKED]
        if not allowed:
            return self._nothing_left(now, pose, inside, messages, costmap, others)
        self._empty_since = None
        # committed to a frontier until it is gone: otherwise a robot between two equal ones turns to and fro
        kept = None if self.target is None else self._still_there(self.target)
        if kept is not None and any(other.drives_to(kept) and _way(view, other, kept) < kept.path for other in others):
            kept = None         # a teammate that is nearer has taken it over
        chosen = kept if kept is not None and kept in allowed else (
            self._auctioned(view, allowed, others) if others else self.strategy.order(view, allowed)[0])
        if chosen is None:
            return self._wait(pose, others, messages, "the other robots drive to all frontiers; this one waits")
        if chosen is kept and self._arrived is not None:        # it looks
            return Decision(messages=tuple(messages))
        same = self.target is not None and self._goal is not None \
            and float(np.hypot(*(chosen.goal - self._goal[:2]))) < SAME_GOAL
        if same or chosen is kept and self._keeps_place(chosen):
            self.target = chosen
            return Decision(messages=tuple(messages))
        heading = math.atan2(*(chosen.centre - chosen.goal)[::-1]) if np.any(chosen.centre != chosen.goal) else pose[2]
        if chosen is not kept:
            self._best = self._path = chosen.path
            self._progress, self._detours = now, 0
        self.target, self._goal = chosen, np.array([chosen.goal[0], chosen.goal[1], heading])
        self._looks_from, self._arrived = not chosen.beside, None
        return Decision(self._goal.copy(), messages=tuple(messages))

    def _keeps_place(self, now: Frontier) -> bool:
        """Return whether the goal is a place to look from that can be reached, and the place of now is not much nearer.

        The end of a wall is in sight from both sides, and which side is nearer changes with each scan. As each change
        makes the way shorter, there are few. A goal beside a frontier moves on with it.
        """
        assert self.view is not None
        if self._goal is None or not self._looks_from:
            return False
        cell = self.view.costmap.cell(self._goal[0], self._goal[1])
        return cell is not None and bool(np.isfinite(self.view.distance[cell])
                                         and now.path > self.view.distance[cell] - CLOSER)

    def _auctioned(self, view: View, frontiers: List[Frontier], others: Sequence[Teammate]) -> Optional[Frontier]:
        """Return the frontier that an auction gives to this robot; None: the others take all.

        Frontiers to which teammates drive are theirs, unless this robot is nearer by CLOSER. One that was left to
        teammates the last time, and that none has taken, is not left again: as maps differ, all may wait.
        """
        offered = [_same(self._left, frontier) is not None for frontier in frontiers]
        costs = [[frontier.path for frontier in frontiers]]
        for other in others:
            field = None if other.target is not None else _field(view, other)
            if field is not None:
                costs.append([math.inf if before or other.refuses(frontier) else float(field[frontier.goal_cell])
                              for frontier, before in zip(frontiers, offered)])
        claims = [other.target for other in others if other.target is not None and not any(
            other.drives_to(frontier) and frontier.path < _way(view, other, frontier) - CLOSER
            for frontier in frontiers)]
        found = assign(np.array(costs), np.array([frontier.centre for frontier in frontiers]),
                       np.array(claims).reshape(-1, 2), AUCTION_REACH)
        self._left = frontiers if found[0] < 0 else []
        return None if found[0] < 0 else frontiers[found[0]]

    def _wait(self, pose: FloatArray, others: Sequence[Teammate], messages: List[str], why: str) -> Decision:
        """Wait for the teammates, in a place to which the robot drives if it is in their way."""
        assert self.view is not None
        costmap, before = self.view.costmap, self._goal
        kept = None if before is None or self.target is not None else before
        self.target, self._goal = None, None
        driven = paths(costmap, pose[:2], [(other.place, other.goal) for other in others if other.goal is not None])
        place = place_to_wait(costmap, pose[:2], driven, np.array([other.place for other in others]),
                              None if kept is None else kept[:2])
        told = tuple(messages) + self._once(why)
        if place is None:
            return Decision(cancel=before is not None, messages=told)
        if kept is not None and np.hypot(*(place - kept[:2])) < SAME_GOAL:
            self._goal = kept
            return Decision(messages=told)
        self._goal = np.append(place, pose[2])
        return Decision(self._goal.copy(), messages=told)

    def _nothing_left(self, now: float, pose: FloatArray, inside: List[Frontier], messages: List[str], costmap: Costmap,
                      others: Sequence[Teammate]) -> Decision:
        """Wait for teammates, for frontiers that may be tried later, and for ways that may open; or end."""
        if any(other.goal is not None or other.retries for other in others):
            self._empty_since = None
            return self._wait(pose, others, messages, "no frontier is left for this robot; it waits for the others")
        cancel = self._goal is not None
        self.target, self._goal = None, None
        if any(self.aside.may_later(frontier) for frontier in inside) or self.aside.waits(now, costmap):
            self._empty_since, self.retries = None, True
            messages += self._once("all frontiers that are left were set aside; they will be tried again")
            return Decision(cancel=cancel, messages=tuple(messages))
        self._empty_since = now if self._empty_since is None else self._empty_since
        shut = self._reachable - self._area - TEAMMATE * len(others)
        if shut > CLOSED and now - self._empty_since < self.values["retry_after"]:
            messages += self._once("{:.0f} m^2 that could be reached cannot be reached now; the robot waits for the "
                                   "way to open, {:g} s".format(shut, self.values["retry_after"]))
            return Decision(cancel=cancel, messages=tuple(messages))
        if now - self._empty_since < SETTLE:
            return Decision(cancel=cancel, messages=tuple(messages))
        left = ["{}: {}".format(entry.place, entry.reason) for entry in self.aside.unseen(costmap)]
        return self._finish("no reachable frontier is left" + (
            "; given up: " + "; ".join(left) if left else "") + (
            "; {:.0f} m^2 that could be reached once are behind a way that has closed".format(shut)
            if shut > CLOSED else ""), messages, cancel)

    def _measure_reachable(self, room: Costmap, pose: FloatArray) -> None:
        """Measure the area to which wide ways led at a time, and that to which any way leads now.

        So a narrow way that is open on one map and closed on the next does not count as one that has closed.
        """
        clearance = self.values["least_clearance"]
        self._area = wide = reachable_area(room, room, pose[:2])
        if clearance > 0.0:
            self._area = reachable_area(room, with_narrow_ways(room, clearance), pose[:2])
        self._reachable = max(self._reachable, wide)

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


def _same(frontiers: Sequence[Frontier], target: Frontier) -> Optional[Frontier]:
    """Return the frontier of another map that is the target; None: there is none."""
    for frontier in frontiers:
        if np.hypot(*(frontier.centre - target.centre)) < SAME_FRONTIER:
            return frontier
    return None


def _way(view: View, other: Teammate, frontier: Frontier) -> float:
    """Return the length of the path of a teammate to a frontier [m]; inf: none."""
    field = _field(view, other)
    return math.inf if field is None else float(field[frontier.goal_cell])


def _field(view: View, other: Teammate) -> Optional[Float32Array]:
    """Return the length of the path of a teammate to each cell (H, W) [m]; None: it is outside of the map."""
    cell = view.passable.cell(float(other.place[0]), float(other.place[1]))
    return None if cell is None else view.distances_from(cell)


def _unknown_of(known: Costmap, points: FloatArray) -> FloatArray:
    """Return those points (N, 2) that are unknown in a map, and inside of it [m]."""
    points = points[known.inside(known.cells(points))]
    return points[costs_at(known, points) == NO_INFORMATION]
