# SPDX-License-Identifier: BSD-3-Clause
"""Rollouts of model predictive path integral control on a grid of costs (Williams 2016, 2018)."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import Float32Array, FloatArray, Uint8Array

COLLIDES = 253              # a cost of the grid from which on the robot collides
OBSTACLE, COLLISION, AHEAD, ARRIVAL = 0.5, 1000.0, 1.0, 10.0       # weights: see costs_of


@njit(cache=True, nogil=True, error_model='numpy')
def costs_of(grid: Uint8Array, corner: Tuple[float, float, float], state: Tuple[float, float, float],
             goal: Tuple[float, float], nominal: FloatArray, noise: Float32Array,
             options: Tuple[float, float, float, float, float, float]) -> FloatArray:
    """Return the cost (K,) of each disturbed sequence of commands.

    It is the sum over all poses of ``OBSTACLE`` times the share of the grid's cost or ``COLLISION``, of ``AHEAD`` times
    the distance to the goal and the time, ``ARRIVAL`` times the distance at the end, and gamma u Sigma^-1 epsilon.

    Parameters
    ----------
    grid : (H, W) uint8
        Costs around the robot; outside of it there are none.
    corner : (float, float, float)
        x, y of the grid's corner and side of a cell [m].
    state : (float, float, float)
        x, y of the axle and heading [m, m, rad].
    goal : (float, float)
        [m]
    nominal : (T, 2) float64
        Commands [m/s, rad/s].
    noise : (K, T, 2) float32
        Normal, of unit variance.
    options : six floats
        Time step [s], deviation of speed [m/s] and of turning [rad/s], greatest speed and rate, gamma.
    """
    step, deviation_v, deviation_w, most_v, most_w, gamma = options
    count, length = noise.shape[0], nominal.shape[0]
    rows, columns = grid.shape
    costs = np.empty(count)
    for k in range(count):
        x, y, yaw = state
        total = 0.0
        for t in range(length):
            v = min(max(nominal[t, 0] + deviation_v * noise[k, t, 0], 0.0), most_v)
            w = min(max(nominal[t, 1] + deviation_w * noise[k, t, 1], -most_w), most_w)
            total += gamma * (nominal[t, 0] * noise[k, t, 0] / deviation_v
                              + nominal[t, 1] * noise[k, t, 1] / deviation_w)
            yaw += w * step
            x += v * step * math.cos(yaw)
            y += v * step * math.sin(yaw)
            row, column = int((y - corner[1]) / corner[2]), int((x - corner[0]) / corner[2])
            if 0 <= row < rows and 0 <= column < columns:
                cost = grid[row, column]
                total += COLLISION if cost >= COLLIDES else OBSTACLE * cost / (COLLIDES - 1)
            total += AHEAD * step * math.hypot(goal[0] - x, goal[1] - y)
        costs[k] = total + ARRIVAL * math.hypot(goal[0] - x, goal[1] - y)
    return costs


@njit(cache=True, nogil=True, error_model='numpy')
def improve(nominal: FloatArray, noise: Float32Array, costs: FloatArray, options: Tuple[float, float, float]) -> None:
    """Add the disturbances to the commands with the weights exp(-(cost - least) / lambda).

    Parameters
    ----------
    nominal : (T, 2) float64
        Changed.
    noise : (K, T, 2) float32
    costs : (K,) float64
    options : three floats
        Deviation of speed [m/s] and of turning [rad/s], lambda.
    """
    least, total = np.min(costs), 0.0
    change = np.zeros_like(nominal)
    for k in range(len(costs)):
        weight = math.exp(-(costs[k] - least) / options[2])
        total += weight
        if weight > 1e-9:
            for t in range(nominal.shape[0]):
                change[t, 0] += weight * noise[k, t, 0]
                change[t, 1] += weight * noise[k, t, 1]
    for t in range(nominal.shape[0]):
        nominal[t, 0] += options[0] * change[t, 0] / total
        nominal[t, 1] += options[1] * change[t, 1] / total
