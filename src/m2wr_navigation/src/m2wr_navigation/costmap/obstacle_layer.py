# SPDX-License-Identifier: BSD-3-Clause
"""The layer of obstacles that sensors see."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Mapping

import numpy as np

from m2wr_navigation.costmap import footprint, footprint_kernels, grid_kernels, obstacle_kernels
from m2wr_navigation.costmap.cost_layout import FREE, NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.layer import Layer, Window, no_bounds
from m2wr_navigation.costmap.shift import shifted
from m2wr_navigation.parameters import Parameter, flag, text

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray
    from m2wr_navigation.costmap.observation import Observation, Source

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
        grid, bounds = self._grid, no_bounds()
        seen = [(source.values, observation) for source in self.sources.values()
                for observation in source.current(now)]
        for values, observation in seen:
            if values["clearing"]:
                for ends in (observation.points, observation.free_ends):
                    obstacle_kernels.clear(grid.costs, grid.resolution, grid.origin, ends, observation.sensor,
                                           values["raytrace_range"], bounds)
        for values, observation in seen:
            if values["marking"]:
                self._mark(values, observation, bounds)
        if self.values["footprint_clearing_enabled"] and len(self._footprint):
            corners = footprint.placed(self._footprint, pose)
            footprint_kernels.fill_polygon(grid.costs, grid.resolution, grid.origin, corners, FREE)
            changed = changed.union(self._around(corners))
        return window.union(changed).union(Window.of(bounds))

    def _mark(self, values: Mapping[str, Any], observation: Observation, bounds: Any) -> None:
        obstacle_kernels.mark(
            self._grid.costs, self._grid.resolution, self._grid.origin, observation.points, observation.sensor,
            values["obstacle_range"], values["min_obstacle_height"],
            min(values["max_obstacle_height"], self.values["max_obstacle_height"]), bounds)

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
