# SPDX-License-Identifier: BSD-3-Clause
"""One drive straight ahead over rough ground, and how it ended."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_campaign.terrain.measures import measures_of
from m2wr_campaign.terrain.relief import PATCHES, Grid, heights_of, patch_cells, triangles_of
from m2wr_sim.api import Sim
from m2wr_sim.geometry import matrix_from_quaternion
from m2wr_sim.model.types import Collision, Heightmap, Link, Mesh, Model, Surface, World

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose

REACHED, TIPPED, SLIPPED, STUCK = OUTCOMES = ("reached", "tipped", "slipped", "stuck")
SPEED = 0.3                 # m/s
DISTANCE = 5.0              # m, from the start
TURN = 1.5                  # rad/s of command for each radian off the heading
TILT = math.radians(60.0)   # from which a robot has tipped
PATIENCE = 5.0              # s without coming nearer by PROGRESS
PROGRESS = 0.1              # m
LIMIT = 120.0               # s
SPINNING = 0.5              # of the commanded distance: wheels that turn more than that while the robot stays do slip
_PERIOD = 0.1               # s between two looks
_DROP = 0.5                 # m above the ground, from which a robot is let down
_STEP = 0.005               # s of the simulation


class Drive(NamedTuple):
    """How a drive ended: one of OUTCOMES, after which distance [m] and time [s]; the greatest tilt [rad]."""

    outcome: str
    distance: float
    time: float
    tilt: float


def world_of(grid: Grid, heights: NDArray[np.float64], friction: float = 1.0) -> World:
    """Return a world with a heightmap alone.

    Parameters
    ----------
    grid : Grid
    heights : (samples, samples) float64
        [m]
    friction : float
        Coefficient.
    """
    field = Heightmap(np.ascontiguousarray(heights), (grid.size, grid.size))
    ground = Collision("ground", field, surface=Surface(mu=friction, mu2=friction))
    return World("rough", (Model("ground", (Link("link", collisions=(ground,)),), static=True),))


def patched_world(grid: Grid, heights: NDArray[np.float64], which: NDArray[np.int64], names: Sequence[str]) -> World:
    """Return a world with ground alone: a heightmap, or where there are patches a mesh for each friction.

    Parameters
    ----------
    grid : Grid
    heights : (samples, samples) float64
        [m]
    which : (samples - 1, samples - 1) int64
        See :func:`m2wr_campaign.terrain.relief.patches_of`.
    names : sequence of str
        Of the patches from 1 on.
    """
    if not which.any():
        return world_of(grid, heights)
    x, y = grid.places
    points = np.stack((x, y, heights), -1).reshape(-1, 3)
    corner = np.arange(len(points)).reshape(heights.shape)
    parts = []
    for name, chosen in patch_cells(which, names):
        triangles = triangles_of(corner, chosen)
        used, numbers = np.unique(triangles, return_inverse=True)
        mesh = Mesh(points[used], numbers.reshape(-1, 3).astype(np.int32), name)
        parts.append(Collision(name, mesh, surface=Surface(mu=PATCHES[name], mu2=PATCHES[name])))
    return World("rough", (Model("ground", (Link("link", collisions=tuple(parts)),), static=True),))


def tilt_of(pose: Pose) -> float:
    """Return the angle between the z axis of a pose and the vertical [rad]."""
    return math.acos(max(-1.0, min(1.0, matrix_from_quaternion(pose[1])[2, 2])))


def heading_of(pose: Pose) -> float:
    """Return the heading of a pose [rad]."""
    matrix = matrix_from_quaternion(pose[1])
    return math.atan2(matrix[1, 0], matrix[0, 0])


class Watch:
    """Steers a robot straight ahead along x, and says how the drive ended.

    Parameters
    ----------
    radius : float
        Of the wheels [m].
    distance : float
        To drive [m].
    """

    def __init__(self, radius: float, distance: float = DISTANCE) -> None:
        self._radius, self._distance = radius, distance
        self._began: Optional[float] = None
        self._start = self._best = self._since = self._turned = self._most = 0.0

    @staticmethod
    def command(pose: Pose) -> Tuple[float, float]:
        """Return the velocity [m/s] and yaw rate [rad/s] that keep to the x axis."""
        return SPEED, max(-1.0, min(1.0, -TURN * (heading_of(pose) + 0.5 * pose[0][1])))

    def look(self, now: float, pose: Pose, wheels: float) -> Optional[Drive]:
        """Return how the drive ended, or None if it has not.

        Parameters
        ----------
        now : float
            Simulated time [s].
        pose : Pose
            True pose of the robot.
        wheels : float
            Mean angle of the driven wheels [rad].
        """
        if self._began is None:
            self._began, self._since, self._start, self._turned = now, now, pose[0][0], wheels
        along, tilt, time = pose[0][0] - self._start, tilt_of(pose), now - self._began
        self._most = max(self._most, tilt)
        if tilt > TILT:
            return Drive(TIPPED, along, time, self._most)
        if along >= self._distance:
            return Drive(REACHED, along, time, self._most)
        if along > self._best + PROGRESS:
            self._best, self._since, self._turned = along, now, wheels
        elif now - self._since > PATIENCE or time > LIMIT:
            spun = abs(wheels - self._turned) * self._radius
            outcome = SLIPPED if spun > SPINNING * SPEED * (now - self._since) else STUCK
            return Drive(outcome, along, time, self._most)
        return None


def drive(sim: Sim, distance: float = DISTANCE) -> Drive:
    """Drive along x until the distance is reached or the robot cannot continue.

    Parameters
    ----------
    sim : Sim
        With one robot, its wheels on level ground.
    distance : float
        [m]

    Returns
    -------
    Drive
    """
    period = round(_PERIOD / sim.step_size) * sim.step_size
    watch, ended = Watch(sim.drive().wheel_radius, distance), None
    while ended is None:
        ended = watch.look(sim.time, sim.pose(), float(np.mean(list(sim.joint_positions().values()))))
        sim.step(watch.command(sim.pose()), period)
    return ended


def on_relief(robot: str, reliefs: Dict[str, float], seed: int, friction: float = 1.0, size: float = 14.0,
              samples: int = 257) -> Dict[str, object]:
    """Drive a robot over ground made from reliefs; return outcome and measures of the ground as a row of a table.

    Parameters
    ----------
    robot : str
        Model file.
    reliefs : dict of str to float
        See :func:`m2wr_campaign.terrain.relief.heights_of`.
    seed : int
        Of the ground.
    friction : float
    size : float
        Of a side [m].
    samples : int
        Of a side, 2^n + 1.

    Returns
    -------
    dict of str to object
    """
    grid = Grid(samples, size)
    heights = heights_of(grid, reliefs, seed)
    row: Dict[str, object] = dict(measures_of(heights, grid.cell), robot=robot, seed=seed, friction=friction)
    with Sim(world_of(grid, heights, friction), robot, pose=(0.0, 0.0, _DROP, 0.0), sensing="off", step=_STEP) as sim:
        sim.step((0.0, 0.0), 1.0)
        found = drive(sim)
    return dict(row, **found._asdict())
