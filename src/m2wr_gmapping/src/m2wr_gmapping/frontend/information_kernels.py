# SPDX-License-Identifier: BSD-3-Clause
"""Information of a scan match: what the scan alone says about the pose, and its fusion with odometry.

Result rows are those of ``match_kernels``.
"""
from __future__ import annotations

import math
from typing import Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_maps.pose_kernels import between, compose
from m2wr_node.array_types import FloatArray
from m2wr_node.kernel import kernel

INFORMATION = 7             # first column of the information in a result row
NORMAL_VARIANCE, DEPENDENT = tuning.MATCHING.normal_variance, tuning.MATCHING.dependent


@kernel
def unfold(row: FloatArray, out: FloatArray) -> None:
    """Write the information matrix of a result row.

    Parameters
    ----------
    row : (13,) float64
        Result row of ``match_kernels``.
    out : (3, 3) float64
        Written: along x, y and heading of the matched pose.
    """
    h = row[INFORMATION:]
    out[0, 0], out[0, 1], out[0, 2] = h[0], h[1], h[2]
    out[1, 0], out[1, 1], out[1, 2] = h[1], h[3], h[4]
    out[2, 0], out[2, 1], out[2, 2] = h[2], h[4], h[5]


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
def scan_information(row: FloatArray, share: float, out: FloatArray) -> None:
    """Write what the scan of a match observes, without the noise of its normals.

    Parameters
    ----------
    row : (13,) float64
        Result row of ``match_kernels``.
    share : float
        Factor, such as 1 / ``DEPENDENT``.
    out : (3, 3) float64
        Written: information along x, y and heading of the matched pose.
    """
    unfold(row, out)
    x, y, weak, true = weak_axis(row)
    lost = 1.0 - math.sqrt(true / weak) if weak > 0.0 else 1.0
    for k in range(3):          # scaled along the axis, from both sides
        along = lost * (x * out[k, 0] + y * out[k, 1])
        out[k, 0], out[k, 1] = out[k, 0] - along * x, out[k, 1] - along * y
    for k in range(3):
        along = lost * (x * out[0, k] + y * out[1, k])
        out[0, k], out[1, k] = out[0, k] - along * x, out[1, k] - along * y
    for i in range(3):
        for j in range(3):
            out[i, j] *= share


@kernel
def scan_vector(row: FloatArray, expected: FloatArray, prior: FloatArray, out: FloatArray, told: FloatArray) -> None:
    """Write information and information vector of the scan alone about the error of a prediction.

    A match is the mean of scan and odometry, weighted by their information; this removes odometry again.

    Parameters
    ----------
    row : (13,) float64
        Result row of ``match_kernels``.
    expected : (3,) float64
        Pose by odometry in ``map``.
    prior : (3,) float64
        Inverse variances along its axes that the match used.
    out : (3, 3) float64
        Written: as of ``scan_information`` with the share 1.
    told : (3,) float64
        Written: that information times the error of ``expected`` by the scan alone, in the axes of ``expected``.
    """
    fused, error = row[:3].copy(), np.empty(3)
    _replace(fused, row, expected, prior)
    error[0], error[1], error[2] = between(expected, fused)
    scan_information(row, 1.0, out)
    for i in range(3):
        told[i] = prior[i] * error[i]
        for j in range(3):
            told[i] += out[i, j] * error[j]


@kernel
def _replace(pose: FloatArray, row: FloatArray, expected: FloatArray, prior: FloatArray) -> None:
    """Move a pose (3,), the matched one, along the weak axis of its row to where scan and odometry really meet."""
    x, y, weak, true = weak_axis(row)
    if not row[INFORMATION] + row[INFORMATION + 3] > 0.0:       # no beam has found a partner
        return
    dx, dy, _ = between(pose, expected)
    odometry, share = x * x * prior[0] + y * y * prior[1], 1.0
    if true > 0.0:
        share -= true / (true + odometry) * (weak + odometry) / weak
    along = share * (x * dx + y * dy)
    compose(pose, (along * x, along * y, 0.0), pose)


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
    _replace(row, row, expected, prior)


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
