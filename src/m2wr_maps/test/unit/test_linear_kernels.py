# SPDX-License-Identifier: BSD-3-Clause
"""Small systems of linear equations against NumPy."""
import numpy as np
import pytest

from m2wr_maps.linear_kernels import solve


@pytest.mark.parametrize("seed", range(5))
def test_solver_equals_numpy(seed):
    rng = np.random.default_rng(seed)
    root, g, step = rng.normal(size=(3, 3)), rng.normal(size=3), np.zeros(3)
    h = root @ root.T + np.eye(3) * 0.1
    assert solve(h[np.triu_indices(3)], g, step)
    assert np.allclose(step, np.linalg.solve(h, -g))
    assert not solve(np.array([1.0, 2.0, 0.0, 1.0, 0.0, 1.0]), g, step)
