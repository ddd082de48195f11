# SPDX-License-Identifier: BSD-3-Clause
"""Robots that do not know where the others began: whose maps lie on each other, and since when that is certain.

Robots whose maps lie on each other are a group, in the frame of the map of its first robot. At first each robot is a
group of its own. Maps of two groups are compared by :mod:`m2wr_exploration.team.map_match`, which refuses what is not
certain. What it accepts has to be found again when the maps have changed: chance agreement of two parts of a building
does not last. Later a robot leaves its group if its map contradicts those of the others, or if another place fits
nearly as well, as in a building whose one half looks like the other one. Otherwise its place becomes more exact, as
larger maps have a smaller error.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from m2wr_exploration.team.map_match import agreement_of, match, refined
from m2wr_exploration.team.merging import merge
from m2wr_maps.se2 import compose, inverse
from m2wr_navigation.costmap.footprint import placed

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

CHANGED = 2.0               # m^2: by which what is known of two maps has to change until they are compared again
CHECKED = 0.02              # share by which a placed map and those of its group change until it is checked again
SAME, SAME_TURN = 0.3, 0.05  # m, rad: two results that differ by less are the same: a few cells, at the middle of a map
CONTRADICTS = 0.15          # share of the obstacles that both maps could have seen, from which a robot leaves its group
AMBIGUOUS = 0.8             # of the best score: another place with more makes it leave; joining asks for less than 0.7


class Placing:
    """Groups of robots, and where their maps lie in the frame of the group.

    Parameters
    ----------
    names : sequence of str
        Of the robots.
    starts : sequence of (3,) float64, optional
        Where their maps lie in a common frame [m, m, rad], if that is known: all are one group from the beginning.

    Attributes
    ----------
    groups : list of int
        For each robot the number of the first robot of its group.
    frames : list of (3,) float64
        Pose of the map of each robot in the frame of its group [m, m, rad].
    """

    def __init__(self, names: Sequence[str], starts: Optional[Sequence[FloatArray]] = None) -> None:
        self.names, self.known = list(names), starts is not None
        self.groups = list(range(len(names))) if starts is None else [0] * len(names)
        self.frames = [np.zeros(3) for _ in names] if starts is None else [np.array(start, float) for start in starts]
        self._pending: Dict[Tuple[int, int], FloatArray] = {}
        self._compared: Dict[Tuple[int, int], float] = {}
        self._checked: Dict[int, float] = {}

    def members(self, group: int) -> List[int]:
        """Return the robots of a group, the first one first.

        Parameters
        ----------
        group : int
        """
        return [robot for robot, own in enumerate(self.groups) if own == group]

    def relative(self, robot: int, other: int) -> Optional[FloatArray]:
        """Return the pose of another robot's map in the map of a robot [m, m, rad]; None: not known.

        Parameters
        ----------
        robot, other : int
        """
        if self.groups[robot] != self.groups[other]:
            return None
        return compose(inverse(self.frames[robot]), self.frames[other])

    @property
    def whole(self) -> bool:
        """Whether all robots are one group."""
        return len(set(self.groups)) <= 1

    def summary(self) -> str:
        """Return which robots' maps do not lie on the map of the first robot; empty: all do."""
        apart = [self.names[robot] for robot, group in enumerate(self.groups) if group]
        return "" if not apart else "it is not certain where the maps of {} lie on that of {}".format(
            ", ".join(apart), self.names[0])

    def update(self, maps: Mapping[int, Costmap]) -> List[str]:
        """Check the members of groups, and compare two groups whose maps have changed.

        Parameters
        ----------
        maps : mapping of int to Costmap
            Newest maps, by robot, each in its own frame; unknown where an obstacle may be one of the robots.

        Returns
        -------
        list of str
            What to tell.
        """
        if self.known:
            return []
        told = self._check(maps)
        together = {group: self._merged(group, maps) for group in set(self.groups)
                    if any(robot in maps for robot in self.members(group))}
        areas = {group: costmap.known_area for group, costmap in together.items()}
        for first in sorted(together):
            for second in sorted(together):
                area = areas[first] + areas[second]
                if first >= second or abs(area - self._compared.get((first, second), 0.0)) < CHANGED:
                    continue
                self._compared[first, second] = area
                told.append(self._compare(first, second, together[first], together[second]))
                if self.groups[second] == first:
                    return told             # the maps of groups have changed
        return told

    def _merged(self, group: int, maps: Mapping[int, Costmap]) -> Costmap:
        robots = [robot for robot in self.members(group) if robot in maps]
        return merge([maps[robot] for robot in robots], [self.frames[robot] for robot in robots])

    def _compare(self, first: int, second: int, one: Costmap, other: Costmap) -> str:
        names = "{} and {}".format(self.names[first], self.names[second])
        try:
            found = match(one, other)
        except ValueError as error:
            return "the maps of {} cannot be compared: {}".format(names, error)
        before = self._pending.pop((first, second), None)
        if found.confidence < 1.0:
            return "the maps of {} are not placed on each other: {}".format(names, found.reason)
        if before is None or not _agree(before, found.pose, other):
            self._pending[first, second] = found.pose
            return "the maps of {} fit, confidence {:.2f}; they are compared again when they have changed".format(
                names, found.confidence)
        self.join(first, second, found.pose)
        x, y, yaw = found.pose.tolist()
        return "the map of {} lies at ({:.2f}, {:.2f}), {:.3f} rad on that of {}; confidence {:.2f}".format(
            self.names[second], x, y, yaw, self.names[first], found.confidence)

    def join(self, first: int, second: int, pose: FloatArray) -> None:
        """Make two groups one.

        Parameters
        ----------
        first, second : int
            Groups; the first one has the lesser number.
        pose : (3,) float64
            Of the second one's frame in the first one's [m, m, rad].
        """
        for robot in self.members(second):
            self.groups[robot], self.frames[robot] = first, compose(pose, self.frames[robot])
        self._forget(second)

    def _forget(self, group: int) -> None:
        """Forget what was found with a group that is no more, or is another one."""
        self._pending = {pair: pose for pair, pose in self._pending.items() if group not in pair}
        self._compared = {pair: area for pair, area in self._compared.items() if group not in pair}

    def _check(self, maps: Mapping[int, Costmap]) -> List[str]:
        """Let robots leave whose maps, which have changed, contradict those of their groups."""
        told = []
        for robot, costmap in sorted(maps.items()):
            group = self.groups[robot]
            others = [other for other in self.members(group) if other != robot and other in maps]
            if robot == group or not others:
                continue
            rest = merge([maps[other] for other in others], [self.frames[other] for other in others])
            area, before = costmap.known_area + rest.known_area, self._checked.get(robot, 0.0)
            if abs(area - before) < max(CHANGED, CHECKED * before):     # a check of large maps takes long
                continue
            self._checked[robot] = area
            reason = _doubt(rest, costmap, self.frames[robot])
            if not reason:
                self._refine(robot, [other for other in others if other < robot], maps)
            else:
                self.groups[robot], self.frames[robot] = robot, np.zeros(3)
                self._forget(robot)
                told.append("the map of {} is taken from that of {} again: {}".format(
                    self.names[robot], self.names[group], reason))
        return told

    def _refine(self, robot: int, before: Sequence[int], maps: Mapping[int, Costmap]) -> None:
        """Make the pose of a map more exact by those of the robots before it: so no two maps follow each other."""
        if not before:
            return
        rest = merge([maps[other] for other in before], [self.frames[other] for other in before])
        pose = refined(rest, maps[robot], self.frames[robot])
        if _agree(pose, self.frames[robot], maps[robot]):
            self.frames[robot] = pose


def _doubt(rest: Costmap, costmap: Costmap, pose: FloatArray) -> str:
    """Return why a map does not lie on that of others for certain any more; empty: it still does."""
    share = 1.0 - agreement_of(rest, costmap, pose)
    if share > CONTRADICTS:
        return "{:.0f} % of their obstacles contradict".format(100.0 * share)
    try:
        found = match(rest, costmap)
    except ValueError:          # too large to be compared: nothing speaks against it
        return ""
    if found.other > AMBIGUOUS:
        return "another place fits {:.0f} % as well".format(100.0 * found.other)
    if found.confidence >= 1.0 and not _agree(pose, found.pose, costmap):
        return "it fits better at ({:.2f}, {:.2f}), {:.3f} rad".format(*found.pose)
    return ""


def _agree(one: FloatArray, other: FloatArray, costmap: Costmap) -> bool:
    """Return whether two poses of a map are the same, as seen at its middle."""
    middle = (costmap.origin + 0.5 * costmap.resolution * np.array(costmap.shape[::-1]))[None]
    apart = placed(middle, one)[0] - placed(middle, other)[0]
    return bool(np.hypot(*apart) < SAME and abs(math.remainder(one[2] - other[2], 2.0 * math.pi)) < SAME_TURN)
