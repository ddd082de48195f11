# SPDX-License-Identifier: BSD-3-Clause
"""Map of what a laser has seen on the way, in the odometry frame: distances to obstacles, and the cost to the goal."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional

import numpy as np

from m2wr_navigation.costmap import obstacle_kernels
from m2wr_navigation.costmap.cost_layout import FREE, LETHAL
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.layer import no_bounds
from m2wr_navigation.costmap.shift import shifted
from m2wr_navigation.localization.field_kernels import distance_transform
from m2wr_navigation.methods.map_kernels import border_target, shade
from m2wr_navigation.planners import wave_kernels

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody
    from m2wr_navigation.methods.scan_points import ScanPoints
    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray, Vector

SHARE_INSIDE = 0.2          # of the side: the map moves when the robot is nearer to its edge
BLOCKED = 200.0             # cost of a place where the robot does not fit, against 1 of a free one: such a place is
#                             passed in no detour of less than 200 times its depth, and no goal is without a way
FARTHEST = 1e6              # cells: a goal farther away counts as so far
NARROW = 8.0                # greatest cost added where the robot fits but cannot turn


class LocalMap:
    """A square grid that moves with the robot and keeps the obstacles that were seen.

    Parameters
    ----------
    body : RobotBody
    side : float
        Of the square [m].
    resolution : float
        Side of a cell [m].
    reach : float
        Readings beyond this are not entered; beams clear up to it [m].
    clearance : float
        Places farther from obstacles than this, from the axle, are the cheapest [m].

    Attributes
    ----------
    grid : Costmap
        LETHAL: an obstacle.
    distance : (H, W) float32
        From each cell's centre to the nearest obstacle, up to ``clearance`` [m].
    to_goal : (H / 2, W / 2) float32
        Length of the way to the goal, longer near obstacles, of cells of twice the side [m].
    """

    def __init__(self, body: RobotBody, side: float, resolution: float, reach: float, clearance: float) -> None:
        self._body, self._reach, self._clearance = body, reach, clearance
        half = int(math.ceil(0.5 * side / resolution))
        cells = 2 * half
        self.grid = Costmap.filled((cells, cells), resolution, (0.0, 0.0), FREE, "odom")
        self._placed = False
        self.distance: Float32Array = np.full((cells, cells), clearance, np.float32)
        self.to_goal: Float32Array = np.zeros((half, half), np.float32)
        self._shades = np.zeros((half, half), np.uint8)
        self._table = self._costs()

    @property
    def corner(self) -> FloatArray:
        """Of cell (0, 0): x, y, and the side of a cell of ``distance`` [m]."""
        return np.array([self.grid.origin[0], self.grid.origin[1], self.grid.resolution])

    def _costs(self) -> Float32Array:
        """Return the cost (256,) of the shades of distance: 1 for 0, the farthest."""
        away = self._clearance * (1.0 - np.arange(256) / 255.0)
        inner = self._body.inscribed_radius
        share = np.clip((self._clearance - away) / max(self._clearance - inner, 1e-6), 0.0, 1.0)
        return np.where(away < inner, BLOCKED, 1.0 + NARROW * share ** 2).astype(np.float32)

    def _follow(self, x: float, y: float) -> None:
        """Move the grid so that the robot is well inside."""
        grid = self.grid
        side = grid.resolution * grid.shape[0]
        away = np.array([x, y]) - grid.origin - 0.5 * side
        if not self._placed or np.abs(away).max() > side:           # a teleport
            origin = np.floor(np.array([x - 0.5 * side, y - 0.5 * side]) / grid.resolution) * grid.resolution
            self.grid = Costmap.filled(grid.shape, grid.resolution, origin, FREE, grid.frame)
            self._placed = True
            return
        if np.abs(away).max() > (0.5 - SHARE_INSIDE) * side:
            columns, rows = np.rint(away / grid.resolution).astype(int).tolist()
            self.grid = shifted(grid, rows, columns, FREE)

    def look(self, scan: ScanPoints, moving: Optional[BoolArray] = None) -> None:
        """Enter a scan, and compute the distances.

        Parameters
        ----------
        scan : ScanPoints
        moving : (N,) bool, optional
            Points that are not entered, for what is there moves on.
        """
        self._follow(float(scan.laser[0]), float(scan.laser[1]))
        hits = scan.hits if moving is None else scan.hits & ~moving
        ends, place = np.zeros((len(scan.ends), 3)), np.array([scan.laser[0], scan.laser[1], 0.0])
        ends[:, :2] = scan.ends
        grid, bounds = self.grid, no_bounds()
        obstacle_kernels.clear(grid.costs, grid.resolution, grid.origin, ends, place, self._reach, bounds)
        obstacle_kernels.mark(grid.costs, grid.resolution, grid.origin, ends[hits], place, math.inf, 0.0, 0.0, bounds)
        distance_transform(grid.costs == LETHAL, self._clearance / grid.resolution, self.distance)
        self.distance *= grid.resolution

    def aim(self, goal: Vector) -> None:
        """Compute the way to the goal from each cell; a goal outside is replaced by the nearest cell of the edge.

        Parameters
        ----------
        goal : (2,) float
            [m]
        """
        grid, side = self.grid, 2.0 * self.grid.resolution
        shade(self.distance, self._clearance, self._shades)
        cells = np.clip((np.asarray(goal[:2], float) - grid.origin) / side, -FARTHEST, FARTHEST)
        target = border_target(self._shades, float(cells[1]), float(cells[0]))
        self.to_goal.fill(np.inf)
        wave_kernels.wave(self._shades, self._table, target, (-1, -1), self.to_goal, np.zeros((0, 0), np.uint8), True)
        rest = max(0.0, math.hypot(*(cells - (target[1] + 0.5, target[0] + 0.5))) - 1.0)
        self.to_goal += np.float32(rest)
        self.to_goal *= np.float32(side)
