# SPDX-License-Identifier: BSD-3-Clause
"""Compile every kernel or load it from its cache: ``python3 -m m2wr_maps.kernel_warm_up``."""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from m2wr_maps.linear_kernels import inverse, product, solve, transformed
from m2wr_maps.occupancy import Occupancy
from m2wr_maps.pose_graph import optimise
from m2wr_maps.pose_kernels import between, compose, exceeds, wrapped
from m2wr_node.kernel_library import prepare

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Float32Array


class _Beams(NamedTuple):
    """A scan as the occupancy grid reads it."""

    rays: Float32Array
    ray_hits: BoolArray


def compile_kernels() -> None:
    """Call every kernel once."""
    pose = np.array([1.0, 2.0, 4.0])
    compose(pose, pose, np.empty(3))
    exceeds(*between(pose, pose), (0.1, 0.1, wrapped(4.0)))
    solve(np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0]), pose, np.empty(3))
    matrix = np.eye(3)
    transformed(product(matrix, inverse(matrix)), pose)
    pairs = np.array([[0, 1], [1, 2], [0, 2]])
    optimise(np.zeros((3, 3)), pairs, np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)), np.zeros(3, bool))
    for are_large in (False, True):
        grid = Occupancy((-1.0, -1.0, 1.0, 1.0), 0.1, 0.5)
        if are_large:
            grid.use_large_counts()
        grid.update(pose[None], [_Beams(np.ones((2, 3), np.float32), np.ones(3, bool))])
        grid.grid()


if __name__ == "__main__":
    prepare("m2wr_maps", compile_kernels)
