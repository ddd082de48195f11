# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of odometry and of the laser's mount by scan matches: one filter with one set of equations.

The state has the six components of ``track.PARAMETERS``. A step of odometry depends on all of them, and its Jacobian is
propagated along the segment between two processed scans. The scan observes the error of the predicted pose with its own
information. Directions that it does not observe have no information and change nothing.

Result rows are those of ``match_kernels``.
"""
from __future__ import annotations

import math
from typing import Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.information_kernels import fused_covariance
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
from m2wr_maps.linear_kernels import inverse, product, transformed
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
def observation(information: FloatArray, noise: FloatArray, vector: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Return what a scan says about the systematic error of a segment, with the random error of odometry unknown.

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

    Returns
    -------
    error_information : (3, 3) float64
    error_vector : (3,) float64
    """
    share = inverse(np.eye(3) + information * noise)
    found = product(share, information)
    return 0.5 * (found + found.T), transformed(share, vector)      # symmetric but for rounding


@kernel
def update(calibration: Calibration, jacobian: FloatArray, error_information: FloatArray,
           error_vector: FloatArray) -> bool:
    """Update the calibration by the observed error of one segment: a Kalman filter whose measurement is information.

    Parameters
    ----------
    calibration : Calibration
        Changed.
    jacobian : (3, 6) float64
        Derivative J of the predicted pose by the calibration.
    error_information, error_vector : (3, 3) and (3,) float64
        M and its vector, of ``observation``: about the error that is left with the present calibration.

    Returns
    -------
    bool
        False if the observation is an outlier, which changes nothing.
    """
    m, projected = error_information, product(calibration.covariance, jacobian.T)   # P J^T
    mixed = product(m, product(jacobian, projected))                                # M J P J^T
    through = product(mixed, m)
    spread = m + 0.5 * (through + through.T) + (1e-9 * np.trace(m) + 1e-30) * np.eye(3)    # covariance of the vector
    if not (error_vector * transformed(inverse(spread), error_vector)).sum() <= OUTLIER:
        return False
    gain = product(projected, inverse(np.eye(3) + mixed))                           # P J^T (I + M J P J^T)^-1
    change = product(product(gain, m), projected.T)
    calibration.value[:] += transformed(gain, error_vector)
    calibration.covariance[:] -= 0.5 * (change + change.T)
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
def share_of_odometry(information: FloatArray, noise: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return the derivative (3, 6) of a fused step by the calibration.

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
    """
    return product(fused_covariance(information, noise) / noise, jacobian)


# ---- smoothing


@kernel
def smooth(records: FloatArray, prior: FloatArray, change: FloatArray) -> FloatArray:
    """Return the calibration at each step, estimated from the whole run: filtered forwards, smoothed backwards.

    Parameters
    ----------
    records : (K, RECORD_SIZE) float64
        Data of the StepRecord of each step.
    prior, change : (6,) float64
        As of ``drift``.

    Returns
    -------
    (K, 6) float64

    Notes
    -----
    Rauch, Tung, Striebel: Maximum Likelihood Estimates of Linear Dynamic Systems, AIAA Journal 3(8), 1965.
    """
    count = records.shape[0]
    before, after = np.empty((count, PARAMETERS, PARAMETERS)), np.empty((count, PARAMETERS, PARAMETERS))
    spread, value, out = np.diag(prior * prior), np.zeros(PARAMETERS), np.empty((count, PARAMETERS))
    for n in range(count):
        step = record_of(records[n])
        drift(spread, step.forward[0], prior, change)
        before[n] = inverse(spread)
        spread = inverse(before[n] + step.information)
        value = transformed(spread, transformed(before[n], value) + step.vector)
        after[n], out[n] = spread, value
    for n in range(count - 2, -1, -1):
        out[n] += transformed(after[n], transformed(before[n + 1], out[n + 1] - out[n]))
    return out


@kernel
def changed_steps(records: FloatArray, prior: FloatArray, change: FloatArray) -> FloatArray:
    """Return how much each step changes if it is made with the smoothed calibration.

    Parameters
    ----------
    records, prior, change
        As of ``smooth``.

    Returns
    -------
    (K, 3) float64
        In the axes of the pose that the step leads to.
    """
    calibration, out = smooth(records, prior, change), np.empty((records.shape[0], 3))
    for n in range(records.shape[0]):
        step = record_of(records[n])
        out[n] = transformed(step.derivative, calibration[n] - step.applied)
    return out
