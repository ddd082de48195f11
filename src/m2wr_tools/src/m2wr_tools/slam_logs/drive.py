# SPDX-License-Identifier: BSD-3-Clause
"""Drives m2wr through a building in the simulator and records where it truly was and how its wheels turned."""
from __future__ import annotations

import math
import os
import tempfile
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Iterator, List, Optional, Tuple

import numpy as np

from m2wr_maps.se2 import wrap
from m2wr_sim.api import Sim
from m2wr_tools.buildings.free_path import FreeSpace, NoPathError

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_tools.buildings.floor_plan import FloorPlan

PERIOD = 0.1                # of control and of the record [s]
CRUISE, SLOWEST = 0.7, 0.15         # forward speeds [m/s]
TURN_RATE = 1.0             # greatest rotation rate [rad/s]
TURN_ON_THE_SPOT = 0.6      # heading error above which the robot turns without driving [rad]
GAIN = 2.0                  # rotation rate per heading error [1/s]
ARRIVED = 0.15              # distance at which a corner counts as reached [m]
STUCK_TIME = 8.0            # a robot that has moved less than STUCK_WAY in so long is stuck [s]
STUCK_WAY = 0.05            # [m]
BACK_OFF = 10               # records for which a stuck robot drives backwards
STUCK_MOST = 3              # times in a drive
SPIN_SHARE = 0.2            # of the places at which the robot turns once on the spot
MIDDLE = (0.3, 0.6)         # share of the tour after which the robot turns on the spot in any case
WHEELS = ("joint_right_wheel", "joint_left_wheel")      # the report's left wheel, at y > 0, has the joint named right


class StuckError(RuntimeError):
    """The robot no longer moves, or a place cannot be reached."""


@dataclass(frozen=True)
class Drive:
    """Record of a drive.

    Attributes
    ----------
    stamps : (K,) float64
        [s]
    poses : (K, 3) float64
        True poses of the base in the world [m, m, rad].
    wheels : (K, 2) float64
        Rotation of the left and of the right wheel since the start [rad], positive forward.
    spins : list of (int, int)
        First and last record of each full turn on the spot.
    pushed : list of (int, int)
        First and last record while the robot was pushed and its wheels measured nothing.
    carried : list of (int, int)
        First and last record while the robot was lifted and put down: its wheels and its laser measured nothing.
    """

    stamps: FloatArray
    poses: FloatArray
    wheels: FloatArray
    spins: List[Tuple[int, int]]
    pushed: List[Tuple[int, int]] = field(default_factory=list)
    carried: List[Tuple[int, int]] = field(default_factory=list)

    @property
    def length(self) -> float:
        """Distance travelled [m]."""
        return float(np.hypot(*np.diff(self.poses[:, :2], axis=0).T).sum())


@dataclass(frozen=True)
class Upset:
    """A turn on the spot that odometry does not notice.

    Attributes
    ----------
    angle : float
        [rad]
    rate : float
        Of the turn [rad/s].
    carried : bool
        Whether the robot is lifted; if not, it is pushed, and its laser measures on.
    """

    angle: float
    rate: float
    carried: bool


class Driver:
    """Drives m2wr with exact knowledge of its pose.

    Parameters
    ----------
    plan : FloorPlan
    start : (3,) float
        Pose at the beginning [m, m, rad].
    seed : int
        Of the simulation.
    """

    def __init__(self, plan: FloorPlan, start: FloatArray, seed: int) -> None:
        with tempfile.TemporaryDirectory() as folder:
            world = os.path.join(folder, "building.world")
            with open(world, "w", encoding="utf-8") as stream:
                stream.write(plan.sdf())
            self._sim = Sim(world, "m2wr", tuple(float(value) for value in start), seed=seed, sensing="off")
        self._stamps: List[float] = []
        self._poses: List[Tuple[float, float, float]] = []
        self._wheels: List[Tuple[float, float]] = []
        self._spins: List[Tuple[int, int]] = []
        self._pushed: List[Tuple[int, int]] = []
        self._carried: List[Tuple[int, int]] = []
        self._backed_off = 0                # records at the last time
        self._command(0.0, 0.0)

    @property
    def travelled(self) -> float:
        """Distance travelled so far [m]."""
        return float(np.hypot(*np.diff(np.array(self._poses)[:, :2], axis=0).T).sum())

    @property
    def pose(self) -> FloatArray:
        """True pose (3,) now."""
        return np.array(self._poses[-1])

    def _command(self, speed: float, rate: float) -> None:
        result = self._sim.step((speed, rate), PERIOD)
        turned = self._sim.joint_positions()
        self._stamps.append(result.time)
        self._poses.append(result.pose)
        self._wheels.append((turned[WHEELS[0]], turned[WHEELS[1]]))
        back = int(STUCK_TIME / PERIOD)
        if len(self._poses) - self._backed_off > back:
            dx, dy, dyaw = np.subtract(self._poses[-1], self._poses[-1 - back])
            if math.hypot(dx, dy) < STUCK_WAY and abs(wrap(dyaw)) < STUCK_WAY and (speed or rate):
                raise StuckError("the robot is stuck at (%.2f, %.2f) after %.1f s" % (
                    *self._poses[-1][:2], self._stamps[-1]))

    def follow(self, corners: FloatArray) -> None:
        """Drive along the corners (K, 2) [m]."""
        for corner in corners:
            while True:
                x, y, yaw = self._poses[-1]
                distance = math.hypot(corner[0] - x, corner[1] - y)
                if distance < ARRIVED:
                    break
                error = float(wrap(math.atan2(corner[1] - y, corner[0] - x) - yaw))
                rate = max(-TURN_RATE, min(TURN_RATE, GAIN * error))
                if abs(error) > TURN_ON_THE_SPOT:
                    self._command(0.0, rate)
                else:
                    self._command(max(SLOWEST, min(CRUISE, distance) * math.cos(2.0 * error)), rate)

    def spin(self, angle: float) -> None:
        """Turn on the spot by ``angle`` [rad]."""
        self._spins.append(self._turn(angle, TURN_RATE))

    def upset(self, upset: Upset) -> None:
        """Be pushed or carried."""
        (self._carried if upset.carried else self._pushed).append(self._turn(upset.angle, upset.rate))

    def _turn(self, angle: float, rate: float) -> Tuple[int, int]:
        """Turn by an angle [rad] at a rate [rad/s]; return the first and the last record of the turn."""
        begin, done, last = len(self._poses) - 1, 0.0, self._poses[-1][2]
        while abs(done) < abs(angle) - 0.5 * PERIOD * rate:
            self._command(0.0, math.copysign(rate, angle))
            done += float(wrap(self._poses[-1][2] - last))
            last = self._poses[-1][2]
        return begin, len(self._poses) - 1

    def back_off(self) -> None:
        """Drive backwards, away from what the robot is stuck at."""
        self._backed_off = len(self._poses)
        for _ in range(BACK_OFF):
            self._command(-CRUISE, 0.0)

    def record(self) -> Drive:
        """End the simulation and return what was recorded."""
        self._sim.close()
        return Drive(np.array(self._stamps), np.array(self._poses), np.array(self._wheels), self._spins,
                     self._pushed, self._carried)


def tour(plan: FloorPlan, length: float, rng: np.random.Generator) -> Iterator[FloatArray]:
    """Yield places (2,) in the order of a tour: the nearest that was not visited, in turn with earlier ones.

    Where the plan gives the order, the tour follows that, from the beginning again after the last place.

    Parameters
    ----------
    plan : FloorPlan
    length : float
        Distance after which the tour returns to its start [m].
    rng : numpy.random.Generator
    """
    places = plan.places
    at, travelled, visited = 0, 0.0, [0]
    while travelled < length:
        if plan.in_order:
            following = (at + 1) % len(places)
            travelled += float(np.hypot(*(places[following] - places[at])))
            at = following
            yield places[at]
            continue
        left = [index for index in range(len(places)) if index not in visited]
        if left and (len(visited) < 3 or rng.random() < 0.75):
            following = min(left, key=lambda index: float(np.hypot(*(places[index] - places[at]))))
        else:
            following = int(rng.choice([index for index in visited if index != at] or [at]))
        travelled += float(np.hypot(*(places[following] - places[at])))
        at = following
        visited.append(at)
        yield places[at]
    yield places[0]


def drive(plan: FloorPlan, length: float, rng: np.random.Generator, upset: Optional[Upset] = None) -> Drive:
    """Drive a tour through a building; now and then, and once half-way, the robot turns on the spot.

    Parameters
    ----------
    plan : FloorPlan
    length : float
        Least distance [m], as the crow flies between the places.
    rng : numpy.random.Generator
    upset : Upset, optional
        Half-way, after a turn on the spot.

    Returns
    -------
    Drive

    Raises
    ------
    StuckError
        If the building has fewer than two places that are connected, or the robot gets stuck.
    """
    if len(plan.places) < 2:
        raise StuckError("the building %s has %d places to visit; expected at least 2" % (plan.name, len(plan.places)))
    space = FreeSpace(plan)
    driver = Driver(plan, np.array([*plan.places[0], rng.uniform(-math.pi, math.pi)]), int(rng.integers(2 ** 31)))
    reached, stuck, turned = {tuple(plan.places[0])}, 0, False
    middle = length * rng.uniform(*MIDDLE)
    for place in tour(plan, length, rng):
        try:
            corners = space.path(driver.pose[:2], place)
        except NoPathError:
            continue                    # furniture may close a room
        try:
            driver.follow(corners)
            reached.add(tuple(place))
            full = float(rng.choice([-2.0, 2.0])) * math.pi
            if not turned and driver.travelled >= middle:
                turned = True
                driver.spin(full)
                if upset is not None:
                    driver.upset(upset)
            elif rng.random() < SPIN_SHARE:
                driver.spin(full)
        except StuckError:
            stuck += 1
            if stuck > STUCK_MOST:
                break
            driver.back_off()
    if len(reached) < 2:
        raise StuckError("no other place of the building %s can be reached from the first" % plan.name)
    return driver.record()
