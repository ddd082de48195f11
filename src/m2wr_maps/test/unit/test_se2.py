# SPDX-License-Identifier: BSD-3-Clause
"""Composition and inversion of planar poses."""
import math

import numpy as np

from m2wr_maps.se2 import between, compose, inverse, wrap


def test_poses_compose_and_invert():
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-4, 4, (50, 3)), rng.uniform(-4, 4, (50, 3))
    assert np.allclose(wrap(between(a, compose(a, b)) - b)[:, 2], 0.0)
    assert np.allclose(between(a, compose(a, b))[:, :2], b[:, :2])
    assert np.allclose(compose(a, inverse(a)), 0.0)
    assert -math.pi <= compose([0, 0, 3.0], [0, 0, 3.0])[2] < math.pi


def test_poses_do_not_depend_on_memory_layout():
    rng = np.random.default_rng(3)
    poses = rng.normal(size=(196, 3))
    found = set()
    for _ in range(400):
        scattered = [np.empty(size) for size in rng.integers(1, 4000, int(rng.integers(1, 30)))]
        copy = poses.copy()
        found.add((compose(copy, poses[0]).tobytes(), between(copy, poses[0]).tobytes(), inverse(copy).tobytes()))
        del scattered
    assert len(found) == 1
