# SPDX-License-Identifier: BSD-3-Clause
"""Ranges of adjacent beams to one box, sphere, cylinder or plane.

``cosine`` and ``sine`` (n,) are those of the azimuths of the beams.  ``x, y, z`` describe the beams along each axis of
the shape: coefficients of cosine and sine, constant, and origin [m]; of a plane only ``x`` is used, along its normal.

Each loop must be without branches, so that the compiler handles several beams at once.  For that a function which is
called in a loop must not divide more than once: the compiler would combine the divisions of one beam instead.  Loops
over boxes took twice the time in that form.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_sim.sensors.base_kernels import kernel

BOX, SPHERE, CYLINDER, PLANE = 0, 1, 2, 3
TINY = 1e-12            # least direction component; moves a hit by at most 1e-12 of its range

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Vector = Tuple[float, float, float]
    #: Coefficients of cosine and sine of the azimuth, constant, and origin.
    Terms = Tuple[float, float, float, float]


@kernel
def _lower(a: float, b: float) -> float:
    return a if a < b else b


@kernel
def _higher(a: float, b: float) -> float:
    return a if a > b else b


@kernel
def _along(terms: Terms, c: float, s: float) -> float:
    """Return the direction of a beam along one axis."""
    return terms[0] * c + terms[1] * s + terms[2]


@kernel
def _slab(direction: float, origin: float, half: float) -> Tuple[float, float]:
    """Return where a ray enters and leaves |x| <= half along one axis."""
    inverse = 1.0 / (TINY if abs(direction) < TINY else direction)      # NaN stays NaN
    one, two = (-half - origin) * inverse, (half - origin) * inverse
    return _lower(one, two), _higher(one, two)


@kernel
def _first_hit(enter: float, leave: float, nearest: float) -> float:
    """Return the first of entry and exit beyond ``nearest``; infinity where the shape is missed."""
    t = enter if enter > nearest else leave
    t = t if leave >= enter else np.inf
    return t if t > nearest else np.inf


@kernel
def _tube(dx: float, dy: float, x: float, y: float, radius: float) -> Tuple[float, float]:
    """Return where a ray from x, y enters and leaves the infinite cylinder about z; entry beyond exit if it misses."""
    dx = TINY if abs(dx) < TINY else dx
    a, b, across = dx * dx + dy * dy, x * dx + y * dy, x * dy - y * dx
    left = a * radius * radius - across * across     # stays accurate at long range, unlike b * b - a * c
    root = math.sqrt(left if left > 0.0 else 0.0)
    inverse = 1.0 / a
    return (-b - root) * inverse, ((-b + root) * inverse if left >= 0.0 else -np.inf)


@kernel
def _ball(dx: float, dy: float, dz: float, origin: Vector, radius: float) -> Tuple[float, float]:
    """Return where a ray enters and leaves a sphere; entry beyond exit if it misses."""
    b = -(origin[0] * dx + origin[1] * dy + origin[2] * dz)
    ex, ey, ez = origin[0] + b * dx, origin[1] + b * dy, origin[2] + b * dz
    left = radius * radius - (ex * ex + ey * ey + ez * ez)
    root = math.sqrt(left if left > 0.0 else 0.0)
    return b - root, (b + root if left >= 0.0 else -np.inf)


@kernel
def _sweep_box(tall: bool, out: Floats, cosine: Floats, sine: Floats, x: Terms, y: Terms, z: Terms, half: Vector,
               nearest: float) -> None:
    if tall:
        for i in range(out.size):
            enter, leave = _slab(_along(x, cosine[i], sine[i]), x[3], half[0])
            low, high = _slab(_along(y, cosine[i], sine[i]), y[3], half[1])
            out[i] = _lower(_first_hit(_higher(enter, low), _lower(leave, high), nearest), out[i])
    else:
        for i in range(out.size):
            enter, leave = _slab(_along(x, cosine[i], sine[i]), x[3], half[0])
            low, high = _slab(_along(y, cosine[i], sine[i]), y[3], half[1])
            enter, leave = _higher(enter, low), _lower(leave, high)
            low, high = _slab(_along(z, cosine[i], sine[i]), z[3], half[2])
            out[i] = _lower(_first_hit(_higher(enter, low), _lower(leave, high), nearest), out[i])


@kernel
def _sweep_cylinder(tall: bool, out: Floats, cosine: Floats, sine: Floats, x: Terms, y: Terms, z: Terms, half: Vector,
                    nearest: float) -> None:
    if tall:
        for i in range(out.size):
            enter, leave = _tube(_along(x, cosine[i], sine[i]), _along(y, cosine[i], sine[i]), x[3], y[3], half[0])
            out[i] = _lower(_first_hit(enter, leave, nearest), out[i])
    else:
        for i in range(out.size):
            enter, leave = _tube(_along(x, cosine[i], sine[i]), _along(y, cosine[i], sine[i]), x[3], y[3], half[0])
            low, high = _slab(_along(z, cosine[i], sine[i]), z[3], half[2])
            out[i] = _lower(_first_hit(_higher(enter, low), _lower(leave, high), nearest), out[i])


@kernel
def sweep(kind: int, tall: bool, out: Floats, cosine: Floats, sine: Floats, x: Terms, y: Terms, z: Terms, half: Vector,
          nearest: float) -> None:
    """Lower ``out`` to the range of one shape for adjacent beams of one row.

    Parameters
    ----------
    kind : int
        BOX, SPHERE, CYLINDER or PLANE.
    tall : bool
        Whether no beam can pass above or below a box or a cylinder; then ``z`` is not used.
    out : (n,) float64
        Lowered where the shape is nearer [m].
    cosine, sine : (n,) float64
    x, y, z : tuple of 4 floats
        See the module.
    half : tuple of 3 floats
        Half sizes of a box; of round shapes radius first, half length third [m].
    nearest : float
        Hits are beyond it [m].
    """
    if kind == BOX:
        _sweep_box(tall, out, cosine, sine, x, y, z, half, nearest)
    elif kind == CYLINDER:
        _sweep_cylinder(tall, out, cosine, sine, x, y, z, half, nearest)
    elif kind == SPHERE:
        for i in range(out.size):
            enter, leave = _ball(_along(x, cosine[i], sine[i]), _along(y, cosine[i], sine[i]),
                                 _along(z, cosine[i], sine[i]), (x[3], y[3], z[3]), half[0])
            out[i] = _lower(_first_hit(enter, leave, nearest), out[i])
    else:
        for i in range(out.size):
            t = -x[3] / _along(x, cosine[i], sine[i])
            t = t if t > nearest else np.inf
            out[i] = _lower(t, out[i])
