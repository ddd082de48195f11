# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of odometry and of the laser's mount by scan matches: one filter with one set of equations.

The state has the six components of ``track.PARAMETERS``. A step of odometry depends on all of them, and its Jacobian is
propagated along the segment between two processed scans. The scan observes the error of the predicted pose with its own
information. Directions that it does not observe have no information and change nothing.

Result rows are those of ``match_kernels``.
"""
from __future__ import annotations

import math

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.track import (
    DISTANCE,
    DRIFT,
    MOUNT_X,
    MOUNT_Y,
    MOUNT_YAW,
    PARAMETERS,
    ROTATION,
    Calibration,
    record_of,
)
from m2wr_node.array_types import FloatArray
from m2wr_node.kernel import kernel

OUTLIER = tuning.MATCHING.outlier


@kernel
def corrected_step(calibration: Calibration, x: float, y: float, turn: float, step: FloatArray,
                   jacobian: FloatArray) -> float:
    """Remove the known systematic errors from a step of odometry.

    Parameters
    ----------
    calibration : Calibration
        Present estimate.
    x, y, turn : float
        Step of the laser by odometry, in the laser's frame as given [m, m, rad].
    step : (3,) float64
        Written: corrected step.
    jacobian : (3, 6) float64
        Written: its derivative by the calibration, in the axes of the pose that the step leads to.

    Returns
    -------
    float
        Signed forward distance of the base [m].
    """
    c, mount = calibration.value, calibration.mount
    # step of the base: mount * step * inverse(mount)
    cm, sm, ct, st = math.cos(mount[2]), math.sin(mount[2]), math.cos(turn), math.sin(turn)
    ahead = mount[0] + cm * x - sm * y - (ct * mount[0] - st * mount[1])
    aside = mount[1] + sm * x + cm * y - (st * mount[0] + ct * mount[1])
    missing = c[ROTATION] * turn + c[DRIFT] * ahead         # rotation that odometry has missed
    turned = turn + missing
    ct, st, ch, sh = math.cos(turned), math.sin(turned), math.cos(0.5 * missing), math.sin(0.5 * missing)
    scale = 1.0 + c[DISTANCE]
    # half of the missing rotation happened before the middle of the step
    u, v = scale * (ch * ahead - sh * aside), scale * (sh * ahead + ch * aside)
    lx, ly, yaw = mount[0] + c[MOUNT_X], mount[1] + c[MOUNT_Y], mount[2] + c[MOUNT_YAW]
    px, py = u + ct * lx - st * ly - lx, v + st * lx + ct * ly - ly
    cy, sy = math.cos(yaw), math.sin(yaw)
    step[0], step[1], step[2] = cy * px + sy * py, cy * py - sy * px, turned
    # all derivatives in the base's axes at the start, then rotated into those of the laser at the end
    by_turn_x, by_turn_y = -0.5 * v - st * lx - ct * ly, 0.5 * u + ct * lx - st * ly
    jacobian[:] = 0.0
    jacobian[0, DISTANCE], jacobian[1, DISTANCE] = u / scale, v / scale
    jacobian[0, ROTATION], jacobian[1, ROTATION], jacobian[2, ROTATION] = by_turn_x * turn, by_turn_y * turn, turn
    jacobian[0, DRIFT], jacobian[1, DRIFT], jacobian[2, DRIFT] = by_turn_x * ahead, by_turn_y * ahead, ahead
    jacobian[0, MOUNT_X], jacobian[1, MOUNT_X] = ct - 1.0, st
    jacobian[0, MOUNT_Y], jacobian[1, MOUNT_Y] = -st, ct - 1.0
    jacobian[0, MOUNT_YAW], jacobian[1, MOUNT_YAW] = py, -px
    cy, sy = math.cos(yaw + turned), math.sin(yaw + turned)
    for k in range(PARAMETERS):
        jx, jy = jacobian[0, k], jacobian[1, k]
        jacobian[0, k], jacobian[1, k] = cy * jx + sy * jy, cy * jy - sy * jx
    return ahead


@kernel
def propagate_jacobian(step: FloatArray, of_step: FloatArray, jacobian: FloatArray) -> None:
    """Append a step to a pose whose derivative by the calibration is known.

    Parameters
    ----------
    step : (3,) float64
        Corrected step.
    of_step : (3, 6) float64
        Its derivative.
    jacobian : (3, 6) float64
        Derivative of the pose before the step, in its own axes; changed to that of the pose after the step.
    """
    c, s = math.cos(step[2]), math.sin(step[2])
    for k in range(PARAMETERS):
        x, y = jacobian[0, k] - jacobian[2, k] * step[1], jacobian[1, k] + jacobian[2, k] * step[0]
        jacobian[0, k] = c * x + s * y + of_step[0, k]
        jacobian[1, k] = c * y - s * x + of_step[1, k]
        jacobian[2, k] += of_step[2, k]


@kernel
def symmetric_inverse(matrix: FloatArray, out: FloatArray) -> None:
    """Write the inverse of a symmetric positive definite matrix (N, N), by Gauss-Jordan elimination.

    Parameters
    ----------
    matrix : (N, N) float64
    out : (N, N) float64
        Written; must not be ``matrix``.
    """
    n = matrix.shape[0]
    a = matrix.copy()
    out[:] = 0.0
    for i in range(n):
        out[i, i] = 1.0
    for i in range(n):
        by = 1.0 / a[i, i]
        for k in range(n):
            a[i, k] *= by
            out[i, k] *= by
        for j in range(n):
            if j != i:
                factor = a[j, i]
                for k in range(n):
                    a[j, k] -= factor * a[i, k]
                    out[j, k] -= factor * out[i, k]


@kernel
def _general_inverse(m: FloatArray, out: FloatArray) -> None:
    """Write the inverse of a matrix (3, 3) by its adjugate."""
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            out[j, i] = m[a, c] * m[b, d] - m[a, d] * m[b, c]
    by = 1.0 / (m[0, 0] * out[0, 0] + m[0, 1] * out[1, 0] + m[0, 2] * out[2, 0])
    for i in range(3):
        for j in range(3):
            out[i, j] *= by


@kernel
def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the matrix product of a (I, K) and b (K, J); faster than BLAS for these sizes."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            for j in range(b.shape[1]):
                out[i, j] += a[i, k] * b[k, j]
    return out


@kernel
def observation(information: FloatArray, noise: FloatArray, vector: FloatArray, error_information: FloatArray,
                error_vector: FloatArray) -> None:
    """Write what a scan says about the systematic error of a segment, with the random error of odometry unknown.

    With the scan's information H, its information vector y = H e and the covariance Q of odometry's noise, the
    systematic error has the information (I + H Q)^-1 H and the vector (I + H Q)^-1 y.

    Parameters
    ----------
    information : (3, 3) float64
        H, of the scan alone.
    noise : (3,) float64
        Diagonal of Q [m^2, m^2, rad^2].
    vector : (3,) float64
        y.
    error_information : (3, 3) float64
        Written.
    error_vector : (3,) float64
        Written.
    """
    mixed, inverse = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            mixed[i, j] = information[i, j] * noise[j] + (1.0 if i == j else 0.0)
    _general_inverse(mixed, inverse)
    for i in range(3):
        error_vector[i] = 0.0
        for j in range(3):
            error_vector[i] += inverse[i, j] * vector[j]
            error_information[i, j] = 0.0
            for k in range(3):
                error_information[i, j] += inverse[i, k] * information[k, j]
    for i in range(3):          # rounding
        for j in range(i):
            error_information[i, j] = error_information[j, i] = 0.5 * (error_information[i, j]
                                                                       + error_information[j, i])


@kernel
def update(calibration: Calibration, jacobian: FloatArray, error_information: FloatArray,
           error_vector: FloatArray) -> bool:
    """Update the calibration by the observed error of one segment.

    Parameters
    ----------
    calibration : Calibration
        Changed.
    jacobian : (3, 6) float64
        Derivative of the predicted pose by the calibration.
    error_information, error_vector : (3, 3) and (3,) float64
        Of ``observation``: about the error that is left with the present calibration.

    Returns
    -------
    bool
        False if the observation is an outlier, which changes nothing.
    """
    p, m = calibration.covariance, error_information
    projected = _product(p, jacobian.T)                     # P J^T, (6, 3)
    expected = _product(jacobian, projected)                # J P J^T
    mixed, spread = _product(m, expected), np.empty((3, 3))
    through = _product(mixed, m)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    for i in range(3):
        mixed[i, i] += 1.0
        for j in range(3):
            spread[i, j] = m[i, j] + 0.5 * (through[i, j] + through[j, i])
        spread[i, i] += 1e-9 * trace + 1e-30
    inverse = np.empty((3, 3))
    symmetric_inverse(spread, inverse)
    squared = 0.0
    for i in range(3):
        for j in range(3):
            squared += error_vector[i] * inverse[i, j] * error_vector[j]
    if not squared <= OUTLIER:
        return False
    _general_inverse(mixed, inverse)
    gain = _product(projected, inverse)                     # P J^T (I + M J P J^T)^-1
    for i in range(PARAMETERS):
        for k in range(3):
            calibration.value[i] += gain[i, k] * error_vector[k]
    change = _product(_product(gain, m), projected.T)
    for i in range(PARAMETERS):
        for j in range(i + 1):
            p[i, j] -= 0.5 * (change[i, j] + change[j, i])
            p[j, i] = p[i, j]
    return True


@kernel
def drift(covariance: FloatArray, distance: float, prior: FloatArray, change: FloatArray) -> None:
    """Let the calibration become uncertain while the robot drives, up to its prior.

    Parameters
    ----------
    covariance : (6, 6) float64
        Changed.
    distance : float
        Distance driven [m].
    prior : (6,) float64
        Standard deviations before the first scan.
    change : (6,) float64
        Growth of the variance per metre, as a share of the prior's.
    """
    for k in range(PARAMETERS):
        most = prior[k] * prior[k]
        covariance[k, k] = max(covariance[k, k], min(covariance[k, k] + most * change[k] * abs(distance), most))


@kernel
def share_of_odometry(information: FloatArray, noise: FloatArray, jacobian: FloatArray, out: FloatArray) -> None:
    """Write the derivative of a fused step by the calibration.

    The fused pose is the mean of scan and odometry, weighted by their information. Directions that the scan observes
    well do not depend on the calibration.

    Parameters
    ----------
    information : (3, 3) float64
        Of the scan.
    noise : (3,) float64
        Variances of odometry [m^2, m^2, rad^2].
    jacobian : (3, 6) float64
        Derivative of the predicted pose.
    out : (3, 6) float64
        Written.
    """
    total, inverse = information.copy(), np.empty((3, 3))
    for i in range(3):
        total[i, i] += 1.0 / noise[i]
    symmetric_inverse(total, inverse)
    for i in range(3):
        for j in range(PARAMETERS):
            out[i, j] = 0.0
            for k in range(3):
                out[i, j] += inverse[i, k] * jacobian[k, j] / noise[k]


# ---- smoothing


@kernel
def smooth(records: FloatArray, prior: FloatArray, change: FloatArray, out: FloatArray) -> None:
    """Estimate the calibration at each step from the whole run: filtered forwards, smoothed backwards.

    Parameters
    ----------
    records : (K, RECORD_SIZE) float64
        Data of the StepRecord of each step.
    prior, change : (6,) float64
        As of ``drift``.
    out : (K, 6) float64
        Written: the calibration.

    Notes
    -----
    Rauch, Tung, Striebel: Maximum Likelihood Estimates of Linear Dynamic Systems, AIAA Journal 3(8), 1965.
    """
    count = out.shape[0]
    before, after = np.empty((count, PARAMETERS, PARAMETERS)), np.empty((count, PARAMETERS, PARAMETERS))
    spread, total = np.zeros((PARAMETERS, PARAMETERS)), np.empty((PARAMETERS, PARAMETERS))
    x, right = np.zeros(PARAMETERS), np.empty(PARAMETERS)
    for k in range(PARAMETERS):
        spread[k, k] = prior[k] * prior[k]
    for n in range(count):
        step = record_of(records[n])
        drift(spread, step.forward[0], prior, change)
        symmetric_inverse(spread, before[n])
        for i in range(PARAMETERS):
            right[i] = step.vector[i]
            for j in range(PARAMETERS):
                total[i, j] = before[n, i, j] + step.information[i, j]
                right[i] += before[n, i, j] * x[j]
        symmetric_inverse(total, after[n])
        spread[:] = after[n]
        for i in range(PARAMETERS):
            x[i] = 0.0
            for j in range(PARAMETERS):
                x[i] += spread[i, j] * right[j]
            out[n, i] = x[i]
    for n in range(count - 2, -1, -1):
        for i in range(PARAMETERS):
            right[i] = 0.0
            for j in range(PARAMETERS):
                right[i] += before[n + 1, i, j] * (out[n + 1, j] - out[n, j])
        for i in range(PARAMETERS):
            for j in range(PARAMETERS):
                out[n, i] += after[n, i, j] * right[j]


@kernel
def changed_steps(records: FloatArray, prior: FloatArray, change: FloatArray, out: FloatArray) -> None:
    """Write how much each step changes if it is made with the smoothed calibration.

    Parameters
    ----------
    records, prior, change
        As of ``smooth``.
    out : (K, 3) float64
        Written: in the axes of the pose that the step leads to.
    """
    calibration = np.empty((records.shape[0], PARAMETERS))
    smooth(records, prior, change, calibration)
    for n in range(records.shape[0]):
        step = record_of(records[n])
        for i in range(3):
            out[n, i] = 0.0
            for k in range(PARAMETERS):
                out[n, i] += step.derivative[i, k] * (calibration[n, k] - step.applied[k])
