# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses as arrays: x, y [m], theta [rad] in the last axis; any leading shape, broadcast as numpy does."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray


def wrap(angle: ArrayLike) -> FloatArray:
    """Wrap angles to [-pi, pi)."""
    wrapped: FloatArray = (np.asarray(angle, float) + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped


def _wrapped(angle: float) -> float:
    """Wrap one angle to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _cos_sin(a: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Cosine and sine of the headings of poses (..., 3).

    Uses a copy: for strided arrays numpy may use other code with other last bits, depending on the memory layout.
    """
    theta = a[..., 2].copy()
    return np.cos(theta), np.sin(theta)


def composed(a: Sequence[float], b: Sequence[float]) -> Tuple[float, float, float]:
    """Return a (+) b of two poses as numbers; faster than :func:`compose` for what is no array yet.

    Parameters
    ----------
    a, b : (3,) float
        Poses [m, m, rad].

    Returns
    -------
    (3,) float
        Theta in [-pi, pi).
    """
    (ax, ay, at), (bx, by, bt) = a, b
    c, s = math.cos(at), math.sin(at)
    return ax + c * bx - s * by, ay + s * bx + c * by, _wrapped(at + bt)


def compose(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Return a (+) b: the pose ``b`` of the frame ``a``, in the parent frame of ``a``.

    Parameters
    ----------
    a, b : (..., 3) array_like

    Returns
    -------
    (..., 3) float64
        Theta in [-pi, pi).
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    if a.ndim == b.ndim == 1:
        return np.array(composed(a.tolist(), b.tolist()))
    cos, sin = _cos_sin(a)
    return np.stack([a[..., 0] + cos * b[..., 0] - sin * b[..., 1],
                     a[..., 1] + sin * b[..., 0] + cos * b[..., 1],
                     wrap(a[..., 2] + b[..., 2])], -1)


def inverse(a: ArrayLike) -> FloatArray:
    """Return the pose whose composition with ``a`` is the identity."""
    a = np.asarray(a, float)
    c, s = _cos_sin(a)
    return np.stack([-c * a[..., 0] - s * a[..., 1], s * a[..., 0] - c * a[..., 1], wrap(-a[..., 2])], -1)


def between(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Return the pose ``b`` relative to ``a``.

    Parameters
    ----------
    a, b : (..., 3) array_like
        Poses in one frame [m, m, rad].

    Returns
    -------
    (..., 3) float64
        Theta in [-pi, pi).
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    if a.ndim == b.ndim == 1:
        (ax, ay, at), (bx, by, bt) = a.tolist(), b.tolist()
        c, s = math.cos(at), math.sin(at)
        dx, dy = bx - ax, by - ay
        return np.array([c * dx + s * dy, c * dy - s * dx, _wrapped(bt - at)])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    cos, sin = _cos_sin(a)
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx, wrap(b[..., 2] - a[..., 2])], -1)
