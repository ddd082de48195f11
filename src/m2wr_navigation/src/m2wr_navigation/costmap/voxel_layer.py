# SPDX-License-Identifier: BSD-3-Clause
"""The layer of obstacles with their heights."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Set, Tuple

import numpy as np

from m2wr_navigation.costmap import footprint_kernels, grid_kernels, voxel_kernels
from m2wr_navigation.costmap.layer import Window, no_bounds
from m2wr_navigation.costmap.obstacle_layer import ObstacleLayer
from m2wr_navigation.costmap.shift import shifted_cells
from m2wr_navigation.costmap.voxel_columns import MOST_HEIGHTS
from m2wr_navigation.costmap.voxel_kernels import EMPTY_COLUMN, UNKNOWN_COLUMN
from m2wr_navigation.parameters import Parameter, flag

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_navigation.costmap.observation import Observation, Source
    from m2wr_node.array_types import FloatArray, IndexArray, Uint32Array

_GAP = 2.0                  # cells between the end of a ray and its point, as VoxelLayer::raytraceFreespace
_HEIGHTS = ("origin_z", "z_resolution", "z_voxels")


class VoxelLayer(ObstacleLayer):
    """``costmap_2d::VoxelLayer``: a column of voxels for each cell, so that a ray clears only what it goes through.

    Attributes
    ----------
    ray_ends : list of (float, (N, 3) float64)
        Of the last update: the stamp [s] of each observation that cleared, and where its rays ended [m].
    """

    PARAMETERS = {
        **ObstacleLayer.PARAMETERS,
        "origin_z": Parameter(0.0, "m", -50.0, 50.0, "z of the lowest voxel's lower face"),
        "z_resolution": Parameter(0.2, "m", 0.01, 50.0, "height of a voxel", refuses_below=True),
        "z_voxels": Parameter(10, "", 1, MOST_HEIGHTS, "voxels of a column", refuses_below=True),
        "unknown_threshold": Parameter(15, "", 0, MOST_HEIGHTS, "most unknown voxels of a free column"),
        "mark_threshold": Parameter(0, "", 0, MOST_HEIGHTS, "most marked voxels of a column that is no obstacle"),
        "publish_voxel_map": flag(False, "whether voxel_grid is published", False),
    }

    def __init__(self, name: str, values: Mapping[str, Any]) -> None:
        super().__init__(name, values)
        self.ray_ends: List[Tuple[float, FloatArray]] = []
        self._columns: Uint32Array = np.zeros((0, 0), np.uint32)
        self._outside: Set[str] = set()         # sources of which it has been told that their sensor is outside
        self._check_top()

    @property
    def columns(self) -> Uint32Array:
        """The columns (H, W), see :mod:`m2wr_navigation.costmap.voxel_kernels`; changed by updates."""
        return self._columns

    @property
    def top(self) -> float:
        """Height of the upper face of the highest voxel [m]."""
        return float(self.values["origin_z"] + self.values["z_voxels"] * self.values["z_resolution"])

    @property
    def _box(self) -> FloatArray:
        return np.array([*self._grid.origin, self.values["origin_z"], self._grid.resolution,
                         self.values["z_resolution"]])

    @property
    def _rules(self) -> IndexArray:
        return np.array([self.values[name] for name in ("z_voxels", "mark_threshold", "unknown_threshold")], np.int64)

    def _check_top(self) -> None:
        limit = self.values["max_obstacle_height"]
        if limit > self.top + 1e-6:
            self.remarks.append(
                "max_obstacle_height is {:g} m, and {} voxels of {:g} m from {:g} m reach {:g} m; expected at least as "
                "much; higher points mark nothing".format(limit, self.values["z_voxels"], self.values["z_resolution"],
                                                          self.values["origin_z"], self.top))

    def configure(self, values: Mapping[str, Any]) -> None:
        before: Dict[str, Any] = self.values
        super().configure(values)
        if any(before[name] != self.values[name] for name in _HEIGHTS):
            self._columns.fill(UNKNOWN_COLUMN)
            self._grid.costs.fill(self._default)
        else:
            voxel_kernels.restate(self._columns, self._grid.costs, self._rules, no_bounds())
        if any(before[name] != self.values[name] for name in (*_HEIGHTS, "max_obstacle_height")):
            self._check_top()

    def match(self, master: Costmap) -> None:
        super().match(master)
        self._columns = np.full(master.shape, UNKNOWN_COLUMN, np.uint32)

    def shift(self, rows: int, columns: int) -> None:
        super().shift(rows, columns)
        self._columns = shifted_cells(self._columns, rows, columns, UNKNOWN_COLUMN)

    def update_window(self, master: Costmap, pose: FloatArray, window: Window, now: float) -> Window:
        self.ray_ends = []
        return super().update_window(master, pose, window, now)

    def _free(self, source: Source, observation: Observation, bounds: IndexArray) -> None:
        side, points, free_ends = self._grid.resolution, observation.points, observation.free_ends
        reach = math.ceil(source.values["raytrace_range"] / side - 1e-9) * side
        ends = np.empty((len(points) + len(free_ends), 3))
        rays = 0
        for seen, gap in ((points, _GAP * side), (free_ends, 0.0)):
            rays += voxel_kernels.clear(self._columns, self._grid.costs, self._box, self._rules, seen,
                                        observation.sensor, reach, gap, ends[rays:], bounds)
        self.ray_ends.append((observation.stamp, ends[:rays]))
        self._check_sensor(source, observation.sensor)

    def _check_sensor(self, source: Source, sensor: FloatArray) -> None:
        """Say once of each source that its rays begin outside."""
        low = np.array([*self._grid.origin, self.values["origin_z"]])
        high = np.array([*(self._grid.origin + self._grid.resolution * np.array(self._grid.shape[::-1])), self.top])
        if source.name not in self._outside and not ((low <= sensor) & (sensor < high)).all():
            self._outside.add(source.name)
            self.remarks.append(
                "the sensor of source {} is at ({:.2f}, {:.2f}, {:.2f}) m, outside of the voxels from ({:.2f}, {:.2f}, "
                "{:.2f}) to ({:.2f}, {:.2f}, {:.2f}) m; of its rays the part inside counts".format(
                    source.name, *sensor, *low, *high))

    def _mark(self, source: Source, observation: Observation, bounds: IndexArray) -> None:
        voxel_kernels.mark(self._columns, self._grid.costs, self._box, self._rules, observation.points,
                           observation.sensor, source.values["obstacle_range"], *self._height_limits(source), bounds)

    def _vacate(self, corners: FloatArray) -> Window:
        footprint_kernels.fill_polygon(self._columns, self._grid.resolution, self._grid.origin, corners, EMPTY_COLUMN)
        return super()._vacate(corners)

    def clear(self, window: Window, inside: bool) -> int:
        grid_kernels.forget(self._columns, UNKNOWN_COLUMN, window.top, window.bottom, window.left, window.right, inside)
        return super().clear(window, inside)
