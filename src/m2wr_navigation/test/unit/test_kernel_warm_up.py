# SPDX-License-Identifier: BSD-3-Clause
"""Nothing is compiled once the kernels are warm, so that no node compiles while it drives."""
import numpy as np
import pytest

from m2wr_navigation import registry
from m2wr_navigation.costmap.observation import Observation
from m2wr_navigation.kernel_warm_up import compile_kernels, small_costmap
from m2wr_navigation.methods.method import Sensing
from m2wr_navigation.parameters import read
from m2wr_node.kernel_progress import kernels
from planner_grids import grid, planner, pose


def compiled():
    return {name: len(kernel.signatures) for name, kernel in kernels("m2wr_navigation").items()}


@pytest.mark.parametrize("kind", ["ObstacleLayer", "VoxelLayer"])
def test_costmaps_compile_nothing_after_the_warm_up(kind):
    compile_kernels()
    before = compiled()
    assert len(before) > 10
    costmap = small_costmap(rolling=True, kind=kind)
    seen = Observation(1.0, np.zeros(3), np.ones((5, 3)), np.ones((5, 3)))
    costmap.obstacle_layers()[0].sources["laser"].add(seen, 1.0)
    costmap.update(np.array([2.5, 2.0, 1.0]), 1.0)
    costmap.reset()
    assert compiled() == before


@pytest.mark.parametrize("name", sorted(set(registry.PLANNERS) - {"carrot_planner/CarrotPlanner"}))
@pytest.mark.parametrize("side", [60, 1100])
def test_planners_compile_nothing_after_the_warm_up(name, side):
    compile_kernels()
    before = compiled()
    costs = np.zeros((side, side), np.uint8)
    costs[20:30, 25:30] = 254
    made, start, goal = planner(name), pose(5, 5), pose(50, 50)
    assert made.plan(grid(costs), start, goal).reason == ""
    costs[50, 50], costs[5, 5] = 254, 253
    assert made.plan(grid(costs), start, goal, 0.2).reason == ""
    costs[:, 40] = 254
    assert made.plan(grid(costs), start, goal, 0.2).reason
    assert compiled() == before


@pytest.mark.parametrize("name, given", [("mppi", {"samples": 10}), ("bug2", {})])
def test_a_drive_compiles_nothing_after_the_warm_up(name, given):
    compile_kernels()
    before = compiled()
    kind = registry.find(registry.METHODS, name)
    method = kind(read(kind.PARAMETERS, given, name)[0])
    method.begin((5.0, 0.0))
    for k in range(40):
        ranges = np.full(90, 6.0, np.float32)
        ranges[k:k + 20] = 2.0 - 0.04 * k
        method.step(Sensing(0.1 * k, (0.0, 0.0, 0.0), (0.0, 0.0), ranges, -1.0, 2.0 / 90))
    assert compiled() == before
