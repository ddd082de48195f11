# SPDX-License-Identifier: BSD-3-Clause
"""A drive as samples of time and pose, and the distances of the robot's outline from obstacles along it."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, List, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.localization.field_kernels import distance_transform
from m2wr_view.outlines import M2WR_FOOTPRINT, convex_hull
from motion_plan.body import AXLE_X

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

FARTHEST = 3.0              # m: distances from obstacles are not told apart beyond
SPACING = 0.04              # m between two points of the outline, less than a cell
AT_ONCE = 500               # poses whose outlines are looked up together


def _corners() -> FloatArray:
    corners: List[Tuple[float, float]] = []
    for part in M2WR_FOOTPRINT:
        for x, y in part.vertices.tolist():
            corners += [(x - AXLE_X + dx, y + dy) for dx in (-part.radius, part.radius)
                        for dy in (-part.radius, part.radius)]
    return convex_hull(corners)


#: Convex outline (K, 2) of m2wr, in the frame of its axle [m].
OUTLINE: FloatArray = _corners()
#: Half of its width [m].
HALF_WIDTH = float(np.abs(OUTLINE[:, 1]).max())


@dataclass(frozen=True)
class Track:
    """Samples of a drive.

    Attributes
    ----------
    stamps : (N,) float64
        [s], increasing; N >= 1.
    poses : (N, 3) float64
        Axle and heading [m, m, rad].
    goal : (2,) float64
        Where the drive was to end [m].
    """

    stamps: FloatArray
    poses: FloatArray
    goal: FloatArray

    @property
    def steps(self) -> FloatArray:
        """Lengths (N - 1,) between the samples [m]."""
        found: FloatArray = np.hypot(*np.diff(self.poses[:, :2], axis=0).T)
        return found

    @property
    def turns(self) -> FloatArray:
        """Angles (N - 1,) between the samples [rad]."""
        return np.arctan2(np.sin(np.diff(self.poses[:, 2])), np.cos(np.diff(self.poses[:, 2])))

    @property
    def length(self) -> float:
        """Length, and the rest to the goal in a straight line [m]."""
        return float(self.steps.sum() + np.hypot(*(self.poses[-1, :2] - self.goal)))

    @property
    def time(self) -> float:
        """Duration [s]."""
        return float(self.stamps[-1] - self.stamps[0])

    def then(self, other: Track) -> Track:
        """Return this track and another one that begins where it ends."""
        later = other.stamps - other.stamps[0] + self.stamps[-1]
        return Track(np.concatenate([self.stamps, later[1:]]), np.concatenate([self.poses, other.poses[1:]]),
                     other.goal)

    def thinned(self, period: float) -> Track:
        """Return the track with samples at least a period [s] apart; the first and the last are kept."""
        kept = [0]
        for k in range(1, len(self.stamps) - 1):
            if self.stamps[k] - self.stamps[kept[-1]] >= period - 1e-6:
                kept.append(k)
        if len(self.stamps) > 1:
            kept.append(len(self.stamps) - 1)
        return Track(self.stamps[kept], self.poses[kept], self.goal)


class ObstacleField:
    """Distances from the obstacles that are known.

    Parameters
    ----------
    costmap : Costmap
        Its lethal cells are the obstacles.
    """

    def __init__(self, costmap: Costmap) -> None:
        self._costmap = costmap
        self._distances = np.empty(costmap.shape, np.float32)
        distance_transform(costmap.costs == LETHAL, FARTHEST / costmap.resolution, self._distances)
        sides = np.roll(OUTLINE, -1, axis=0) - OUTLINE
        counts = np.ceil(np.hypot(*sides.T) / SPACING).astype(int)
        self._points = np.concatenate([corner + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * side
                                       for corner, side, count in zip(OUTLINE, sides, counts)])

    def distances(self, points: FloatArray) -> FloatArray:
        """Return the distances (N,) of points from obstacles [m]; FARTHEST off the grid.

        Parameters
        ----------
        points : (N, 2) float64
            [m]
        """
        cells = self._costmap.cells(points)
        inside = ((cells >= 0) & (cells < self._costmap.shape)).all(-1)
        found = np.full(len(points), FARTHEST)
        found[inside] = self._distances[cells[inside, 0], cells[inside, 1]].astype(float) * self._costmap.resolution
        return found

    def clearance(self, track: Track) -> float:
        """Return the least distance of m2wr's outline from an obstacle [m], to half a cell; FARTHEST if none is near.

        Parameters
        ----------
        track : Track
        """
        least = FARTHEST
        for first in range(0, len(track.poses), AT_ONCE):
            x, y, yaw = track.poses[first:first + AT_ONCE].T[:, :, None]
            a, b = self._points.T[:, None, :]
            points = np.stack([x + np.cos(yaw) * a - np.sin(yaw) * b, y + np.sin(yaw) * a + np.cos(yaw) * b], -1)
            least = min(least, float(self.distances(points.reshape(-1, 2)).min()))
        return least
