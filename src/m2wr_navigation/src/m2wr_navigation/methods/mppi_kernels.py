# SPDX-License-Identifier: BSD-3-Clause
"""Rollouts of model predictive path integral control on distances to obstacles and the goal (Williams 2016, 2018)."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray

CHECKED = 0.08, 0.15        # m, rad: a sample is checked after each such way or turn
LOOKS = 0.2                 # s: and after each such time, where something moves
COLLISION = 1000.0          # s: cost of a sample that collides, less the time until then


class RolloutSettings(NamedTuple):
    """What does not change between two cycles.

    Attributes
    ----------
    step : float
        Time of a command [s].
    least_v, most_v, most_w : float
        Limits of speed and turning [m/s, m/s, rad/s].
    change_v, change_w : float
        Greatest change of them in a step.
    sideways : float
        Greatest acceleration to the side [m/s^2].
    deviation_v, deviation_w : float
        Of the disturbances.
    margin, near : float
        Clearance below which a pose collides, and below which it costs [m].
    near_weight, turn_weight, back_weight : float
        Cost of a second with no clearance at the greatest speed, of a radian, and of a second backwards [s].
    gamma : float
        Weight of the cost of the commands themselves.
    tolerance : float
        Distance to the goal at which it is reached [m]; 0: it is out of reach.
    """

    step: float
    least_v: float
    most_v: float
    most_w: float
    change_v: float
    change_w: float
    sideways: float
    deviation_v: float
    deviation_w: float
    margin: float
    near: float
    near_weight: float
    turn_weight: float
    back_weight: float
    gamma: float
    tolerance: float


@kernel
def sample(grid: Float32Array, corner: FloatArray, x: float, y: float, scale: float = 1.0) -> float:
    """Return the bilinear value of a grid between the centres of its cells; outside that of the nearest cell.

    Parameters
    ----------
    grid : (H, W) float32
    corner : (3,) float64
        x, y of the grid's corner and side of a cell [m].
    x, y : float
        [m]
    scale : float
        Of this grid's cells against those of ``corner``.
    """
    side = scale * corner[2]
    column = min(max((x - corner[0]) / side - 0.5, 0.0), grid.shape[1] - 1.001)
    row = min(max((y - corner[1]) / side - 0.5, 0.0), grid.shape[0] - 1.001)
    r, c = int(row), int(column)
    up, right = row - r, column - c
    return ((1.0 - up) * ((1.0 - right) * grid[r, c] + right * grid[r, c + 1])
            + up * ((1.0 - right) * grid[r + 1, c] + right * grid[r + 1, c + 1]))


@kernel
def clearance_of(distance: Float32Array, corner: FloatArray, discs: FloatArray, x: float, y: float,
                 yaw: float, enough: float) -> float:
    """Return the least distance of the robot from an obstacle, negative inside of one [m]; where it is large, less.

    Parameters
    ----------
    distance : (H, W) float32
        To the nearest obstacle [m].
    corner : (3,) float64
        See :func:`sample`.
    discs : (N, 3) float64
        The first covers all others, which cover the robot: x, y in its frame, radius [m].
    x, y, yaw : float
        Of the axle [m, m, rad].
    enough : float
        A greater one may be reported as less, but not as less than this [m].
    """
    cosine, sine = math.cos(yaw), math.sin(yaw)
    least = np.inf
    for k in range(discs.shape[0]):
        ahead, left = discs[k, 0], discs[k, 1]
        away = sample(distance, corner, x + cosine * ahead - sine * left, y + sine * ahead + cosine * left)
        if k == 0 and away - discs[0, 2] >= enough:
            return away - discs[0, 2]
        if k > 0:
            least = min(least, away - discs[k, 2])
    return least


@kernel
def apart_from(movers: FloatArray, allowed: FloatArray, discs: FloatArray, x: float, y: float, yaw: float,
               time: float, enough: float) -> Tuple[float, bool]:
    """Return the least distance of the robot from what moves, negative inside [m], and whether one is too small.

    Where a distance is large, it counts as infinite.

    Parameters
    ----------
    movers : (M, 5) float64
        x, y [m], velocity [m/s], and radius [m].
    allowed : (M,) float64
        Least distance of each [m].
    discs, x, y, yaw, enough
        As of :func:`clearance_of`.
    time : float
        Since the movers were there [s].
    """
    cosine, sine = math.cos(yaw), math.sin(yaw)
    least, hit = np.inf, False
    for m in range(movers.shape[0]):
        across = movers[m, 0] + time * movers[m, 2] - x
        up = movers[m, 1] + time * movers[m, 3] - y
        ahead, left = cosine * across + sine * up, cosine * up - sine * across      # in the robot's frame
        radius = movers[m, 4]
        if math.hypot(ahead - discs[0, 0], left - discs[0, 1]) - discs[0, 2] - radius >= enough:
            continue
        apart = np.inf
        for k in range(1, discs.shape[0]):
            apart = min(apart, math.hypot(ahead - discs[k, 0], left - discs[k, 1]) - discs[k, 2] - radius)
        least, hit = min(least, apart), hit or apart < allowed[m]
    return least, hit


@kernel
def command_of(nominal: FloatArray, knots: Float32Array, t: int, settings: RolloutSettings) -> Tuple[float, float]:
    """Return a disturbed command within the limits.

    Parameters
    ----------
    nominal : (T, 2) float64
        Speed and rate of turning [m/s, rad/s].
    knots : (N, 2) float32
        Disturbances at even times, in deviations; between them they are linear.
    t : int
        Which command.
    settings : RolloutSettings
    """
    place = t * (knots.shape[0] - 1) / max(nominal.shape[0] - 1, 1)
    k = min(int(place), knots.shape[0] - 2)
    share = place - k
    v = nominal[t, 0] + settings.deviation_v * ((1.0 - share) * knots[k, 0] + share * knots[k + 1, 0])
    w = nominal[t, 1] + settings.deviation_w * ((1.0 - share) * knots[k, 1] + share * knots[k + 1, 1])
    return min(max(v, settings.least_v), settings.most_v), min(max(w, -settings.most_w), settings.most_w)


@kernel
def reached(v: float, w: float, to_v: float, to_w: float, settings: RolloutSettings) -> Tuple[float, float]:
    """Return the velocities after a step in which others are wanted [m/s, rad/s].

    Parameters
    ----------
    v, w, to_v, to_w : float
        Present and wanted speed and rate of turning [m/s, rad/s].
    settings : RolloutSettings
    """
    v += min(max(to_v - v, -settings.change_v), settings.change_v)
    most = settings.sideways / max(abs(v), 1e-3)
    to_w = min(max(to_w, -most), most)
    return v, w + min(max(to_w - w, -settings.change_w), settings.change_w)


@kernel
def _least_distances(movers: FloatArray, discs: FloatArray, state: FloatArray, settings: RolloutSettings) -> FloatArray:
    """Return the least distance (M,) that is allowed from each that moves [m]: what is too near may get no nearer."""
    allowed = np.zeros(movers.shape[0])
    for m in range(movers.shape[0]):
        apart, _ = apart_from(movers[m:m + 1], allowed, discs, state[0], state[1], state[2], 0.0, settings.near)
        allowed[m] = min(settings.margin, apart - 1e-3)
    return allowed


@kernel
def cost_of(distance: Float32Array, to_goal: Float32Array, corner: FloatArray, discs: FloatArray,
            movers: FloatArray, state: FloatArray, nominal: FloatArray, knots: Float32Array,
            settings: RolloutSettings) -> float:
    """Return the cost of a disturbed sequence of commands [s].

    It is the time on the way, the time that the rest of the way would take at the greatest speed, what nearness to
    obstacles, turning and driving backwards cost, and gamma u Sigma^-1 epsilon.

    Parameters
    ----------
    distance, to_goal : (H, W) and (H / 2, W / 2) float32
        To the nearest obstacle, and along the way to the goal, in cells of twice the side [m].
    corner : (3,) float64
        See :func:`sample`.
    discs : (N, 3) float64
        See :func:`clearance_of`.
    movers : (M, 5) float64
        See :func:`apart_from`.
    state : (5,) float64
        Axle, heading, and velocities now [m, m, rad, m/s, rad/s].
    nominal : (T, 2) float64
    knots : (N, 2) float32
    settings : RolloutSettings
    """
    allowed = _least_distances(movers, discs, state, settings)
    return _cost_of(distance, to_goal, corner, discs, movers, allowed, state, nominal, knots, settings)


@kernel
def _cost_of(distance: Float32Array, to_goal: Float32Array, corner: FloatArray, discs: FloatArray,
             movers: FloatArray, allowed: FloatArray, state: FloatArray, nominal: FloatArray, knots: Float32Array,
             settings: RolloutSettings) -> float:
    """Return :func:`cost_of`, with the least distances from what moves."""
    x, y, yaw, v, w = state[0], state[1], state[2], state[3], state[4]
    # where the robot is too near already it has to get no nearer
    least = min(settings.margin, clearance_of(distance, corner, discs, x, y, yaw, settings.near) - 1e-3)
    apart, hit = np.inf, False
    looks = max(1, int(LOOKS / settings.step))
    total, length = 0.0, nominal.shape[0]
    clearance = ahead = turned = np.inf
    for t in range(length):
        to_v, to_w = command_of(nominal, knots, t, settings)
        v, w = reached(v, w, to_v, to_w, settings)
        middle = yaw + 0.5 * w * settings.step
        x += v * settings.step * math.cos(middle)
        y += v * settings.step * math.sin(middle)
        yaw += w * settings.step
        ahead, turned = ahead + abs(v) * settings.step, turned + abs(w) * settings.step
        if ahead >= CHECKED[0] or turned >= CHECKED[1] or t == length - 1:
            clearance = clearance_of(distance, corner, discs, x, y, yaw, settings.near)
            ahead = turned = 0.0
        if movers.shape[0] and (ahead == 0.0 or t % looks == 0):
            apart, hit = apart_from(movers, allowed, discs, x, y, yaw, (t + 1) * settings.step, settings.near)
        if clearance < least or hit:
            return COLLISION + total - 2.0 * t * settings.step
        total += settings.step + settings.turn_weight * abs(w) * settings.step
        if v < 0.0:
            total += settings.back_weight * settings.step
        nearest = min(clearance, apart)
        if nearest < settings.near:
            share = (settings.near - max(nearest, 0.0)) / settings.near
            total += settings.near_weight * share * share * (0.1 + abs(v) / settings.most_v) * settings.step
        total += settings.gamma * settings.step * (
            nominal[t, 0] * (to_v - nominal[t, 0]) / settings.deviation_v ** 2
            + nominal[t, 1] * (to_w - nominal[t, 1]) / settings.deviation_w ** 2)
        if settings.tolerance > 0.0 and sample(to_goal, corner, x, y, 2.0) < settings.tolerance:
            return total
    return total + sample(to_goal, corner, x, y, 2.0) / settings.most_v


@kernel
def costs_of(distance: Float32Array, to_goal: Float32Array, corner: FloatArray, discs: FloatArray,
             movers: FloatArray, state: FloatArray, nominal: FloatArray, arcs: FloatArray, noise: Float32Array,
             settings: RolloutSettings) -> FloatArray:
    """Return the cost (K,) of each sample [s].

    Parameters
    ----------
    distance, to_goal, corner, discs, movers, state, nominal, settings
        As of :func:`cost_of`.
    arcs : (A, 2) float64
        The first samples: constant commands [m/s, rad/s].
    noise : (K, N, 2) float32
        Disturbances; those of the first A samples are not used.
    """
    costs, allowed = np.empty(noise.shape[0]), _least_distances(movers, discs, state, settings)
    calm = np.zeros((2, 2), np.float32)
    constant = np.empty_like(nominal)
    for k in range(len(costs)):
        if k < arcs.shape[0]:
            constant[:, 0] = arcs[k, 0]
            constant[:, 1] = arcs[k, 1]
            costs[k] = _cost_of(distance, to_goal, corner, discs, movers, allowed, state, constant, calm, settings)
        else:
            costs[k] = _cost_of(distance, to_goal, corner, discs, movers, allowed, state, nominal, noise[k], settings)
    return costs


@kernel
def weighted_mean(nominal: FloatArray, arcs: FloatArray, noise: Float32Array, costs: FloatArray, temperature: float,
                  settings: RolloutSettings) -> FloatArray:
    """Return the mean (T, 2) of all samples with the weights exp(-(cost - least) / temperature).

    Parameters
    ----------
    nominal, arcs, noise, settings
        As of :func:`costs_of`.
    costs : (K,) float64
    temperature : float
        [s]
    """
    least, sum_of_weights = np.min(costs), 0.0
    mean = np.zeros_like(nominal)
    for k in range(len(costs)):
        weight = math.exp(-(costs[k] - least) / temperature)
        if weight < 1e-6:
            continue
        sum_of_weights += weight
        for t in range(nominal.shape[0]):
            if k < arcs.shape[0]:
                v, w = arcs[k, 0], arcs[k, 1]
            else:
                v, w = command_of(nominal, noise[k], t, settings)
            mean[t, 0] += weight * v
            mean[t, 1] += weight * w
    return mean / sum_of_weights
