# SPDX-License-Identifier: BSD-3-Clause
"""Linear algebra of small matrices in kernels: faster than BLAS and LAPACK, and the same on every processor."""
from __future__ import annotations

import math

import numpy as np

from m2wr_node.array_types import FloatArray
from m2wr_node.kernel import kernel


@kernel
def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the product of two matrices.

    Parameters
    ----------
    a : (I, K) float64
    b : (K, J) float64

    Returns
    -------
    (I, J) float64
    """
    out = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            for j in range(b.shape[1]):
                out[i, j] += a[i, k] * b[k, j]
    return out


@kernel
def transformed(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the product of a matrix and a vector.

    Parameters
    ----------
    matrix : (I, K) float64
    vector : (K,) float64

    Returns
    -------
    (I,) float64
    """
    return (matrix * vector).sum(axis=1)


@kernel
def inverse(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a matrix, by Gauss-Jordan elimination with partial pivoting.

    Parameters
    ----------
    matrix : (N, N) float64
        A singular one gives infinite or undefined elements.

    Returns
    -------
    (N, N) float64
    """
    n = matrix.shape[0]
    a, out = matrix.copy(), np.eye(n)
    for i in range(n):
        pivot = i + np.argmax(np.abs(a[i:, i]))
        for k in range(n):
            a[i, k], a[pivot, k] = a[pivot, k], a[i, k]
            out[i, k], out[pivot, k] = out[pivot, k], out[i, k]
        by = 1.0 / a[i, i]
        for k in range(n):
            a[i, k] *= by
            out[i, k] *= by
        for j in range(n):
            factor = a[j, i]
            for k in range(n if j != i else 0):
                a[j, k] -= factor * a[i, k]
                out[j, k] -= factor * out[i, k]
    return out


@kernel
def solve(h: FloatArray, g: FloatArray, step: FloatArray) -> bool:
    """Solve the symmetric 3 x 3 system h * step = -g by Cholesky factorisation.

    Parameters
    ----------
    h : (6,) float64
        Upper triangle (xx xy xt yy yt tt).
    g : (3,) float64
        Gradient.
    step : (3,) float64
        Written: solution.

    Returns
    -------
    bool
        False if the matrix is not positive definite.
    """
    if not h[0] > 0.0:
        return False
    l00 = math.sqrt(h[0])
    l10, l20 = h[1] / l00, h[2] / l00
    d = h[3] - l10 * l10
    if not d > 0.0:
        return False
    l11 = math.sqrt(d)
    l21 = (h[4] - l20 * l10) / l11
    d = h[5] - l20 * l20 - l21 * l21
    if not d > 0.0:
        return False
    l22 = math.sqrt(d)
    y0 = -g[0] / l00
    y1 = (-g[1] - l10 * y0) / l11
    y2 = (-g[2] - l20 * y0 - l21 * y1) / l22
    step[2] = y2 / l22
    step[1] = (y1 - l21 * step[2]) / l11
    step[0] = (y0 - l10 * step[1] - l20 * step[2]) / l00
    return True
