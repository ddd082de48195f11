# SPDX-License-Identifier: BSD-3-Clause
"""Compile every kernel or load it from its cache: ``python3 -m m2wr_maps.kernel_warm_up``."""
from __future__ import annotations

import numpy as np

from m2wr_maps.linear_kernels import inverse, product, solve, transformed
from m2wr_maps.pose_graph import optimise
from m2wr_maps.pose_kernels import between, compose, exceeds, wrapped
from m2wr_node.kernel_library import prepare


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


if __name__ == "__main__":
    prepare("m2wr_maps", compile_kernels)
