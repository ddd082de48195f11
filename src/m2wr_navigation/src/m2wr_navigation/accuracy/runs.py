# SPDX-License-Identifier: BSD-3-Clause
"""Drives to random goals by amcl and move_base; errors by the truth."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, List, Mapping, Optional, Tuple

import numpy as np

from m2wr_maps.se2 import between, compose
from m2wr_navigation.accuracy.driven import M2WR_DRIVEN
from m2wr_navigation.accuracy.navigator import Navigator
from m2wr_navigation.localization.amcl_parameters import PARAMETERS
from m2wr_navigation.localization.beams import Beams, ScanGeometry
from m2wr_navigation.localization.confidence import doubt
from m2wr_navigation.localization.localizer import Localizer
from m2wr_sim.api import Sim

if TYPE_CHECKING:
    from m2wr_navigation.accuracy.driven import Driven
    from m2wr_navigation.accuracy.scenes import Scene
    from m2wr_node.array_types import FloatArray
    from m2wr_sim.api import StepResult

PERIOD = 0.1                # s: of scans and commands
LIMIT = 180.0               # s of simulated time for a goal
START_ERROR = np.array([0.2, 0.2, 0.1])         # deviation of the first pose that amcl gets [m, m, rad]
SETTLED = 3.0               # s after which errors count
#: Errors of the odometry, which the simulator measures without any: of its scale and of the straight line, and
#: deviations in proportion to the way and the turn [-, rad/m, rad/m^(1/2), m/m^(1/2), -].
ODOMETRY = {"scale": 0.02, "curve": 0.01, "heading": 0.01, "along": 0.01, "turn": 0.02}


class NoisyOdometry:
    """Odometry with errors of scale, a curve, and random ones.

    Parameters
    ----------
    rng : numpy.random.Generator
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self.pose = rng, np.zeros(3)
        self._last: Optional[FloatArray] = None

    def add(self, measured: FloatArray) -> FloatArray:
        """Return the odometry's pose after a measurement without error.

        Parameters
        ----------
        measured : (3,) float
            [m, m, rad]
        """
        measured = np.asarray(measured, float)
        step = np.zeros(3) if self._last is None else between(self._last, measured)
        self._last = measured
        way, noise = math.hypot(step[0], step[1]), self._rng.standard_normal(3)
        step[0] += ODOMETRY["scale"] * step[0] + ODOMETRY["along"] * math.sqrt(way) * noise[0]
        step[2] += ODOMETRY["curve"] * way + ODOMETRY["heading"] * math.sqrt(way) * noise[1] \
            + ODOMETRY["turn"] * step[2] * noise[2]
        self.pose = compose(self.pose, step)
        return self.pose


class Robot:
    """A robot in a scene, with amcl.

    Parameters
    ----------
    driven : Driven
    scene : Scene
    sim : Sim
        In which it is.
    seed : int
    given : mapping of str to object
        Parameters of amcl.
    """

    def __init__(self, driven: Driven, scene: Scene, sim: Sim, seed: int, given: Mapping[str, Any]) -> None:
        self.sim, rng = sim, np.random.default_rng(seed)
        x, y, yaw = driven.body.laser
        self._laser = (x, y, 0.0), (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
        self.odometry = NoisyOdometry(rng)
        values = {name: parameter.default for name, parameter in PARAMETERS.items()}
        self.localizer = Localizer(scene.map, dict(values, **given), np.random.default_rng(seed))
        self.errors: List[Tuple[float, float, float]] = []      # time [s], distance [m], angle [rad]
        self.contacts = 0
        self.doubt = ""                 # why the newest pose may be wrong, as amcl itself says it

    def take(self, result: StepResult) -> Optional[FloatArray]:
        """Localize by a scan; return the pose on the map, if it is known.

        Parameters
        ----------
        result : StepResult
        """
        scan, odometry = result.scan, result.odometry
        assert scan is not None and odometry is not None
        self.contacts += len(result.contacts)
        pose = self.odometry.add(np.array(odometry.pose))
        geometry = ScanGeometry(scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max)
        beams = Beams.from_scan(scan.ranges.tolist(), geometry, self._laser)
        outcome = self.localizer.process("laser", beams, pose)
        self.doubt = "there is no pose yet" if outcome.map_from_odom is None else doubt(outcome.share, outcome.weight)
        if outcome.map_from_odom is None:
            return None
        found = compose(outcome.map_from_odom, pose)
        error = between(np.array(result.pose), found)
        self.errors.append((result.time, math.hypot(error[0], error[1]), abs(float(error[2]))))
        return found


@dataclass(frozen=True)
class GoalRun:
    """A drive to one goal.

    Attributes
    ----------
    goal : (float, float, float)
        [m, m, rad]
    outcome : str
        Text of the result; ``time out`` after LIMIT.
    reached : bool
        Whether it SUCCEEDED.
    contacts : int
        That began on the way.
    time : float
        Simulated [s].
    away : float
        True distance from the goal at the end [m].
    """

    goal: Tuple[float, float, float]
    outcome: str
    reached: bool
    contacts: int
    time: float
    away: float


def random_goals(scene: Scene, count: int, seed: int, driven: Driven = M2WR_DRIVEN) -> FloatArray:
    """Return places with headings (count, 3) that have some room, and ways between them [m, m, rad].

    Parameters
    ----------
    scene : Scene
    count : int
    seed : int
    driven : Driven

    Raises
    ------
    ValueError
        If there is no such place.
    """
    rng = np.random.default_rng(seed)
    places = scene.free_places(driven.room, driven.passage)
    if not len(places):
        raise ValueError("world {} has no place with {:.2f} m to the next obstacle; expected one, for starts and "
                         "goals".format(scene.name, driven.room))
    return np.column_stack([places[rng.integers(len(places), size=count)], rng.uniform(-math.pi, math.pi, count)])


def drive_to_goals(scene: Scene, count: int, seed: int, given: Mapping[str, Any], amcl: Mapping[str, Any],
                   driven: Driven = M2WR_DRIVEN) -> Tuple[List[GoalRun], FloatArray]:
    """Drive to random goals, one after the other.

    Parameters
    ----------
    scene : Scene
    count : int
    seed : int
        Of goals, noise and particles.
    given : mapping of str to object
        Parameters of move_base.
    amcl : mapping of str to object
        Parameters of amcl.
    driven : Driven

    Returns
    -------
    runs : list of GoalRun
    errors : (N, 2) float64
        Of each scan from the third second on: distance [m], angle [rad].
    """
    start, *goals = random_goals(scene, count + 1, seed, driven)
    runs: List[GoalRun] = []
    with Sim(scene.world, driven.model, tuple(start), seed=seed, sensing="now") as sim:
        robot = Robot(driven, scene, sim, seed, amcl)
        guess = start + START_ERROR * np.random.default_rng(seed).standard_normal(3)
        robot.localizer.start_at(guess, np.diag(np.square([0.5, 0.5, 0.26])))
        navigator = Navigator(scene, given, np.array(driven.body.laser))
        result = sim.step((0.0, 0.0), PERIOD)
        begun = result.time
        for goal in goals:
            runs.append(_one_goal(robot, navigator, goal, result))
            result = sim.step((0.0, 0.0), PERIOD)
    errors = np.array([entry[1:] for entry in robot.errors if entry[0] - begun >= SETTLED])
    return runs, errors


def _one_goal(robot: Robot, navigator: Navigator, goal: FloatArray, result: StepResult) -> GoalRun:
    begun, contacts, outcome, text = result.time, robot.contacts, None, "time out"
    started = False
    while result.time - begun < LIMIT:
        pose = robot.take(result)
        velocity = np.zeros(3)
        if pose is not None:
            assert result.scan is not None and result.odometry is not None
            navigator.look(result.time, result.scan, pose)
            if not started:
                navigator.begin(result.time, goal)
                started = True
            measured = result.odometry
            outcome = navigator.cycle(result.time, np.array([measured.linear_x, measured.linear_y, measured.angular_z]))
            if outcome.result:
                text = outcome.text
                break
            velocity = np.zeros(3) if outcome.velocity is None else outcome.velocity
        result = robot.sim.step((float(velocity[0]), float(velocity[2])), PERIOD)
    reached = outcome is not None and outcome.result == "succeeded"
    return GoalRun((float(goal[0]), float(goal[1]), float(goal[2])), text, reached, robot.contacts - contacts,
                   result.time - begun, math.hypot(result.pose[0] - goal[0], result.pose[1] - goal[1]))
