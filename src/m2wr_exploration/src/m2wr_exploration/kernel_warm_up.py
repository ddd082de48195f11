# SPDX-License-Identifier: BSD-3-Clause
"""Compile every kernel or load it from its cache: ``python3 -m m2wr_exploration.kernel_warm_up``."""
from __future__ import annotations

import numpy as np

from m2wr_exploration.frontier_kernels import sight_counts
from m2wr_exploration.frontiers import gain, look
from m2wr_exploration.registry import STRATEGIES, find
from m2wr_exploration.set_aside import SetAside
from m2wr_exploration.team.merge_kernels import agreement, draw_coarse, find_free_sides
from m2wr_exploration.team.merging import merge
from m2wr_exploration.team.right_of_way import allowed
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.parameters import read
from m2wr_node.kernel_library import prepare


def compile_kernels() -> None:
    """Let each strategy order the two frontiers of a small map."""
    costs = np.zeros((20, 20), np.uint8)
    costs[:, :2], costs[:, 18:], costs[10, 10] = 255, 255, 254
    view = look(Costmap(costs, 0.1, np.zeros(2), "map"), np.array([1.0, 0.5]), 0.0, 0.2, 0.1)
    sight_counts(costs, np.array([(5, 5)]), 3.0, 8)
    for name in STRATEGIES:
        kind = find(name)
        kind(read(kind.PARAMETERS, {}, name)[0]).order(view, view.frontiers)
    gain(view.costmap, view.frontiers[0], 1.0)
    merge([view.costmap], [np.zeros(3)])
    find_free_sides(np.zeros((1, 2), np.int64), np.zeros((2, 2), np.bool_), 1, 1, np.zeros((2, 2, 2), np.float32))
    agreement(np.zeros((1, 2)), np.zeros((1, 2), np.float32), np.zeros((2, 2), np.float32),
              np.zeros((2, 2, 2), np.float32), 0.1, np.zeros(2), np.zeros(3))
    draw_coarse(np.zeros((4, 4), np.complex64), np.zeros((1, 2)), np.zeros((1, 2)), np.zeros(2), 0.0, 0.1)
    still, outline = [np.zeros(2)] * 2, np.array([(-0.1, -0.1), (0.1, -0.1), (0.0, 0.1)])
    allowed([np.zeros(3), np.ones(3)], still, [(0.1, 0.0)] * 2, outline, 0.1)
    SetAside(0.5, 1.0, 1).add(0.0, view.costmap, view.frontiers[0], "")


if __name__ == "__main__":
    prepare("m2wr_exploration", compile_kernels)
