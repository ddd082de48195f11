# SPDX-License-Identifier: BSD-3-Clause
"""The layer of obstacles that sensors see."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Tuple

import numpy as np

from m2wr_navigation.costmap import footprint, footprint_kernels, grid_kernels, obstacle_kernels
from m2wr_navigation.costmap.cost_layout import FREE, NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.layer import Layer, Window, no_bounds
from m2wr_navigation.costmap.shift import shifted
from m2wr_navigation.parameters import Parameter, flag, text

if TYPE_CHECKING:
    from m2wr_navigation.costmap.observation import Observation, Source
    from m2wr_node.array_types import FloatArray, IndexArray

OVERWRITE, MAXIMUM = 0, 1           # values of combination_method


class ObstacleLayer(Layer):
    """``costmap_2d::ObstacleLayer``: rays clear cells, then points mark them.

    Attributes
    ----------
    sources : dict of str to Source
        By name. The node adds observations to them.
    """

    PARAMETERS = {
        "enabled": flag(True, "whether the layer is used"),
        "observation_sources": text("", "names of the sensors, separated by spaces"),
        "track_unknown_space": flag(False, "whether cells that no sensor has seen are unknown", False),
        "transform_tolerance": Parameter(0.2, "s", 0.0, 10.0, "how long a message waits for its transform", False),
        "max_obstacle_height": Parameter(2.0, "m", 0.0, 50.0, "higher points are ignored"),
        "footprint_clearing_enabled": flag(True, "whether the cells below the robot are free"),
        "combination_method": Parameter(1, "", 0, 99, "0 replaces costs, 1 raises them, 99 does nothing"),
    }
    HOLDS_OBSTACLES = True

    def __init__(self, name: str, values: Mapping[str, Any]) -> None:
        super().__init__(name, values)
        self.sources: Dict[str, Source] = {}
        self._grid = Costmap.filled((0, 0), 1.0, (0.0, 0.0), self._default)
        self._footprint: FloatArray = np.zeros((0, 2))
        self._cleared = Window.empty()

    @property
    def _default(self) -> int:
        return NO_INFORMATION if self.values["track_unknown_space"] else FREE

    @property
    def costs(self) -> Costmap:
        """The layer's own grid."""
        return self._grid

    def set_footprint(self, corners: FloatArray) -> None:
        self._footprint = np.array(corners, float)

    def match(self, master: Costmap) -> None:
        self._grid = Costmap.filled(master.shape, master.resolution, master.origin, self._default, master.frame)

    def shift(self, rows: int, columns: int) -> None:
        self._grid = shifted(self._grid, rows, columns, self._default)

    def update_window(self, master: Costmap, pose: FloatArray, window: Window, now: float) -> Window:
        changed, self._cleared = self._cleared, Window.empty()
        if not self.enabled:
            return window.union(changed)
        bounds = no_bounds()
        seen = [(source, observation) for source in self.sources.values() for observation in source.current(now)]
        for source, observation in seen:
            if source.values["clearing"]:
                self._free(source, observation, bounds)
        for source, observation in seen:
            if source.values["marking"]:
                self._mark(source, observation, bounds)
        if self.values["footprint_clearing_enabled"] and len(self._footprint):
            changed = changed.union(self._vacate(footprint.placed(self._footprint, pose)))
        return window.union(changed).union(Window.of(bounds))

    def _free(self, source: Source, observation: Observation, bounds: IndexArray) -> None:
        """Clear what the rays of an observation go through; grow bounds (4,) by the changes."""
        grid = self._grid
        for ends in (observation.points, observation.free_ends):
            obstacle_kernels.clear(grid.costs, grid.resolution, grid.origin, ends, observation.sensor,
                                   source.values["raytrace_range"], bounds)

    def _mark(self, source: Source, observation: Observation, bounds: IndexArray) -> None:
        """Mark what an observation shows; grow bounds (4,) by the changes."""
        grid = self._grid
        obstacle_kernels.mark(grid.costs, grid.resolution, grid.origin, observation.points, observation.sensor,
                              source.values["obstacle_range"], *self._height_limits(source), bounds)

    def _height_limits(self, source: Source) -> Tuple[float, float]:
        """Return the least and the greatest height of points of a source that mark [m]."""
        return source.values["min_obstacle_height"], min(source.values["max_obstacle_height"],
                                                         self.values["max_obstacle_height"])

    def _vacate(self, corners: FloatArray) -> Window:
        """Free the cells below the robot, whose corners (K, 2) are in the costmap's frame [m]; return their window."""
        grid = self._grid
        footprint_kernels.fill_polygon(grid.costs, grid.resolution, grid.origin, corners, FREE)
        return self._around(corners)

    def _around(self, corners: FloatArray) -> Window:
        """Return the window of the cells around corners (K, 2) [m]."""
        cells = self._grid.cells(corners)
        (top, left), (bottom, right) = cells.min(0), cells.max(0)
        window = Window(int(top), int(bottom) + 1, int(left), int(right) + 1)
        whole = Window.whole(self._grid)
        return Window(max(window.top, 0), min(window.bottom, whole.bottom), max(window.left, 0),
                      min(window.right, whole.right))

    def update_costs(self, master: Costmap, window: Window) -> None:
        if not self.enabled or window.is_empty:
            return
        bounds = window.top, window.bottom, window.left, window.right
        if self.values["combination_method"] == MAXIMUM:
            grid_kernels.raise_to(master.costs, self._grid.costs, *bounds)
        elif self.values["combination_method"] == OVERWRITE:
            grid_kernels.overwrite(master.costs, self._grid.costs, *bounds)

    def clear(self, window: Window, inside: bool) -> int:
        """Forget the obstacles inside of a window, or all outside of it.

        Parameters
        ----------
        window : Window
        inside : bool

        Returns
        -------
        int
            Number of cells that were occupied.
        """
        for source in self.sources.values():
            source.clear()
        self._cleared = Window.whole(self._grid)
        return int(grid_kernels.forget(self._grid.costs, self._default, window.top, window.bottom, window.left,
                                       window.right, inside))

    def reset(self) -> None:
        self.clear(Window.whole(self._grid), True)

    def late(self, now: float) -> List[str]:
        """Return one sentence for each source that is silent, or whose messages cannot be used, for too long."""
        return [fault for fault in (source.fault(now) for source in self.sources.values()) if fault]
