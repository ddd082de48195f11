# SPDX-License-Identifier: BSD-3-Clause
"""The layer of the map that a server publishes."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation.costmap import grid_kernels
from m2wr_navigation.costmap.cost_layout import NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.layer import Layer, Window
from m2wr_navigation.parameters import Parameter, flag, text

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int8Array

MOST_CELLS = 200000000      # of a map: 0.2 GB, and as much again for the master grid


class MapError(ValueError):
    """A map or an update of it cannot be used; the message says why."""


class StaticLayer(Layer):
    """``costmap_2d::StaticLayer``.

    The node hands maps and updates to :meth:`set_map` and :meth:`update_map`. In a rolling costmap it also keeps
    :attr:`map_from_costmap` current, the pose of the costmap's frame in the map's.
    """

    PARAMETERS = {
        "enabled": flag(True, "whether the layer is used"),
        "map_topic": text("map", "topic of the map"),
        "first_map_only": flag(False, "whether only the first map is used", False),
        "subscribe_to_updates": flag(False, "whether changes of the map are read from MAP_TOPIC_updates", False),
        "track_unknown_space": flag(True, "whether unknown cells stay unknown; otherwise they are free", False),
        "use_maximum": flag(False, "whether the layer only raises costs; otherwise it replaces them", False),
        "lethal_cost_threshold": Parameter(100, "", 0, 100, "least occupancy of an obstacle", False),
        "unknown_cost_value": Parameter(-1, "", -1, 255, "occupancy of an unknown cell", False),
        "trinary_costmap": flag(True, "whether there are only free, lethal and unknown cells", False),
    }

    def __init__(self, name: str, values: Mapping[str, Any]) -> None:
        super().__init__(name, values)
        self.map: Optional[Costmap] = None      # axis-aligned, in the frame of the map
        self.map_from_costmap: FloatArray = np.zeros(3)
        self._changed, self._turned = Window.empty(), False
        self._of_master: Optional[Costmap] = None
        self._seen_from: Tuple[float, ...] = ()

    def set_map(self, occupancy: Int8Array, resolution: float, origin: FloatArray, frame: str) -> None:
        """Take a map.

        Parameters
        ----------
        occupancy : (H, W) int8
            -1 unknown, 0 free to 100 occupied.
        resolution : float
            [m]
        origin : (3,) float64
            Pose of the corner of cell (0, 0) in the frame [m, m, rad]. A map with a yaw is resampled.
        frame : str

        Raises
        ------
        MapError
        """
        if occupancy.size == 0 or occupancy.size > MOST_CELLS:
            raise MapError("the map has {} x {} cells; expected 1 to {}".format(*occupancy.shape[::-1], MOST_CELLS))
        if not (math.isfinite(resolution) and resolution > 0.0 and np.isfinite(origin).all()):
            raise MapError("the map has the resolution {} m and the origin {}; expected finite numbers, the resolution "
                           "above 0".format(resolution, tuple(np.asarray(origin).tolist())))
        costs = np.empty(occupancy.shape, np.uint8)
        grid_kernels.translate(occupancy, self._table(), costs)
        straight = Costmap(costs, float(resolution), np.array(origin[:2], float), frame)
        self.map = straight if abs(origin[2]) < 1e-6 else _turned(straight, origin)
        self._turned = self.map is not straight
        self._changed = Window.whole(self.map)
        self._of_master, self._seen_from = None, ()

    def _table(self) -> Any:
        values = self.values
        return grid_kernels.cost_of_occupancy(
            max(1, values["lethal_cost_threshold"]), values["unknown_cost_value"], values["track_unknown_space"],
            values["trinary_costmap"])

    def update_map(self, occupancy: Int8Array, row: int, column: int) -> None:
        """Take a change of the map.

        Parameters
        ----------
        occupancy : (h, w) int8
        row, column : int
            Of its first cell in the map.

        Raises
        ------
        MapError
            If there is no map yet, it was resampled, or the change does not lie in it.
        """
        if self.map is None:
            raise MapError("a change of the map arrived before the map")
        if self._turned:
            raise MapError("changes of a map with a yaw are not supported; publish the whole map")
        rows, columns = occupancy.shape
        if row < 0 or column < 0 or row + rows > self.map.rows or column + columns > self.map.columns:
            raise MapError("a change of {} x {} cells at ({}, {}) is not within the map of {} x {}".format(
                columns, rows, column, row, self.map.columns, self.map.rows))
        costs = np.empty(occupancy.shape, np.uint8)
        grid_kernels.translate(np.ascontiguousarray(occupancy), self._table(), costs)
        window = Window(row, row + rows, column, column + columns)
        self.map.costs[window.slices] = costs
        self._changed = self._changed.union(window)
        self._seen_from = ()

    def match(self, master: Costmap) -> None:
        self._of_master, self._seen_from = None, ()
        if self.map is not None:
            self._changed = Window.whole(self.map)

    def shift(self, rows: int, columns: int) -> None:
        self._seen_from = ()

    def _is_aligned(self, master: Costmap) -> bool:
        """Whether cells of the master are cells of the map."""
        return self.map is not None and master.costs.shape == self.map.costs.shape \
            and abs(master.resolution - self.map.resolution) < 1e-9 \
            and bool(np.abs(master.origin - self.map.origin).max() < 1e-9) \
            and not np.abs(self.map_from_costmap).max() > 0.0

    def update_window(self, master: Costmap, pose: FloatArray, window: Window, now: float) -> Window:
        if self.map is None or not self.enabled:
            return window
        if self._is_aligned(master):
            changed, self._changed, self._of_master = self._changed, Window.empty(), self.map
            return window.union(changed)
        place = (*self.map_from_costmap, *master.origin)
        if place == self._seen_from and self._of_master is not None:
            return window
        if self._of_master is None or self._of_master is self.map \
                or self._of_master.costs.shape != master.costs.shape:
            self._of_master = master.copy()
        whole = Window.whole(master)
        grid_kernels.resample(
            self.map.costs, self.map.resolution, self._map_corner_from_costmap(), self._of_master.costs,
            master.resolution, master.origin, whole.top, whole.bottom, whole.left, whole.right)
        self._seen_from = place
        return whole

    def _map_corner_from_costmap(self) -> FloatArray:
        assert self.map is not None
        return self.map_from_costmap - np.array([self.map.origin[0], self.map.origin[1], 0.0])

    def update_costs(self, master: Costmap, window: Window) -> None:
        if self._of_master is None or not self.enabled or window.is_empty:
            return
        bounds = window.top, window.bottom, window.left, window.right
        if self.values["use_maximum"]:
            grid_kernels.raise_to(master.costs, self._of_master.costs, *bounds)
        elif self._of_master is self.map:
            master.costs[window.slices] = self._of_master.costs[window.slices]
        else:       # cells outside of the map are not written
            grid_kernels.overwrite(master.costs, self._of_master.costs, *bounds)


def _turned(straight: Costmap, origin: FloatArray) -> Costmap:
    """Return a map whose origin has a yaw, on an axis-aligned grid that holds all of it."""
    cosine, sine = math.cos(origin[2]), math.sin(origin[2])
    width, height = straight.columns * straight.resolution, straight.rows * straight.resolution
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]]) @ np.array(
        [[cosine, sine], [-sine, cosine]]) + origin[:2]
    low, high = corners.min(0), corners.max(0)
    columns, rows = (int(math.ceil(extent / straight.resolution - 1e-9)) for extent in high - low)
    if rows * columns > MOST_CELLS:
        raise MapError("the turned map needs {} x {} cells; expected at most {}".format(columns, rows, MOST_CELLS))
    turned = Costmap.filled((rows, columns), straight.resolution, low, NO_INFORMATION, straight.frame)
    inverse = np.array([-cosine * origin[0] - sine * origin[1], sine * origin[0] - cosine * origin[1], -origin[2]])
    grid_kernels.resample(straight.costs, straight.resolution, inverse, turned.costs, turned.resolution, turned.origin,
                          0, rows, 0, columns)
    return turned
