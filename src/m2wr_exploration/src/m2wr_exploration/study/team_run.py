# SPDX-License-Identifier: BSD-3-Clause
"""One exploration by several robots in the simulator; their maps are merged as soon as it is known where they lie."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence, Tuple

import numpy as np

from m2wr_exploration.crew import Crew
from m2wr_exploration.explorer import Explorer
from m2wr_exploration.frontiers import distances
from m2wr_exploration.study.run import LIMIT, PERIOD, Drive, sight
from m2wr_exploration.study.truth import explored_share
from m2wr_exploration.team.merging import merge
from m2wr_exploration.team.placing import Placing
from m2wr_exploration.team.trails import Trails
from m2wr_maps.se2 import between, compose
from m2wr_navigation.costmap.footprint import placed
from m2wr_sim.api import Sim

if TYPE_CHECKING:
    from m2wr_exploration.strategies.strategy import Strategy
    from m2wr_exploration.study.run import Sight
    from m2wr_exploration.study.scenes import Place
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

APART = 1.5             # m: between two robots at the start; there a third one that drives straight fits between them
WIDE = 100              # cost above which no robot starts
MERGED_EVERY = 1.0      # s


@dataclass(frozen=True)
class TeamExploration:
    """What came of one exploration by several robots.

    Attributes
    ----------
    share, area : float
        Of the reachable area that was seen; that area [m^2].
    time : float
        Until the last robot has ended [s].
    enough : float
        Time at which a share was seen that was asked for [s]; inf: never.
    lengths : list of float
        Path of each robot [m].
    contacts : int
    curve : (N, 2) float64
        Time [s] and share of all maps together, as if it were known where they lie.
    messages : list of str
    placed : float
        Time since when it is known where all maps lie [s]; inf: it is not.
    misplaced : float
        Greatest error of the place of a robot on the map of another one, at the end [m]; 0: none is known.
    """

    share: float
    area: float
    time: float
    enough: float
    lengths: List[float]
    contacts: int
    curve: FloatArray
    messages: List[str]
    placed: float = 0.0
    misplaced: float = 0.0


def starts(place: Place, count: int) -> List[Tuple[float, float, float]]:
    """Return the start poses of robots: that of the place, and the nearest ones that are far enough from each other.

    Parameters
    ----------
    place : Place
    count : int

    Raises
    ------
    ValueError
        If the robots find no room.
    """
    truth = place.truth
    cell = truth.cell(*place.start[:2])
    assert cell is not None
    field = distances(truth, cell)
    rows, columns = np.nonzero(np.isfinite(field) & (truth.costs <= WIDE))
    order = np.argsort(field[rows, columns], kind="stable")
    points = (np.stack([columns, rows], -1)[order] + 0.5) * truth.resolution + truth.origin
    found = [np.array(place.start[:2])]
    for point in points:
        if len(found) == count:
            break
        if np.hypot(*(np.array(found) - point).T).min() >= APART:
            found.append(point)
    if len(found) < count:
        raise ValueError("{}: {} of {} robots found a place to start".format(place.name, len(found), count))
    return [(float(x), float(y), place.start[2]) for x, y in found]


class _Team:
    """The robots of a run.

    Parameters
    ----------
    place : Place
    explorers : sequence of Explorer
    poses : sequence of (3,) float64
        Where the robots start [m, m, rad].
    given : mapping of str to object
        Parameters of move_base.
    names : sequence of str
        Of the robots.
    known : bool
        Whether they know where the others start. If not, each maps in a frame that begins where it starts.
    """

    def __init__(self, place: Place, explorers: Sequence[Explorer], poses: Sequence[FloatArray],
                 given: Mapping[str, Any], names: Sequence[str], known: bool) -> None:
        self.place = place
        self.frames = [np.zeros(3) if known else pose for pose in poses]
        self.drives = drives = [Drive(place, explorer, given, between(frame, pose), frame)
                                for explorer, pose, frame in zip(explorers, poses, self.frames)]
        self.crew = Crew(names, explorers, Placing(names, self.frames if known else None))
        self.ended = [False] * len(drives)
        self.curve: List[Tuple[float, float]] = []
        self.placed = math.inf
        self._merged = -math.inf
        self._outline = drives[0].navigator.maps["local"].footprint
        self._trails = Trails(len(drives), self._outline)
        self._known: List[Costmap] = []
        self._poses: Dict[int, FloatArray] = {}

    def step(self, seen: Sequence[Sight]) -> None:
        """Let every robot look, and choose a goal where one is due."""
        now, poses = seen[0].time, {number: each.pose for number, each in enumerate(seen)}
        self._poses = poses
        for number, drive in enumerate(self.drives):
            drive.look(seen[number], np.array([pose[:2] for pose in self.crew.teammates(number, poses)]).reshape(-1, 2))
            self.crew.see(number, now, poses[number][:2])
            self.crew.drive(number, now, drive.driving)
            if not self.crew.placing.whole:
                self._trails.add(number, poses[number])
        if now - self._merged >= MERGED_EVERY:
            self._merged = now
            whole = self.merged()
            self._known = [whole] * len(seen) if self.crew.placing.known else self._merged_by_group(now)
            self.placed = min(self.placed, now) if self.crew.placing.whole else math.inf
            self.curve.append((now, explored_share(self.place.truth, self.place.wanted, whole)[0]))
        for number, drive in enumerate(self.drives):
            if not self.ended[number] and drive.is_due(now):
                known = self._known[number]
                self.ended[number] = drive.decide(seen[number], known, self.crew.occupancy(number, now, known),
                                                  self.crew.others(number, now))
                self.crew.drive(number, now, drive.driving)
                self.crew.share(number)

    def _merged_by_group(self, now: float) -> List[Costmap]:
        """Look where the maps lie; return for each robot those of its group, merged."""
        maps = {number: drive.survey.snapshot() for number, drive in enumerate(self.drives)}
        placing = self.crew.placing
        told = placing.update(self._trails.comparable(maps, placing))
        self.drives[0].messages += ["{:.0f} s: {}".format(now, text) for text in told]
        maps = self._trails.cleared(maps, placing)
        zeros = [np.zeros(3)] * len(maps)
        merged = [self.crew.merged(number, maps, zeros, "map") for number in maps]
        return [costmap for costmap in merged if costmap is not None]

    def commands(self, seen: Sequence[Sight]) -> List[Tuple[float, float]]:
        """Return the commands of all robots, the first robot with the highest priority."""
        poses, wanted = self._poses, {}
        for number, (drive, each) in enumerate(zip(self.drives, seen)):
            drive.navigator.others = [placed(self._outline, pose) for pose in self.crew.teammates(number, poses)]
            wanted[number] = drive.command(each)
        velocities = {number: np.array([each.odometry.linear_x, each.odometry.angular_z])
                      for number, each in enumerate(seen)}
        found = self.crew.commands(poses, velocities, wanted, self._outline, PERIOD)
        return [found[number] for number in range(len(seen))]

    def merged(self) -> Costmap:
        """Return the map of all robots in the world, merged now as if it were known where all lie."""
        return merge([drive.survey.snapshot() for drive in self.drives], self.frames)

    def misplaced(self) -> float:
        """Return the greatest error of the place of a robot on the map of another one of its group [m]."""
        errors = [0.0]
        for number, frame in enumerate(self.frames):
            for other, pose in self._poses.items():
                found = self.crew.placing.relative(number, other)
                if found is not None:
                    true = compose(between(frame, self.frames[other]), pose)
                    errors.append(float(np.hypot(*(compose(found, pose) - true)[:2])))
        return max(errors)


def explore_together(place: Place, poses: Sequence[Tuple[float, float, float]], strategies: Sequence[Strategy],
                     values: Mapping[str, Any], given: Mapping[str, Any], seed: int, enough: float = 0.99,
                     names: Sequence[str] = (), limit: float = LIMIT, known: bool = True) -> TeamExploration:
    """Explore a world with several robots, until none of them has anything left.

    Parameters
    ----------
    place : Place
    poses : sequence of (3,) float
        Where the robots start [m, m, rad].
    strategies : sequence of Strategy
        One for each; used by a robot that is alone.
    values, given : mapping of str to object
        Parameters of the explorers, and of move_base.
    seed : int
        Of the noise of the lasers.
    enough : float
        Share at which the time is taken.
    names : sequence of str
        Of the robots; default robot1, robot2, ...
    limit : float
        Simulated [s].
    known : bool
        Whether the robots know where the others start. If not, each explores alone until the maps fit.

    Returns
    -------
    TeamExploration

    Raises
    ------
    ValueError
        If there is no robot, or two have one name.
    """
    names = list(names) or ["robot%d" % (number + 1) for number in range(len(poses))]
    if not poses or len(strategies) != len(poses) or len(names) != len(poses):
        raise ValueError("{} start poses, {} strategies and {} names; expected at least one robot, and one of each for "
                         "every robot".format(len(poses), len(strategies), len(names)))
    double = sorted({name for name in names if names.count(name) > 1})
    if double:
        raise ValueError("two robots have the name {}; expected a name for each".format(", ".join(double)))
    team = _Team(place, [Explorer(values, strategy) for strategy in strategies],
                 [np.array(pose, float) for pose in poses], given, names, known)
    contacts = 0
    with Sim(place.world, seed=seed, sensing="now") as sim:
        for name, pose in zip(names, poses):
            sim.spawn("m2wr", pose, name)
        result = sim.step(None, PERIOD)
        begun = result.time
        while not all(team.ended) and result.time - begun < limit:
            seen = [sight(result, name, frame) for name, frame in zip(names, team.frames)]
            team.step(seen)
            result = sim.step(dict(zip(names, team.commands(seen))), PERIOD)
            contacts += len({(contact.first, contact.second, contact.time) for name in names
                             for contact in result[name].contacts})
    share, area = explored_share(place.truth, place.wanted, team.merged())
    curve = np.array(team.curve) - np.array([begun, 0.0])
    reached = curve[curve[:, 1] >= enough, 0]
    return TeamExploration(share, area, result.time - begun, float(reached[0]) if len(reached) else math.inf,
                           [drive.length for drive in team.drives], contacts, curve,
                           ["{}: {}".format(name, text) for name, drive in zip(names, team.drives)
                            for text in drive.messages],
                           team.placed - begun, team.misplaced())
