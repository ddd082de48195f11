# SPDX-License-Identifier: BSD-3-Clause
"""Linear algebra of small matrices against NumPy."""
import numpy as np
import pytest

from m2wr_maps.linear_kernels import inverse, product, solve, transformed


@pytest.mark.parametrize("seed", range(5))
def test_solver_equals_numpy(seed):
    rng = np.random.default_rng(seed)
    root, g, step = rng.normal(size=(3, 3)), rng.normal(size=3), np.zeros(3)
    h = root @ root.T + np.eye(3) * 0.1
    assert solve(h[np.triu_indices(3)], g, step)
    assert np.allclose(step, np.linalg.solve(h, -g))
    assert not solve(np.array([1.0, 2.0, 0.0, 1.0, 0.0, 1.0]), g, step)


@pytest.mark.parametrize("size", [1, 3, 6])
def test_inverse_equals_numpy(size):
    rng = np.random.default_rng(size)
    for _ in range(50):
        matrix = rng.normal(size=(size, size))
        before = matrix.copy()
        assert np.allclose(product(inverse(matrix), matrix), np.eye(size), atol=1e-8) and (matrix == before).all()
        symmetric = matrix @ matrix.T + 0.01 * np.eye(size)
        assert np.allclose(inverse(symmetric), np.linalg.inv(symmetric))


def test_inverse_exchanges_rows_where_a_pivot_is_zero():
    matrix = np.array([[0.0, 2.0, 0.0], [0.0, 0.0, 4.0], [1.0, 0.0, 0.0]])
    assert (inverse(matrix) == np.linalg.inv(matrix)).all()


def test_products_equal_numpy():
    rng = np.random.default_rng(1)
    a, b, vector = rng.normal(size=(3, 6)), rng.normal(size=(6, 2)), rng.normal(size=6)
    assert np.allclose(product(a, b), a @ b) and np.allclose(product(b.T, a.T), (a @ b).T)
    assert np.allclose(transformed(a, vector), a @ vector)
