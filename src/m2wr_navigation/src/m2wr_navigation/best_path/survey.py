# SPDX-License-Identifier: BSD-3-Clause
"""What is known of the world: a grid of free, occupied and unknown cells, filled by scans at known poses.

The odometry of the simulated robot is exact, and so are the poses.
"""
from __future__ import annotations

import math
import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Deque, Optional, Sequence, Tuple

import numpy as np

from m2wr_navigation.best_path.track import OUTLINE
from m2wr_navigation.costmap import footprint, footprint_kernels, obstacle_kernels
from m2wr_navigation.costmap.cost_layout import FREE, LETHAL, NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.inflation_kernels import cost_table, inflate
from m2wr_navigation.costmap.layer import no_bounds
from m2wr_navigation.costmap.observation import SOURCE_PARAMETERS, scan_points
from m2wr_navigation.parameters import read
from motion_plan.body import AXLE_X, LASER_X, TURNING_RADIUS

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int8Array, Vector

RESOLUTION = 0.05           # m
INFLATION, SCALING = 1.2, 3.0           # m, 1/m: of the costs around obstacles
MOVED, TURNED, WAITED = 0.1, 0.1, 0.5   # m, rad, s: a scan is added after this much has changed
TILTED = 0.01               # rad: the laser of a robot that pitches more sees the floor, or over walls: 0.1 m in 10 m
RECENT = 3                  # inclinations before a scan that count
MOST_CELLS = 4000           # along a side
_VALUES = read(SOURCE_PARAMETERS, {"obstacle_range": 9.9, "raytrace_range": 10.0}, "")[0]


class Survey:
    """A grid of what the laser has seen.

    Parameters
    ----------
    size : float
        Side [m].
    middle : (2,) float
        [m]
    frame : str
        Of the odometry.

    Attributes
    ----------
    costs : Costmap
        FREE, LETHAL and NO_INFORMATION.
    version : int
        Increases with each scan.
    """

    def __init__(self, size: float, middle: Vector, frame: str = "odom") -> None:
        cells = min(int(math.ceil(size / RESOLUTION)), MOST_CELLS)
        # corners on whole cells, so that maps of different runs fit
        corner = np.floor(np.array([middle[0], middle[1]]) / RESOLUTION - 0.5 * cells) * RESOLUTION
        self.costs = Costmap.filled((cells, cells), RESOLUTION, corner, NO_INFORMATION, frame)
        self.version = 0
        self._lock = threading.Lock()       # a scan clears cells before it marks them: no thread may read in between
        self._tilts: Deque[float] = deque(maxlen=RECENT)
        self._last: Optional[Tuple[float, float, float, float]] = None

    def seed(self, cells: Int8Array, resolution: float, origin: Vector) -> None:
        """Take what a map knows.

        Parameters
        ----------
        cells : (H, W) int8
            -1 unknown, 0 free, 100 occupied; row 0 at the least y.
        resolution : float
            [m]
        origin : (2,) float
            Corner of cell (0, 0) [m].
        """
        own = self.costs
        rows, columns = (np.arange(count) for count in own.shape)
        take = np.floor((own.origin[1] + (rows + 0.5) * own.resolution - origin[1]) / resolution).astype(int)
        across = np.floor((own.origin[0] + (columns + 0.5) * own.resolution - origin[0]) / resolution).astype(int)
        inside = ((take >= 0) & (take < cells.shape[0]))[:, None] & ((across >= 0) & (across < cells.shape[1]))[None]
        found = cells[np.clip(take, 0, cells.shape[0] - 1)[:, None], np.clip(across, 0, cells.shape[1] - 1)[None]]
        own.costs[inside & (found == 0)] = FREE
        own.costs[inside & (found > 50)] = LETHAL
        self.version += 1

    def occupancy(self) -> Int8Array:
        """Return the grid (H, W) as int8: -1 unknown, 0 free, 100 occupied."""
        table = np.zeros(256, np.int8)
        table[LETHAL], table[NO_INFORMATION] = 100, -1
        found: Int8Array = table[self.snapshot().costs]
        return found

    @property
    def known_area(self) -> float:
        """Area of the free and occupied cells [m^2]."""
        return self.costs.known_area

    def incline(self, orientation: Sequence[float]) -> None:
        """Take note of the robot's inclination: scans of a robot that pitches are not added.

        Parameters
        ----------
        orientation : (4,) sequence of float
            Of link_chassis: quaternion x, y, z, w.
        """
        x, y = float(orientation[0]), float(orientation[1])
        self._tilts.append(math.acos(min(1.0, max(-1.0, 1.0 - 2.0 * (x * x + y * y)))))

    def add(self, now: float, pose: Vector, scan: Any) -> bool:
        """Take a scan, if the robot has moved or some time has passed; return whether it was taken.

        Parameters
        ----------
        now : float
            [s]
        pose : (3,) float
            Of link_chassis when the scan was taken [m, m, rad].
        scan : object
            With ranges, angle_min, angle_increment, range_min and range_max.

        Returns
        -------
        bool

        Raises
        ------
        ObservationError
            If the scan's geometry cannot be used.
        """
        x, y, yaw = float(pose[0]), float(pose[1]), float(pose[2])
        if not all(map(math.isfinite, (x, y, yaw))) or max(self._tilts, default=0.0) > TILTED:
            return False
        if self._last is not None:
            since, old_x, old_y, old_yaw = self._last
            if math.hypot(x - old_x, y - old_y) < MOVED and abs(math.remainder(yaw - old_yaw, 2 * math.pi)) < TURNED \
                    and 0.0 <= now - since < WAITED:
                return False
        points, free = scan_points(scan.ranges, scan.angle_min, scan.angle_increment,
                                   (scan.range_min, scan.range_max), _VALUES)
        self._last = (now, x, y, yaw)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        sensor = np.array([x + LASER_X * cosine, y + LASER_X * sine, 0.0])
        points, free = points.dot(rotation.T) + sensor, free.dot(rotation.T) + sensor
        with self._lock:
            self._draw(points, free, sensor, float(scan.angle_increment))
            self._free_below(np.array([x + AXLE_X * cosine, y + AXLE_X * sine, yaw]))
            self.version += 1
        return True

    def _draw(self, points: FloatArray, free: FloatArray, sensor: FloatArray, increment: float) -> None:
        grid, bounds = self.costs, no_bounds()
        walls = obstacle_kernels.surface_cells(grid.costs, grid.resolution, grid.origin, points, sensor,
                                               _VALUES["obstacle_range"], increment)
        for ends in (points, free):
            obstacle_kernels.clear(grid.costs, grid.resolution, grid.origin, ends, sensor, _VALUES["raytrace_range"],
                                   bounds)
        grid.costs[walls[:, 0], walls[:, 1]] = LETHAL
        obstacle_kernels.mark(grid.costs, grid.resolution, grid.origin, points, sensor, _VALUES["obstacle_range"],
                              -1.0, 1.0, bounds)

    def _free_below(self, axle: FloatArray) -> None:
        """Take the unknown cells below the robot as free: it is there."""
        grid = self.costs
        under = np.zeros(grid.shape, np.uint8)
        footprint_kernels.fill_polygon(under, grid.resolution, grid.origin, footprint.placed(OUTLINE, axle), 1)
        grid.costs[(under == 1) & (grid.costs == NO_INFORMATION)] = FREE

    def snapshot(self) -> Costmap:
        """Return a copy of the grid, between two scans."""
        with self._lock:
            return self.costs.copy()

    def inflated(self) -> Costmap:
        """Return a costmap in which the disc around the axle is free at every heading; unknown cells stay unknown."""
        costmap = self.snapshot()
        cells = int(math.ceil(INFLATION / costmap.resolution))
        table = cost_table(cells, costmap.resolution, TURNING_RADIUS, SCALING)
        inflate(costmap.costs, table, cells, 0, costmap.rows, 0, costmap.columns, False)
        return costmap
