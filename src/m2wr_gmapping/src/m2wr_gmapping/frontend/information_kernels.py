# SPDX-License-Identifier: BSD-3-Clause
"""Information of a scan match: what the scan alone says about the pose, and its fusion with odometry.

Result rows are those of ``match_kernels``.
"""
from __future__ import annotations

import math
from typing import Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_maps.linear_kernels import inverse, product, transformed
from m2wr_maps.pose_kernels import between, compose
from m2wr_node.array_types import FloatArray
from m2wr_node.kernel import kernel

INFORMATION = 7             # first column of the information in a result row
NORMAL_VARIANCE, DEPENDENT = tuning.MATCHING.normal_variance, tuning.MATCHING.dependent


@kernel
def unfold(row: FloatArray) -> FloatArray:
    """Return the information matrix (3, 3) of a result row (13,), along x, y and heading of the matched pose."""
    h = row[INFORMATION:]
    return np.array(((h[0], h[1], h[2]), (h[1], h[3], h[4]), (h[2], h[4], h[5])))


@kernel
def fused_covariance(information: FloatArray, variances: FloatArray) -> FloatArray:
    """Return the covariance (3, 3) of a pose by a scan and by what was known before, such as odometry.

    Parameters
    ----------
    information : (3, 3) float64
        Of the scan.
    variances : (3,) float64
        Of what was known before [m^2, m^2, rad^2].
    """
    return inverse(information + np.diag(1.0 / variances))


@kernel
def weak_axis(row: FloatArray) -> Tuple[float, float, float, float]:
    """Return the direction that a scan observes least, and how well.

    Normals of noisy end points are inclined, so a plain wall seems to give information along itself: the information
    across it times the variance of the angle. What this noise explains does not count.

    Parameters
    ----------
    row : (13,) float64
        Result row of ``match_kernels``.

    Returns
    -------
    x, y : float
        Unit vector in the axes of the matched pose.
    information, true_information : float
        Along it, with the heading eliminated: as computed, and without the noise of the normals [1/m^2].
    """
    h = row[INFORMATION:]
    by = 1.0 / h[5] if h[5] > 0.0 else 0.0
    a, b, d = h[0] - h[2] * h[2] * by, h[1] - h[2] * h[4] * by, h[3] - h[4] * h[4] * by
    half, middle = 0.5 * (a - d), 0.5 * (a + d)
    root = math.sqrt(half * half + b * b)
    weak, strong = max(0.0, middle - root), max(0.0, middle + root)
    true = max(0.0, weak - NORMAL_VARIANCE * strong) / (1.0 - NORMAL_VARIANCE * NORMAL_VARIANCE)
    if not root > 0.0:
        return 1.0, 0.0, weak, true
    # the larger of the two columns of the projector (1 - (matrix - middle) / root) / 2
    xx, xy, yy = 0.5 * (1.0 - half / root), -0.5 * b / root, 0.5 * (1.0 + half / root)
    x, y = (xx, xy) if xx > yy else (xy, yy)
    by = 1.0 / math.hypot(x, y)
    return x * by, y * by, weak, true


@kernel
def scan_information(row: FloatArray, share: float) -> FloatArray:
    """Return what the scan of a match observes, without the noise of its normals.

    Parameters
    ----------
    row : (13,) float64
        Result row of ``match_kernels``.
    share : float
        Factor, such as 1 / ``DEPENDENT``.

    Returns
    -------
    (3, 3) float64
        Information along x, y and heading of the matched pose.
    """
    x, y, weak, true = weak_axis(row)
    lost, axis = 1.0 - math.sqrt(true / weak) if weak > 0.0 else 1.0, np.array((x, y, 0.0))
    kept = np.eye(3) - lost * np.outer(axis, axis)      # scales along the axis
    return share * product(product(kept, unfold(row)), kept)


@kernel
def fuse(row: FloatArray, expected: FloatArray, prior: FloatArray) -> None:
    """Replace the pose of a match by the mean of odometry and what the scan truly observes.

    Along a plain wall this is odometry. There the match would stay at its start, which may come from a search, or move
    to the end of the wall's map.

    Parameters
    ----------
    row : (13,) float64
        Result row; its pose changes.
    expected : (3,) float64
        Pose by odometry in ``map``.
    prior : (3,) float64
        Inverse variances along its axes.
    """
    x, y, weak, true = weak_axis(row)
    if not row[INFORMATION] + row[INFORMATION + 3] > 0.0:       # no beam has found a partner
        return
    dx, dy, _ = between(row, expected)
    odometry, share = x * x * prior[0] + y * y * prior[1], 1.0
    if true > 0.0:
        share -= true / (true + odometry) * (weak + odometry) / weak
    along = share * (x * dx + y * dy)
    compose(row, (along * x, along * y, 0.0), row)


@kernel
def scan_vector(row: FloatArray, expected: FloatArray, prior: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Return information and information vector of the scan alone about the error of a prediction.

    A match is the mean of scan and odometry, weighted by their information; this removes odometry again.

    Parameters
    ----------
    row : (13,) float64
        Result row of ``match_kernels``.
    expected : (3,) float64
        Pose by odometry in ``map``.
    prior : (3,) float64
        Inverse variances along its axes that the match used.

    Returns
    -------
    information : (3, 3) float64
        As of ``scan_information`` with the share 1.
    vector : (3,) float64
        That information times the error of ``expected`` by the scan alone, in the axes of ``expected``.
    """
    fused = row.copy()
    fuse(fused, expected, prior)
    information, error = scan_information(row, 1.0), np.array(between(expected, fused))
    return information, prior * error + transformed(information, error)


@kernel
def fuse_all(rows: FloatArray, expected: FloatArray, prior: FloatArray) -> None:
    """Apply ``fuse`` to many matches.

    Parameters
    ----------
    rows : (N, 13) float64
        Result rows; their poses change.
    expected : (N, 3) float64
        Poses by odometry in ``map``.
    prior : (3,) float64
        Inverse variances along their axes.
    """
    for n in range(rows.shape[0]):
        fuse(rows[n], expected[n], prior)
