# SPDX-License-Identifier: BSD-3-Clause
"""The map on which a robot is localized, with its distance fields."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional, Sequence, Tuple

import numpy as np

from m2wr_navigation.localization.field_kernels import distance_transform, quantise, visible_surface

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray, IndexArray, Int8Array, Uint8Array

OCCUPIED, FREE = 100, 0     # of an OccupancyGrid; all other values are unknown, as in amcl
MOST_CELLS = 10**9
FARTHEST = 1e7              # of the map's origin [m]


class MapError(ValueError):
    """A map cannot be used; the message says what was found and expected."""


class LocalizationMap:
    """A grid of free, occupied and unknown cells.

    Parameters
    ----------
    cells : (H, W) int8
        As in an OccupancyGrid; row 0 at the least y of the grid's own frame.
    resolution : float
        Side of a cell [m].
    origin : (3,) float
        Pose of the corner of cell (0, 0) in the map's frame: x, y [m], theta [rad]. A rotated map is used as it is.

    Attributes
    ----------
    free : (F,) int64
        Flat indices of the free cells.
    occupied : (H, W) bool
    """

    def __init__(self, cells: Int8Array, resolution: float, origin: Sequence[float]) -> None:
        self.cells, self.resolution = cells, float(resolution)
        self.origin = tuple(float(value) for value in origin)
        self.free: IndexArray = np.flatnonzero(cells == FREE)
        self.occupied: BoolArray = np.ascontiguousarray(cells == OCCUPIED)
        self._fields: Optional[Tuple[float, Uint8Array]] = None
        self._clear: Optional[Tuple[BoolArray, Float32Array]] = None

    @classmethod
    def from_message(cls, data: Int8Array, width: int, height: int, resolution: float,
                     origin: Sequence[float]) -> LocalizationMap:
        """Return the map of an OccupancyGrid's parts.

        Parameters
        ----------
        data : (H * W,) int8
        width, height : int
        resolution : float
            [m]
        origin : (3,) float
            x, y [m], theta [rad].

        Raises
        ------
        MapError
            If there are no free cells, or numbers that do not go together.
        """
        if width < 1 or height < 1 or width * height > MOST_CELLS or len(data) != width * height:
            raise MapError("it is {} x {} cells with {} values; expected 1 to {:g} cells and a value for each".format(
                width, height, len(data), MOST_CELLS))
        if not (math.isfinite(resolution) and resolution > 0.0):
            raise MapError("its resolution is {} m; expected a positive number".format(resolution))
        if not all(abs(value) <= FARTHEST for value in origin):
            raise MapError("its origin is {}; expected numbers up to {:g}".format(tuple(origin), FARTHEST))
        found = cls(np.asarray(data, np.int8).reshape(height, width), resolution, origin)
        if not len(found.free):
            raise MapError("none of its {} cells is free (0)".format(width * height))
        return found

    def to_grid(self, poses: FloatArray) -> FloatArray:
        """Return poses (N, 3) of the map's frame in the grid's: x, y [cells], theta [rad]."""
        x, y, theta = self.origin
        cos, sin = math.cos(theta), math.sin(theta)
        away = poses[:, :2] - (x, y)
        return np.column_stack([(cos * away[:, 0] + sin * away[:, 1]) / self.resolution,
                                (cos * away[:, 1] - sin * away[:, 0]) / self.resolution, poses[:, 2] - theta])

    def from_grid(self, poses: FloatArray) -> FloatArray:
        """Return poses (N, 3) of the grid's frame, x, y [cells], theta [rad], in the map's [m, m, rad]."""
        x, y, theta = self.origin
        cos, sin = math.cos(theta), math.sin(theta)
        along, up = poses[:, 0] * self.resolution, poses[:, 1] * self.resolution
        return np.column_stack([x + cos * along - sin * up, y + sin * along + cos * up, poses[:, 2] + theta])

    def fields(self, limit: float) -> Uint8Array:
        """Return distances to what a beam can hit (H, W, 4), in steps of ``limit`` / 255.

        The last axis is the quarter of the beam's direction, as for ``sensor_kernels.field_sums``. A beam ends at the
        side of an obstacle that it comes from. If the inside and the back of walls counted, poses that push the walls
        into the beams would fit as well. A quarter without any such surface has all occupied cells.

        Parameters
        ----------
        limit : float
            ``laser_likelihood_max_dist``, the greatest distance that is told apart [m].
        """
        if self._fields is None or self._fields[0] != limit:
            occupied, free = self.occupied, self.cells == FREE
            out, surface = np.empty(self.cells.shape + (4,), np.uint8), np.empty_like(occupied)
            distance, layer = np.empty(self.cells.shape, np.float32), np.empty(self.cells.shape, np.uint8)
            reach = limit / self.resolution
            for quarter in range(4):
                seen = visible_surface(occupied, free, not quarter & 1, not quarter & 2, surface)
                distance_transform(surface if seen else occupied, reach, distance)
                quantise(distance, reach / 255.0, layer)
                out[:, :, quarter] = layer
            self._fields = limit, out
        return self._fields[1]

    def clear_distance(self) -> Tuple[BoolArray, Float32Array]:
        """Return the cells that are not free (H, W), and the distance to the nearest one of them (H, W) [cells]."""
        if self._clear is None:
            blocked = self.cells != FREE
            out = np.empty(self.cells.shape, np.float32)
            distance_transform(blocked, float(sum(self.cells.shape)), out)
            self._clear = blocked, out
        return self._clear

    def random_poses(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return poses (count, 3) [m, m, rad] that are uniform over free space and headings.

        Parameters
        ----------
        count : int
        rng : numpy.random.Generator
        """
        cells = self.free[rng.integers(len(self.free), size=count)]
        rows, columns = np.divmod(cells, self.cells.shape[1])
        inside = rng.random((count, 2))
        return self.from_grid(np.column_stack([
            columns + inside[:, 0], rows + inside[:, 1], rng.uniform(-math.pi, math.pi, count)]))
