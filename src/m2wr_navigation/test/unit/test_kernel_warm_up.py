# SPDX-License-Identifier: BSD-3-Clause
"""Nothing is compiled once the kernels are warm, so that no node compiles while it drives."""
import numpy as np

from m2wr_navigation.costmap.observation import Observation
from m2wr_navigation.kernel_warm_up import compile_kernels, small_costmap
from m2wr_node.kernel_progress import kernels


def compiled():
    return {name: len(kernel.signatures) for name, kernel in kernels("m2wr_navigation").items()}


def test_costmaps_compile_nothing_after_the_warm_up():
    compile_kernels()
    before = compiled()
    assert len(before) > 10
    costmap = small_costmap(rolling=True)
    seen = Observation(1.0, np.zeros(3), np.ones((5, 3)), np.ones((5, 3)))
    costmap.obstacle_layers()[0].sources["laser"].add(seen, 1.0)
    costmap.update(np.array([2.5, 2.0, 1.0]), 1.0)
    costmap.reset()
    assert compiled() == before
