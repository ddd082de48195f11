# SPDX-License-Identifier: BSD-3-Clause
"""The layer that surrounds obstacles with costs."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping, Optional, Tuple

from m2wr_navigation.costmap import inflation_kernels
from m2wr_navigation.costmap.footprint import radii
from m2wr_navigation.costmap.layer import Layer, Window
from m2wr_navigation.parameters import Parameter, flag

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray, Uint8Array


class InflationLayer(Layer):
    """``costmap_2d::InflationLayer``."""

    PARAMETERS = {
        "enabled": flag(True, "whether the layer is used"),
        "inflation_radius": Parameter(0.55, "m", 0.0, 50.0, "distance from obstacles up to which cells have costs"),
        "cost_scaling_factor": Parameter(10.0, "1/m", 0.0, 100.0, "decrease of the costs with the distance"),
        "inflate_unknown": flag(False, "whether unknown cells get costs, too"),
    }

    def __init__(self, name: str, values: Mapping[str, Any]) -> None:
        super().__init__(name, values)
        self._inscribed = 0.0
        self._key: Tuple[float, ...] = ()
        self._table: Optional[Uint8Array] = None
        self._radius = 0
        self._before = Window.empty()

    def set_footprint(self, corners: FloatArray) -> None:
        self._inscribed = radii(corners)[0]

    def match(self, master: Costmap) -> None:
        self._before = Window.empty()

    def shift(self, rows: int, columns: int) -> None:
        self._before = Window.empty()           # the whole costmap is updated

    def _prepare(self, resolution: float) -> bool:
        """Make the table of costs; return whether it has changed."""
        key = (resolution, self._inscribed, self.values["inflation_radius"], self.values["cost_scaling_factor"])
        if key == self._key:
            return False
        # rounded up, as costmap_2d's cellDistance; the kernel's 16-bit numbers limit it, to 6 m with cells of 0.05 m
        self._radius = min(int(math.ceil(key[2] / resolution - 1e-9)), inflation_kernels.GREATEST_RADIUS)
        self._table = inflation_kernels.cost_table(self._radius, resolution, self._inscribed, key[3])
        self._key = key
        return True

    def update_window(self, master: Costmap, pose: FloatArray, window: Window, now: float) -> Window:
        if not self.enabled:
            return window
        if self._prepare(master.resolution):
            return Window.whole(master)
        grown = window.grown(self._radius, master)
        both, self._before = grown.union(self._before), grown
        return both

    def update_costs(self, master: Costmap, window: Window) -> None:
        if self.enabled and self._table is not None:
            inflation_kernels.inflate(master.costs, self._table, self._radius, window.top, window.bottom, window.left,
                                      window.right, self.values["inflate_unknown"])
