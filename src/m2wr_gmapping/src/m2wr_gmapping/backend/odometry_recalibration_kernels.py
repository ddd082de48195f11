# SPDX-License-Identifier: BSD-3-Clause
"""Correction of past steps for the offset of the centre of rotation, along directions that no scan observed.

Array layouts
-------------
``steps`` (K, STEP_SIZE) float64
    One row for the step to each processed scan, in the axes of the matched pose:

    UNOBSERVED      projector onto the degenerate direction of the scan match: xx, xy, yy; 0 if there is none
    ROTATION        rotation by odometry [rad]
    CENTRE          offset that was assumed when the step was made [m]
    APPLIED         correction that the path already contains, x and y [m]
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from numba import njit

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray

UNOBSERVED, ROTATION, CENTRE, APPLIED, STEP_SIZE = 0, 3, 4, 5, 7


@njit(cache=True, nogil=True, error_model='numpy')
def missing_corrections(steps: FloatArray, count: int, centre: float, ahead: FloatArray, out: FloatArray) -> None:
    """Write the correction that each of the first ``count`` steps still needs for the present offset.

    Parameters
    ----------
    steps : (S, STEP_SIZE) float64
    count : int
    centre : float
        Present estimate of the offset of odometry's reference point ahead of the centre of rotation [m].
    ahead : (2,) float64
        Forward direction of the base in the laser's frame.
    out : (count, 3) float64
        First two columns: missing correction x, y [m] in the axes of the pose that the step leads to. The sum with
        APPLIED is the whole correction.
    """
    for k in range(count):
        row = steps[k]
        offset, rotation = centre - row[CENTRE], row[ROTATION]
        along, across = offset * (1.0 - math.cos(rotation)), offset * math.sin(rotation)
        x, y = ahead[0] * along - ahead[1] * across, ahead[1] * along + ahead[0] * across
        out[k, 0] = row[UNOBSERVED] * x + row[UNOBSERVED + 1] * y - row[APPLIED]
        out[k, 1] = row[UNOBSERVED + 1] * x + row[UNOBSERVED + 2] * y - row[APPLIED + 1]


@njit(cache=True, nogil=True, error_model='numpy')
def corrected_path(path: FloatArray, changes: FloatArray, out: FloatArray) -> None:
    """Write a path with corrected steps.

    Parameters
    ----------
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    changes : (K, 3) float64
        Corrections x, y [m] in the axes of the pose that the step leads to; headings are not used.
    out : (K, 3) float64
        Written: corrected path.
    """
    x = y = 0.0         # accumulated shift in the map's axes
    for k in range(path.shape[0]):
        if k > 0:
            c, s = math.cos(path[k, 2]), math.sin(path[k, 2])
            x, y = x + c * changes[k, 0] - s * changes[k, 1], y + s * changes[k, 0] + c * changes[k, 1]
        out[k, 0], out[k, 1], out[k, 2] = path[k, 0] + x, path[k, 1] + y, path[k, 2]
