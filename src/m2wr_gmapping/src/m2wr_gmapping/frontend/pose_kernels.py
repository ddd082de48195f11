# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses in kernels: x, y [m], heading [rad]."""
import math

from numba import njit


@njit(cache=True, nogil=True, error_model='numpy')
def wrapped(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit(cache=True, nogil=True, error_model='numpy')
def compose(a, b, out):
    """Write the pose ``b``, given in the frame ``a``, in the frame in which ``a`` is given; ``out`` may be either."""
    c, s = math.cos(a[2]), math.sin(a[2])
    out[0], out[1], out[2] = a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrapped(a[2] + b[2])


@njit(cache=True, nogil=True, error_model='numpy')
def between(a, b):
    """Return the pose ``b`` as seen from ``a``, as three numbers."""
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return c * dx + s * dy, c * dy - s * dx, wrapped(b[2] - a[2])


@njit(cache=True, nogil=True, error_model='numpy')
def exceeds(x, y, theta, limits):
    return abs(x) > limits[0] or abs(y) > limits[1] or abs(theta) > limits[2]
