# SPDX-License-Identifier: BSD-3-Clause
"""Nothing is compiled once the kernels are warm, so that the node does not compile while the robot drives."""
import numpy as np

from m2wr_elevation.elevation_map import ElevationMap, MapSettings
from m2wr_elevation.kernel_warm_up import compile_kernels
from m2wr_elevation.planning import cost_of, route
from m2wr_node.kernel_progress import kernels


def compiled():
    return {name: len(kernel.signatures) for name, kernel in kernels("m2wr_elevation").items()}


def test_mapping_and_planning_compile_nothing_after_the_warm_up():
    compile_kernels()
    before = compiled()
    assert len(before) == 5 and all(before.values())
    elevation = ElevationMap(MapSettings())
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (500, 3))
    elevation.move(1.0, 2.0)
    elevation.offset(points, np.eye(3), np.zeros(3))
    elevation.add(points, np.eye(3), np.zeros(3), np.zeros(3))
    route(cost_of(elevation.layers(), elevation.settings), (3, 3), (4, 9))
    assert compiled() == before
