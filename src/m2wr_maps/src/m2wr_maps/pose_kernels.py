# SPDX-License-Identifier: BSD-3-Clause
"""Planar poses in kernels: x, y [m], heading [rad]."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Tuple

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray


@kernel
def wrapped(angle: float) -> float:
    """Return an angle in [-pi, pi) [rad]."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def compose(a: Any, b: Any, out: FloatArray) -> None:
    """Transform the pose ``b`` from the frame ``a`` into the parent frame of ``a``.

    Parameters
    ----------
    a : (3,) float64 or tuple
        Pose [m, m, rad].
    b : (3,) float64 or tuple
        Pose [m, m, rad].
    out : (3,) float64
        Written; may be ``a`` or ``b``.
    """
    c, s = math.cos(a[2]), math.sin(a[2])
    out[0], out[1], out[2] = a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrapped(a[2] + b[2])


@kernel
def between(a: Any, b: Any) -> Tuple[float, float, float]:
    """Return the pose ``b`` in the frame ``a``.

    Parameters
    ----------
    a : (3,) float64 or tuple
        Pose [m, m, rad].
    b : (3,) float64 or tuple
        Pose [m, m, rad].

    Returns
    -------
    x, y, theta : float
        [m, m, rad]
    """
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return c * dx + s * dy, c * dy - s * dx, wrapped(b[2] - a[2])


@kernel
def exceeds(x: float, y: float, theta: float, limits: Any) -> bool:
    """Return whether a motion is larger than its limits in any component.

    Parameters
    ----------
    x : float
        [m]
    y : float
        [m]
    theta : float
        [rad]
    limits : tuple of 3 float
        Limits [m, m, rad].
    """
    return abs(x) > limits[0] or abs(y) > limits[1] or abs(theta) > limits[2]
