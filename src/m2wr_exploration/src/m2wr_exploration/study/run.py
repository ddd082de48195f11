# SPDX-License-Identifier: BSD-3-Clause
"""One exploration in the simulator: map, frontiers, planner and controller in one process, with exact odometry."""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Callable, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np

from m2wr_exploration.explorer import DONE, Explorer
from m2wr_exploration.frontiers import costs_of_occupancy
from m2wr_exploration.study.truth import explored_share
from m2wr_exploration.team.merging import corners
from m2wr_exploration.team.teammates import without
from m2wr_maps.se2 import between, compose, inverse
from m2wr_navigation.accuracy.navigator import Navigator
from m2wr_navigation.best_path.survey import Survey
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_sim.api import Sim
from motion_plan.body import LASER_X

if TYPE_CHECKING:
    from m2wr_exploration.explorer import Teammate
    from m2wr_exploration.strategies.strategy import Strategy
    from m2wr_exploration.study.guide import Guide
    from m2wr_exploration.study.scenes import Place
    from m2wr_node.array_types import FloatArray, Int8Array
    from m2wr_sim.api import StepResult
    from m2wr_sim.api.records import Odometry, Scan

PERIOD = 0.1                # s: of scans and commands
DECIDES = 1.0               # s: between two looks at the map
MARGIN = 3.0                # m: of the map around the world
LIMIT = 3600.0              # s of simulated time


@dataclass(frozen=True)
class Exploration:
    """What came of one exploration.

    Attributes
    ----------
    share : float
        Of the reachable free area that was seen.
    area : float
        That area [m^2].
    length : float
        Of the path [m].
    time : float
        Simulated [s].
    contacts : int
    ended : str
        Why it ended.
    goals : int
        That were sent.
    curve : (N, 2) float64
        Length of the path [m] and share, once a second.
    path : (N, 2) float64
        Places of the robot, once a second [m].
    messages : list of str
    known : Costmap
        The map at the end.
    """

    share: float
    area: float
    length: float
    time: float
    contacts: int
    ended: str
    goals: int
    curve: FloatArray
    path: FloatArray
    messages: List[str]
    known: Costmap


@dataclass(frozen=True)
class Sight:
    """What one robot measures after a step.

    Attributes
    ----------
    time : float
        [s]
    pose : (3,) float64
        In the frame of the robot [m, m, rad].
    scan : Scan
    odometry : Odometry
    """

    time: float
    pose: FloatArray
    scan: Scan
    odometry: Odometry


def sight(result: StepResult, name: str, frame: Optional[FloatArray] = None) -> Sight:
    """Return what a robot measures.

    Parameters
    ----------
    result : StepResult
    name : str
    frame : (3,) float, optional
        Pose of its frame in the world [m, m, rad]; default: the world.
    """
    seen = result[name]
    assert seen.scan is not None and seen.odometry is not None
    pose = np.array(seen.pose)
    return Sight(result.time, pose if frame is None else between(frame, pose), seen.scan, seen.odometry)


class Drive:
    """The state of one robot in a run.

    Parameters
    ----------
    place : Place
    explorer : Explorer or Guide
    given : mapping of str to object
        Parameters of move_base.
    start : (3,) float, optional
        Where it begins, in its frame [m, m, rad]; default: at the start of the place.
    frame : (3,) float, optional
        Pose of the frame in which it maps and plans, in the world [m, m, rad]; default: the world.
    """

    def __init__(self, place: Place, explorer: Union[Explorer, Guide], given: Mapping[str, Any],
                 start: Optional[FloatArray] = None, frame: Optional[FloatArray] = None) -> None:
        self.place, self.explorer = place, explorer
        points = corners(place.truth, inverse(np.zeros(3) if frame is None else frame))
        low, high = points.min(axis=0), points.max(axis=0)
        self.survey = Survey(float((high - low).max()) + 2.0 * MARGIN, 0.5 * (low + high), "map")
        self.navigator = Navigator(None, given, np.array([LASER_X, 0.0, 0.0]))
        self.navigator.maps["global"].set_footprint(np.array(given["global_costmap"]["footprint"], float))
        self.driving, self.result, self.text = False, "", ""
        self.messages: List[str] = []
        self.curve: List[Tuple[float, float]] = []
        self.path: List[Tuple[float, float]] = []
        self.length, self.goals = 0.0, 0
        x, y = (place.start if start is None else start)[:2]
        self._last: Tuple[float, float] = float(x), float(y)
        self._decided = -math.inf

    def look(self, result: Sight, teammates: Optional[FloatArray] = None) -> None:
        """Take a scan.

        Parameters
        ----------
        result : Sight
        teammates : (N, 2) float64, optional
            Places of the other robots [m]; beams that end on them are not entered into maps.
        """
        pose, clean = result.pose, result.scan
        if teammates is not None and len(teammates):
            laser = compose(pose, np.array([LASER_X, 0.0, 0.0]))
            clean = replace(clean, ranges=without(clean.ranges, clean.angles, laser, teammates))
        self.length += math.hypot(pose[0] - self._last[0], pose[1] - self._last[1])
        self._last = float(pose[0]), float(pose[1])
        self.survey.add(result.time, pose, clean)
        self.navigator.look(result.time, result.scan, pose, clean)

    def is_due(self, now: float) -> bool:
        """Return whether a goal is to be chosen."""
        return bool(self.result) or now - self._decided >= DECIDES

    def decide(self, result: Sight, known: Costmap, occupancy: Int8Array, others: Sequence[Teammate] = ()) -> bool:
        """Choose a goal.

        Parameters
        ----------
        result : Sight
        known : Costmap
            The map, in the frame of the robot.
        occupancy : (H, W) int8
            The same map, with obstacles that are to be known to the planner only.
        others : sequence of Teammate

        Returns
        -------
        bool
            Whether exploration has ended.
        """
        self._decided = result.time
        static = self.navigator.maps["global"].static_layer()
        assert static is not None
        static.set_map(occupancy, known.resolution, np.append(known.origin, 0.0), "map")
        self.navigator.maps["global"].update(result.pose, result.time)
        decision = self.explorer.step(result.time, self.navigator.maps["global"].snapshot(), result.pose,
                                      self.result, self.text, others, Costmap(
                                          costs_of_occupancy(occupancy), known.resolution, known.origin, "map"))
        self.result, self.text = "", ""
        self.messages += ["{:.0f} s: {}".format(result.time, message) for message in decision.messages]
        if decision.goal is not None:
            self.navigator.begin(result.time, decision.goal, self.driving)
            self.driving, self.goals = True, self.goals + 1
        elif decision.cancel:
            self.driving = False
        self.path.append(self._last)
        return decision.state == DONE

    def command(self, result: Sight) -> Tuple[float, float]:
        """Return the next command."""
        if not self.driving:
            return 0.0, 0.0
        measured = result.odometry
        outcome = self.navigator.cycle(result.time, np.array([measured.linear_x, measured.linear_y,
                                                              measured.angular_z]))
        self.messages += self.navigator.messages
        self.navigator.messages = []
        if outcome.result:
            self.driving, self.result, self.text = False, outcome.result, outcome.text
        if outcome.velocity is None:
            return 0.0, 0.0
        return float(outcome.velocity[0]), float(outcome.velocity[2])


def explore(place: Place, strategy: Strategy, values: Mapping[str, Any], given: Mapping[str, Any],
            seed: int, change: Optional[Callable[[float, Sim], None]] = None, limit: float = LIMIT) -> Exploration:
    """Explore a world until nothing reachable is left, or a limit of time.

    Parameters
    ----------
    place : Place
    strategy : Strategy
    values : mapping of str to object
        Parameters of the explorer.
    given : mapping of str to object
        Parameters of move_base.
    seed : int
        Of the noise of the laser.
    change : callable, optional
        Called before each period with the time [s] and the simulation, in which it may move things.
    limit : float
        Simulated [s].

    Returns
    -------
    Exploration
    """
    return follow(place, Explorer(values, strategy), given, seed, change, limit)


def follow(place: Place, guide: Union[Explorer, Guide], given: Mapping[str, Any], seed: int,
           change: Optional[Callable[[float, Sim], None]] = None, limit: float = LIMIT) -> Exploration:
    """Let a robot drive to the goals of an explorer or a guide until there is none, or a limit of time.

    Parameters
    ----------
    place : Place
    guide : Explorer or Guide
    given, seed, change, limit
        As for :func:`explore`.

    Returns
    -------
    Exploration
    """
    drive = Drive(place, guide, given)
    contacts, ended = 0, False
    with Sim(place.world, "m2wr", place.start, seed=seed, sensing="now") as sim:
        result = sim.step((0.0, 0.0), PERIOD)
        begun = result.time
        while not ended and result.time - begun < limit:
            if change is not None:
                change(result.time, sim)
            seen = sight(result, "m2wr")
            drive.look(seen)
            if drive.is_due(seen.time):
                ended = drive.decide(seen, drive.survey.costs, drive.survey.occupancy())
                drive.curve.append((drive.length, explored_share(place.truth, place.wanted, drive.survey.costs)[0]))
            result = sim.step(drive.command(seen), PERIOD)
            contacts += len(result.contacts)
    share, area = explored_share(place.truth, place.wanted, drive.survey.costs)
    return Exploration(share, area, drive.length, result.time - begun, contacts,
                       drive.explorer.summary or "time out", drive.goals, np.array(drive.curve),
                       np.array(drive.path), drive.messages, drive.survey.snapshot())
