# SPDX-License-Identifier: BSD-3-Clause
"""Compile every kernel or load it from its cache: ``python3 -m m2wr_elevation.kernel_warm_up``."""
from __future__ import annotations

import numpy as np

from m2wr_elevation.elevation_map import ElevationMap, MapSettings
from m2wr_elevation.planning import cost_of, route
from m2wr_node.kernel_library import prepare


def compile_kernels() -> None:
    """Map a small piece of ground, move, and plan a way over it."""
    settings = MapSettings(size=2.0, cell=0.1)
    elevation = ElevationMap(settings)
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 40), np.linspace(-0.9, 0.9, 40))
    points = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, -1.0)))
    for place in (0.0, 0.1):
        elevation.move(place, 0.0)
        elevation.offset(points, np.eye(3), np.array((0.0, 0.0, 1.0)))
        elevation.add(points, np.eye(3), np.array((0.0, 0.0, 1.0)), np.zeros(3))
    route(cost_of(elevation.layers(), settings), (0, 0), (5, 5))


if __name__ == "__main__":
    prepare("m2wr_elevation", compile_kernels)
