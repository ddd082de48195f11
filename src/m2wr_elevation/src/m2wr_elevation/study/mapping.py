# SPDX-License-Identifier: BSD-3-Clause
"""A robot in the simulator that maps the ground from its laser, wheels and IMU, without ROS."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_elevation.dead_reckoning import DeadReckoning, rotation_of
from m2wr_elevation.elevation_map import ElevationMap, MapSettings
from m2wr_elevation.message_arrays import without
from m2wr_elevation.slip import SlipMap
from m2wr_sim.geometry import compose, quaternion_from_rpy
from m2wr_sim.model.types import Noise, RayScan
from m2wr_sim.sensors.laser import LaserSensor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_campaign.terrain.relief import Grid
    from m2wr_sim.api import Sim

    Values = NDArray[np.float64]

PERIOD = 0.1                        # s between two clouds
AXLE = -0.12                        # m, of m2wr_rough
MOUNT = ((0.15, 0.0, 0.35), quaternion_from_rpy(0.0, 0.48, 0.0))        # of its laser
NEAR = 4.0                          # m around the robot in which errors count
_SCAN = RayScan(samples=181, min_angle=-0.5 * math.pi, max_angle=0.5 * math.pi, vertical_samples=24,
                vertical_min_angle=-0.4, vertical_max_angle=0.4, range_min=0.2, range_max=8.0,
                noise=Noise("gaussian", 0.0, 0.01))


class Errors(NamedTuple):
    """Of the cells near the robot: RMS error [m] of their heights relative to the robot, and the known share."""

    rms: float
    share: float


class MappingRobot:
    """The sensors of m2wr_rough and its map.

    Parameters
    ----------
    sim : Sim
        With m2wr_rough at rest.
    settings : MapSettings, optional
    seed : int
        Of the noise of the laser.
    name : str, optional
        Of the robot; None: it is the only one.
    follow : bool
        Whether the map moves with the robot.
    """

    def __init__(self, sim: Sim, settings: Optional[MapSettings] = None, seed: int = 0, name: Optional[str] = None,
                 follow: bool = True) -> None:
        self.map = ElevationMap(settings or MapSettings(), follow)
        self._name = name or sim.robots[0]
        self.reckoning, self.slip = DeadReckoning(AXLE), SlipMap()
        self._sim, self._laser = sim, LaserSensor(_SCAN, np.random.default_rng(seed))
        heights = np.linspace(_SCAN.vertical_min_angle, _SCAN.vertical_max_angle, _SCAN.vertical_samples)
        flat, angles = np.cos(heights)[:, None], self._laser.angles
        self._directions = np.stack(np.broadcast_arrays(
            flat * np.cos(angles), flat * np.sin(angles), np.sin(heights)[:, None]), axis=-1).reshape(-1, 3)
        self._mount = rotation_of(MOUNT[1])
        start = sim.pose(self._name)
        self.reckoning.orient(start[1])
        self.reckoning.shift(np.asarray(start[0]) - self.reckoning.position)

    def look(self, left_out: Sequence[Tuple[float, float]] = ()) -> None:
        """Take odometry, orientation and a cloud into the map.

        Parameters
        ----------
        left_out : sequence of (float, float)
            Places of other robots in the map's frame, which are no ground [m].
        """
        pose = self._sim.pose(self._name)
        odometry = self._sim.drive(self._name).odometry
        self.reckoning.orient(pose[1])
        wheels = self.reckoning.travel(*odometry.pose) if odometry is not None else 0.0
        self._sim.simulator.refresh_scene()
        ranges, _ = self._laser.cast(self._sim.simulator.scene, compose(pose, MOUNT), self._name)
        ranges = np.asarray(ranges, float).ravel()
        points = self._directions * np.where(ranges < _SCAN.range_max, ranges, np.nan)[:, None]
        rotation = self.reckoning.rotation @ self._mount
        if left_out:
            points = without(points, rotation, self.reckoning.position, left_out)
        self.map.move(*self.reckoning.position[:2])
        ahead = self.reckoning.rotation @ np.asarray(MOUNT[0])
        self.reckoning.shift(self.map.offset(points, rotation, self.reckoning.position + ahead))
        self.slip.travel(wheels, self.reckoning.axle, self.reckoning.rotation[:, 0])
        self.map.add(points, rotation, self.reckoning.position + ahead, self.reckoning.position)

    def errors(self, grid: Grid, heights: Values) -> Errors:
        """Compare the map near the robot with the true ground, both relative to the robot.

        Parameters
        ----------
        grid : Grid
        heights : (samples, samples) float64
            True heights [m].

        Returns
        -------
        Errors
        """
        cell, side = self.map.settings.cell, self.map.height.shape[0]
        corner, here, true = self.map.corner, self.reckoning.position, self._sim.pose()[0]
        x = corner[0] + (np.arange(side)[None, :] + 0.5) * cell - here[0] + np.zeros((side, 1))
        y = corner[1] + (np.arange(side)[:, None] + 0.5) * cell - here[1] + np.zeros((1, side))
        ground = interpolated(grid, heights, x + true[0], y + true[1]) - true[2]
        near = np.hypot(x, y) < NEAR
        known = near & np.isfinite(self.map.height) & np.isfinite(ground)
        gap = (self.map.height - here[2] - ground)[known]
        return Errors(float(np.sqrt(np.mean(gap ** 2))), float(known.sum() / near.sum()))


def interpolated(grid: Grid, heights: Values, x: Values, y: Values) -> Values:
    """Return heights at places, bilinear between samples; nan outside.

    Parameters
    ----------
    grid : Grid
    heights : (samples, samples) float64
        Rows against y [m].
    x, y : arrays of one shape
        [m]
    """
    across, down = (x + 0.5 * grid.size) / grid.cell, (0.5 * grid.size - y) / grid.cell
    inside = (across >= 0.0) & (across <= grid.samples - 1) & (down >= 0.0) & (down <= grid.samples - 1)
    column = np.clip(across.astype(int), 0, grid.samples - 2)
    row = np.clip(down.astype(int), 0, grid.samples - 2)
    u, v = across - column, down - row
    found = (heights[row, column] * (1 - u) * (1 - v) + heights[row, column + 1] * u * (1 - v)
             + heights[row + 1, column] * (1 - u) * v + heights[row + 1, column + 1] * u * v)
    return np.where(inside, found, np.nan)


def cell_of(elevation: ElevationMap, x: float, y: float) -> Tuple[int, int]:
    """Return row and column of a place, the nearest ones of the map where it is outside.

    Parameters
    ----------
    elevation : ElevationMap
    x, y : float
        [m]
    """
    side, cell = elevation.height.shape[0], elevation.settings.cell
    return (int(np.clip((y - elevation.corner[1]) // cell, 0, side - 1)),
            int(np.clip((x - elevation.corner[0]) // cell, 0, side - 1)))
