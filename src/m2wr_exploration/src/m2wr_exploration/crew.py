# SPDX-License-Identifier: BSD-3-Clause
"""The robots that explore together: what each has to know of the others; without ROS."""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from m2wr_exploration.explorer import DONE, EXPLORING, LOOKED, Explorer, Teammate
from m2wr_exploration.team.making_room import DETOUR, disc
from m2wr_exploration.team.merging import merge
from m2wr_exploration.team.placing import Placing
from m2wr_exploration.team.right_of_way import allowed
from m2wr_maps.se2 import compose
from m2wr_navigation.costmap.cost_layout import LETHAL, NO_INFORMATION
from m2wr_navigation.costmap.footprint import placed

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray, Int8Array

BODY = 0.2              # m: disc drawn for a robot that does not get on; the costmap inflates it
DETOUR_OCCUPANCY = 50   # of a cell around a robot that waits: it becomes making_room's COST in a costmap
STANDS = 5.0            # s: without a move of MOVED, until a robot with a goal counts as one that does not get on
MOVED = 0.1             # m


@dataclass
class Member:
    """One robot of a crew.

    Attributes
    ----------
    name : str
    explorer : Explorer
    place : (2,) float64 or None
        In the frame in which the robot plans [m]; None: not known yet.
    driving : bool
        Whether it has a goal.
    fault : str
        Why it takes no part now, one clause; empty: it takes part.
    length : float
        Of its path so far [m].
    """

    name: str
    explorer: Explorer
    place: Optional[FloatArray] = None
    driving: bool = False
    fault: str = ""
    length: float = 0.0
    moved_at: float = -math.inf             # s: time of the last move of MOVED, and where it began [m]
    moved_from: Any = None


class Crew:
    """All robots.

    Parameters
    ----------
    names : sequence of str
    explorers : sequence of Explorer
        One for each.
    placing : Placing, optional
        Where the frames in which the robots plan lie on each other; default: all plan in one frame.
    """

    def __init__(self, names: Sequence[str], explorers: Sequence[Explorer], placing: Optional[Placing] = None) -> None:
        self.members = [Member(name, explorer) for name, explorer in zip(names, explorers)]
        self.placing = Placing(names, [np.zeros(3) for _ in names]) if placing is None else placing

    def see(self, number: int, now: float, place: FloatArray) -> None:
        """Take where a robot is.

        Parameters
        ----------
        number : int
        now : float
            [s]
        place : (2,) float64
            [m]
        """
        member, place = self.members[number], np.array(place[:2], float)
        if member.place is not None:
            member.length += float(np.hypot(*(place - member.place)))
        member.place = place
        if member.moved_from is None or np.hypot(*(place - member.moved_from)) > MOVED:
            member.moved_at, member.moved_from = now, place

    def drive(self, number: int, now: float, driving: bool) -> None:
        """Take whether a robot has a goal.

        Parameters
        ----------
        number : int
        now : float
            [s]
        driving : bool
        """
        member = self.members[number]
        if driving and not member.driving:
            member.moved_at = now               # a robot that begins is not yet one that does not get on
        member.driving = driving

    def stands(self, number: int, now: float) -> bool:
        """Return whether a robot waits, or has not moved for some time, so that planners have to know of it.

        Parameters
        ----------
        number : int
        now : float
            [s]
        """
        member = self.members[number]
        return not member.driving or bool(member.fault) or now - member.moved_at > STANDS

    def waits(self, number: int) -> bool:
        """Return whether a robot has nothing to do, and makes room for those that have.

        Parameters
        ----------
        number : int
        """
        member = self.members[number]
        return not member.fault and not member.driving and member.explorer.state == EXPLORING

    def others(self, number: int, now: float) -> List[Teammate]:
        """Return the teammates of a robot that take part, and of which it knows where they are.

        One that has ended claims the place where it is, and does not bid.

        Parameters
        ----------
        number : int
        now : float
            [s]
        """
        found = []
        for other, member in enumerate(self.members):
            frame = self.placing.relative(number, other)
            if other == number or member.fault or member.place is None or frame is None:
                continue
            target = member.explorer.target
            claim = member.place if member.explorer.state != EXPLORING else None if target is None else target.centre
            goal = member.explorer.looks_at
            found.append(Teammate(placed(member.place, frame), None if claim is None else placed(claim, frame),
                                  placed(member.explorer.aside.refused(now), frame),
                                  None if goal is None else placed(goal, frame), member.explorer.retries))
        return found

    def share(self, number: int) -> None:
        """Tell the others at which frontiers a robot has looked without seeing anything new; they need not look, too.

        Parameters
        ----------
        number : int
        """
        for entry in self.members[number].explorer.aside.entries:
            if entry.reason == LOOKED:
                for other, member in enumerate(self.members):
                    frame = self.placing.relative(other, number)
                    if other != number and frame is not None:
                        view = member.explorer.view
                        member.explorer.aside.take(replace(entry, points=placed(entry.points, frame))
                                                   if frame.any() else entry, None if view is None else view.costmap)

    def occupancy(self, number: int, now: float, known: Costmap) -> Int8Array:
        """Return a map for a robot (H, W): the others that cannot make room are obstacles, those that drive are not.

        Those that wait make room where a path leads through them; paths beside them are better.

        Parameters
        ----------
        number : int
        now : float
            [s]
        known : Costmap
            Of all robots, without inflation, in the frame in which the robot plans.
        """
        occupancy = np.zeros(known.shape, np.int8)
        occupancy[known.costs == LETHAL], occupancy[known.costs == NO_INFORMATION] = 100, -1
        for other, member in enumerate(self.members):
            frame = self.placing.relative(number, other)
            if other == number or member.place is None or frame is None or not self.stands(other, now):
                continue
            place = placed(member.place, frame)
            if self.waits(other):
                around = disc(known, place, DETOUR)
                occupancy[around] = np.where(occupancy[around] == 0, DETOUR_OCCUPANCY, occupancy[around])
            else:
                occupancy[disc(known, place, BODY)] = 100
        return occupancy

    def merged(self, number: int, maps: Mapping[int, Costmap], starts: Sequence[FloatArray],
               frame: str) -> Optional[Costmap]:
        """Return the map of all robots of a group in the frame in which a robot plans; None: there is none.

        Parameters
        ----------
        number : int
        maps : mapping of int to Costmap
            By robot, each in its own frame.
        starts : sequence of (3,) float64
            Poses of these frames in those in which the robots plan [m, m, rad].
        frame : str
            Name of the frame in which the robot plans.

        Raises
        ------
        ValueError
            If the merged map would be too large.
        """
        frames = {other: self.placing.relative(number, other) for other in maps}
        there = [(maps[other], compose(pose, starts[other])) for other, pose in frames.items() if pose is not None]
        return merge([costmap for costmap, _ in there], [pose for _, pose in there], frame) if there else None

    def commands(self, poses: Mapping[int, FloatArray], velocities: Mapping[int, FloatArray],
                 wanted: Mapping[int, Tuple[float, float]], outline: FloatArray,
                 period: float) -> Mapping[int, Tuple[float, float]]:
        """Return the commands that robots may take, those with lesser numbers first.

        Each keeps apart from those of its group: where others are, it does not know.

        Parameters
        ----------
        poses : mapping of int to (3,) float64
            By robot, each in the frame in which it plans [m, m, rad].
        velocities, wanted
            By robot, for each of ``poses``; as for :func:`m2wr_exploration.team.right_of_way.allowed`.
        outline, period
            As there.
        """
        placing = self.placing                  # it may be replaced at any time
        found: Dict[int, Tuple[float, float]] = {}
        for group in sorted({placing.groups[number] for number in poses}):
            members = [number for number in sorted(poses) if placing.groups[number] == group]
            found.update(zip(members, allowed(
                [compose(placing.frames[number], poses[number]) for number in members],
                [velocities[number] for number in members], [wanted[number] for number in members], outline, period)))
        return found

    def teammates(self, number: int, poses: Mapping[int, FloatArray]) -> List[FloatArray]:
        """Return the poses of the others, as far as they are known, in the frame in which a robot plans [m, m, rad].

        Parameters
        ----------
        number : int
        poses : mapping of int to (3,) float64
            By robot, each in the frame in which it plans [m, m, rad].
        """
        placing = self.placing
        found = [(placing.relative(number, other), pose) for other, pose in poses.items() if other != number]
        return [compose(frame, pose) for frame, pose in found if frame is not None]

    # ---- robots that do not answer

    def lose(self, number: int, now: float, reason: str) -> str:
        """Let a robot take no part until :meth:`welcome`; its frontier is free for others.

        Parameters
        ----------
        number : int
        now : float
            [s]
        reason : str
            One clause.

        Returns
        -------
        str
            What to tell.
        """
        member = self.members[number]
        member.fault, member.driving = reason, False
        place = member.explorer.give_up(now, reason)
        return "{} takes no part: {}{}".format(
            member.name, reason, "; its frontier at {} goes to another robot".format(place) if place else "")

    def welcome(self, number: int) -> str:
        """Let a robot take part; return what to tell.

        Parameters
        ----------
        number : int
        """
        member = self.members[number]
        member.fault = ""
        return "{} takes part".format(member.name)

    @property
    def explored(self) -> bool:
        """Whether no robot that takes part explores any more."""
        return all(member.fault or member.explorer.state != EXPLORING for member in self.members)

    @property
    def ended(self) -> bool:
        """Whether no robot that takes part has anything left to do."""
        return all(member.fault or member.explorer.state == DONE for member in self.members)

    def summary(self) -> str:
        """Return why exploration has ended, and which robots took no part at the end."""
        reasons = sorted({member.explorer.summary for member in self.members if member.explorer.summary})
        apart = self.placing.summary()
        return "; ".join((reasons or ["no robot answers"]) + ([apart] if apart else []) + [
            "{} took no part: {}".format(member.name, member.fault) for member in self.members if member.fault])
