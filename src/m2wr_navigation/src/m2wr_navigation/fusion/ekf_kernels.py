# SPDX-License-Identifier: BSD-3-Clause
"""Prediction and correction of the extended Kalman filter with 15 states.

State: x y z [m], roll pitch yaw [rad] in the world; velocities [m/s], angular velocities [rad/s] and accelerations
[m/s^2] in the body.  Model: constant acceleration and angular velocity in the body, Euler rates (T. Moore, D. Stouch:
A generalized extended Kalman filter implementation for the Robot Operating System, IAS-13, 2014).
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray

SIZE = 15
ANGLE, SPEED, TURN, ACCELERATION = 3, 6, 9, 12      # where these parts of the state begin
SMALLEST = 1e-9         # variance of a measurement
UPRIGHT = 1e-6          # |cos(pitch)| below which Euler rates are not defined


@kernel
def wrap(angle: float) -> float:
    """Return an angle in [-pi, pi] [rad]."""
    return math.atan2(math.sin(angle), math.cos(angle))


@kernel
def rotation(roll: float, pitch: float, yaw: float, derivative: int) -> FloatArray:
    """Return the rotation of body vectors into the world, or its derivative.

    Parameters
    ----------
    roll, pitch, yaw : float
        Fixed-axis angles [rad], REP 103.
    derivative : int
        0, 1, 2: by roll, pitch, yaw; -1: the rotation itself.

    Returns
    -------
    (3, 3) float64
    """
    parts = np.zeros((3, 3, 3))
    for axis, angle in enumerate((roll, pitch, yaw)):
        c, s, one = math.cos(angle), math.sin(angle), 1.0
        if axis == derivative:
            c, s, one = -s, c, 0.0
        first, second = (axis + 1) % 3, (axis + 2) % 3
        parts[axis, axis, axis] = one
        parts[axis, first, first] = parts[axis, second, second] = c
        parts[axis, second, first], parts[axis, first, second] = s, -s
    return parts[2] @ parts[1] @ parts[0]


@kernel
def predict(state: FloatArray, covariance: FloatArray, noise: FloatArray, step: float) -> None:
    """Advance the state and its covariance.

    Parameters
    ----------
    state : (15,) float64
        Changed in place.
    covariance : (15, 15) float64
        Changed in place.
    noise : (15, 15) float64
        Process noise of one second.
    step : float
        Time [s].
    """
    roll, pitch, yaw = state[3], state[4], state[5]
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    if abs(cp) < UPRIGHT:
        cp = math.copysign(UPRIGHT, cp)
    turn = state[TURN:ACCELERATION].copy()
    way = state[SPEED:TURN] * step + state[ACCELERATION:] * (0.5 * step * step)
    body = rotation(roll, pitch, yaw, -1)
    tilt = sr * turn[1] + cr * turn[2]              # rate of yaw times cos(pitch)
    jacobian = np.eye(SIZE)
    for axis in range(3):
        jacobian[:3, ANGLE + axis] = rotation(roll, pitch, yaw, axis) @ way
        jacobian[SPEED + axis, ACCELERATION + axis] = step
    jacobian[:3, SPEED:TURN] = body * step
    jacobian[:3, ACCELERATION:] = body * (0.5 * step * step)
    rates = np.array([[1.0, sr * sp / cp, cr * sp / cp], [0.0, cr, -sr], [0.0, sr / cp, cr / cp]])
    jacobian[ANGLE:SPEED, TURN:ACCELERATION] = rates * step
    across = cr * turn[1] - sr * turn[2]            # derivative of tilt by roll
    jacobian[3, 3] += across * sp / cp * step
    jacobian[4, 3] -= tilt * step
    jacobian[5, 3] += across / cp * step
    jacobian[3, 4] += tilt / (cp * cp) * step
    jacobian[5, 4] += tilt * sp / (cp * cp) * step
    state[:3] += body @ way
    state[ANGLE:SPEED] += rates @ turn * step
    state[SPEED:TURN] += state[ACCELERATION:] * step
    for axis in range(ANGLE, SPEED):
        state[axis] = wrap(state[axis])
    covariance[:, :] = jacobian @ covariance @ jacobian.T + noise * step


@kernel
def correct(state: FloatArray, covariance: FloatArray, members: IndexArray, values: FloatArray, variances: FloatArray,
            threshold: float) -> bool:
    """Correct the state by a measurement of some of its members; Joseph form.

    Parameters
    ----------
    state : (15,) float64
        Changed in place.
    covariance : (15, 15) float64
        Changed in place.
    members : (N,) int64
        Which members were measured.
    values : (N,) float64
        What was measured.
    variances : (N, N) float64
        Covariance of the measurement; on the diagonal the size counts, at least 1e-9.
    threshold : float
        Largest Mahalanobis distance.

    Returns
    -------
    bool
        Whether the measurement was used.
    """
    count = len(members)
    residual, noise = np.empty(count), variances.copy()
    select = np.zeros((count, SIZE))
    for row in range(count):
        member = members[row]
        select[row, member] = 1.0
        residual[row] = values[row] - state[member]
        if ANGLE <= member < SPEED:
            residual[row] = wrap(residual[row])
        noise[row, row] = max(abs(noise[row, row]), SMALLEST)
    spread = covariance @ select.T
    inverse = np.linalg.inv(select @ spread + noise)
    distance = residual @ inverse @ residual
    if not distance < threshold * threshold:
        return False
    gain = spread @ inverse
    state += gain @ residual
    for axis in range(ANGLE, SPEED):
        state[axis] = wrap(state[axis])
    kept = np.eye(SIZE) - gain @ select
    covariance[:, :] = kept @ covariance @ kept.T + gain @ noise @ gain.T
    return True
