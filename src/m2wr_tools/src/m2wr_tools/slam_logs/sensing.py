# SPDX-License-Identifier: BSD-3-Clause
"""Scans along a recorded drive: cast by the simulator's laser, with people, glass and an inaccurate mount."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, List, Tuple

import numpy as np

from m2wr_maps.se2 import compose
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Cylinder, Noise, RayScan
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.ray_scene import RayScene
from m2wr_tools.buildings.floor_plan import HEIGHT, upright
from m2wr_tools.buildings.free_path import FreeSpace, NoPathError

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray
    from m2wr_tools.buildings.floor_plan import FloorPlan
    from m2wr_tools.slam_logs.drive import Drive

MOUNT = (0.15, 0.0, 0.0)    # nominal pose of the laser in the base frame, of m2wr [m, m, rad]
LASER_HEIGHT = 0.15         # above the floor [m]
RANGE_MIN = 0.05            # [m]
#: A pane of glass reflects a laser back only near the perpendicular (Foster et al., VisAGGE: visible angle grid for
#: glass environments, ICRA 2013); the angle is assumed.
GLASS_ANGLE = math.radians(10.0)
PERSON_RADIUS, PERSON_SPEED = 0.2, 1.0      # [m], [m/s]
_PERSON_CLEARANCE = 0.3     # [m]
_STEP_ASIDE = 0.7           # people keep this distance from the robot's centre [m]


@dataclass(frozen=True)
class LaserErrors:
    """The laser and what disturbs it.

    Attributes
    ----------
    range_max : float
        [m]
    field : float
        Field of view, symmetric about the front [rad].
    beams : int
    noise : float
        Standard deviation of a range [m].
    mount : (3,) float
        Error of the mount: true pose in the nominal one [m, m, rad].
    people : int
        Number of people who walk about.
    """

    range_max: float = 30.0
    field: float = math.pi
    beams: int = 361
    noise: float = 0.01
    mount: Tuple[float, float, float] = (0.0, 0.0, 0.0)
    people: int = 0


class Person:
    """Walks from place to place.

    Parameters
    ----------
    plan : FloorPlan
    space : FreeSpace
    rng : numpy.random.Generator
    """

    def __init__(self, plan: FloorPlan, space: FreeSpace, rng: np.random.Generator) -> None:
        self._places, self._space, self._rng = plan.places, space, rng
        self.position = plan.places[int(rng.integers(len(plan.places)))].copy()
        self._corners: List[FloatArray] = []

    def walk(self, duration: float, robot: FloatArray) -> None:
        """Walk on, or wait while the robot is in the way.

        Parameters
        ----------
        duration : float
            [s]
        robot : (2,) float64
            Position of the robot [m].
        """
        left = PERSON_SPEED * duration
        while left > 1e-9:
            if not self._corners:
                goal = self._places[int(self._rng.integers(len(self._places)))]
                try:
                    self._corners = list(self._space.path(self.position, goal))
                except NoPathError:
                    return
            ahead = self._corners[0] - self.position
            distance = float(np.hypot(*ahead))
            share = min(1.0, left / distance) if distance > 0.0 else 1.0
            following = self.position + share * ahead
            if np.hypot(*(following - robot)) < _STEP_ASIDE:
                return
            self.position = following
            left -= share * distance
            if share == 1.0:
                self._corners.pop(0)


def scans(plan: FloorPlan, drive: Drive, every: int, errors: LaserErrors,
          rng: np.random.Generator) -> Tuple[IndexArray, Float32Array]:
    """Return the records (K,) at which scans were taken, and their ranges (K, beams) [m]; +inf where nothing is hit.

    Parameters
    ----------
    plan : FloorPlan
    drive : Drive
    every : int
        A scan is taken at each so many records.
    errors : LaserErrors
    rng : numpy.random.Generator
    """
    scene, glass_rows = _scene(plan)
    laser = LaserSensor(RayScan(samples=errors.beams, min_angle=-0.5 * errors.field, max_angle=0.5 * errors.field,
                                range_min=RANGE_MIN, range_max=errors.range_max,
                                noise=Noise("gaussian", stddev=errors.noise)), rng)
    people: List[Person] = []
    if errors.people:
        space = FreeSpace(plan, _PERSON_CLEARANCE)
        people = [Person(plan, space, rng) for _ in range(errors.people)]
    rows = [scene.add(Cylinder(PERSON_RADIUS, HEIGHT), upright(*person.position), "person_%d" % number)
            for number, person in enumerate(people)]
    taken = np.arange(0, len(drive.stamps), every)
    for begin, end in drive.carried:
        taken = taken[(taken <= begin) | (taken > end)]
    sensors = compose(compose(drive.poses[taken], np.array(MOUNT)), np.array(errors.mount))
    found = np.empty((len(taken), errors.beams), np.float32)
    for index, (record, pose) in enumerate(zip(taken, sensors)):
        if index:
            for person, row in zip(people, rows):
                person.walk(float(drive.stamps[record] - drive.stamps[taken[index - 1]]), drive.poses[record, :2])
                scene.set_pose(row, *upright(*person.position))
        found[index] = _cast(laser, scene, pose, plan, glass_rows)
    return taken, found


def _scene(plan: FloorPlan) -> Tuple[RayScene, IndexArray]:
    """Return the shapes of a building, panes of glass with laser_retro 1 + their number, and the panes' walls."""
    scene, panes = RayScene(), np.flatnonzero(plan.glass)
    retro = {"wall_%d" % wall: 1.0 + number for number, wall in enumerate(panes)}
    for name, shape, pose in plan.parts():
        scene.add(shape, pose, "glass" if name in retro else "solid", retro.get(name, 0.0))
    return scene, panes


def _cast(laser: LaserSensor, scene: RayScene, pose: FloatArray, plan: FloorPlan,
          panes: IndexArray) -> Float32Array:
    place = ((float(pose[0]), float(pose[1]), LASER_HEIGHT), quaternion_from_rpy(0.0, 0.0, float(pose[2])))
    ranges, hits = (values.copy() for values in laser.cast(scene, place))
    at_glass = np.flatnonzero(hits)
    if len(at_glass):
        walls = plan.walls[panes[hits[at_glass].astype(int) - 1]]
        along = np.arctan2(walls[:, 3] - walls[:, 1], walls[:, 2] - walls[:, 0])
        passes = at_glass[np.abs(np.sin(pose[2] + laser.angles[at_glass] - along)) < math.cos(GLASS_ANGLE)]
        if len(passes):
            ranges[passes] = laser.cast(scene, place, ignore_owner="glass")[0][passes]
    return ranges
