# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses as arrays: x, y [m], theta [rad] in the last axis; any leading shape, broadcast as numpy does."""
import math

import numpy as np


def wrap(angle):
    """Wrap angles to [-pi, pi)."""
    return (np.asarray(angle, float) + np.pi) % (2.0 * np.pi) - np.pi


def _wrapped(angle):
    """Wrap one angle to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _cos_sin(a):
    """Cosine and sine of the headings of poses (..., 3).

    Uses a copy: for strided arrays numpy may use other code with other last bits, depending on the memory layout.
    """
    theta = a[..., 2].copy()
    return np.cos(theta), np.sin(theta)


def compose(a, b):
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
        (ax, ay, at), (bx, by, bt) = a.tolist(), b.tolist()
        c, s = math.cos(at), math.sin(at)
        return np.array([ax + c * bx - s * by, ay + s * bx + c * by, _wrapped(at + bt)])
    c, s = _cos_sin(a)
    return np.stack([a[..., 0] + c * b[..., 0] - s * b[..., 1],
                     a[..., 1] + s * b[..., 0] + c * b[..., 1],
                     wrap(a[..., 2] + b[..., 2])], -1)


def inverse(a):
    """Return the pose whose composition with ``a`` is the identity."""
    a = np.asarray(a, float)
    c, s = _cos_sin(a)
    return np.stack([-c * a[..., 0] - s * a[..., 1], s * a[..., 0] - c * a[..., 1], wrap(-a[..., 2])], -1)


def between(a, b):
    """Return the pose ``b`` relative to ``a``.

    Parameters
    ----------
    a, b : (..., 3) array_like
        Poses in one frame [m, m, rad].
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    if a.ndim == b.ndim == 1:
        (ax, ay, at), (bx, by, bt) = a.tolist(), b.tolist()
        c, s = math.cos(at), math.sin(at)
        dx, dy = bx - ax, by - ay
        return np.array([c * dx + s * dy, c * dy - s * dx, _wrapped(bt - at)])
    dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
    c, s = _cos_sin(a)
    return np.stack([c * dx + s * dy, c * dy - s * dx, wrap(b[..., 2] - a[..., 2])], -1)
