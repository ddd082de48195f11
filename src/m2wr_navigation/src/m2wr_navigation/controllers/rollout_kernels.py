# SPDX-License-Identifier: BSD-3-Clause
"""Roll-outs of velocity samples: poses, and scores."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.controllers.distance_kernels import BLOCKED
from m2wr_navigation.costmap.cost_layout import LETHAL, NO_INFORMATION
from m2wr_navigation.costmap.footprint_kernels import IN_UNKNOWN, OUTSIDE, outline_cost
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Uint8Array

#: Why a sample is rejected; 0: it is not.
VALID, OBSTACLE, UNKNOWN, OFF_MAP, NO_WAY, BARRED, WORSE = 0, 1, 2, 3, 4, 5, 6


@kernel
def roll_out(start: FloatArray, velocity: FloatArray, sample: FloatArray, acceleration: FloatArray, duration: float,
             steps: int, out: FloatArray) -> None:
    """Compute the poses of a robot that is given a velocity, by Euler's method.

    Parameters
    ----------
    start : (3,) float64
        x, y, theta [m, m, rad].
    velocity, sample : (3,) float64
        Present velocity, and the one that is given, in the base frame [m/s, m/s, rad/s].
    acceleration : (3,) float64
        With which the velocity approaches the sample [m/s^2, m/s^2, rad/s^2]; infinite: at once.
    duration : float
        [s]
    steps : int
        At most the rows of ``out``.
    out : (S, 3) float64
        The first ``steps`` rows are written: the start, and the pose after each step but the last.
    """
    step = duration / steps
    x, y, theta = start
    v, s, w = velocity
    for k in range(steps):
        out[k, 0], out[k, 1], out[k, 2] = x, y, theta
        v += min(max(sample[0] - v, -acceleration[0] * step), acceleration[0] * step)
        s += min(max(sample[1] - s, -acceleration[1] * step), acceleration[1] * step)
        w += min(max(sample[2] - w, -acceleration[2] * step), acceleration[2] * step)
        x += (v * math.cos(theta) - s * math.sin(theta)) * step
        y += (v * math.sin(theta) + s * math.cos(theta)) * step
        theta += w * step


@kernel
def step_count(sample: FloatArray, duration: float, granularity: float, angular_granularity: float, most: int) -> int:
    """Return the number of poses of a roll-out (at least 1).

    Parameters
    ----------
    sample : (3,) float64
    duration : float
        ``sim_time`` [s].
    granularity, angular_granularity : float
        Distance and turn between two poses [m, rad].
    most : int
    """
    wanted = max(math.hypot(sample[0], sample[1]) * duration / granularity,
                 abs(sample[2]) * duration / angular_granularity)
    return max(1, int(math.ceil(min(wanted, float(most)))))


@kernel
def poses_after(samples: FloatArray, start: FloatArray, velocity: FloatArray, acceleration: FloatArray,
                rolled: FloatArray, out: FloatArray) -> None:
    """Compute the last pose of the roll-out of each sample.

    Parameters
    ----------
    samples : (N, 3) float64
        Velocities [m/s, m/s, rad/s].
    start, velocity, acceleration : (3,) float64
        As for :func:`roll_out`.
    rolled : (4,) float64
        Duration [s], sim_granularity [m], angular_sim_granularity [rad], greatest number of poses.
    out : (N, 3) float64
        Written [m, m, rad].
    """
    most = int(rolled[3])
    poses = np.empty((most, 3))
    for i in range(len(samples)):
        steps = step_count(samples[i], rolled[0], rolled[1], rolled[2], most)
        roll_out(start, velocity, samples[i], acceleration, rolled[0], steps, poses)
        out[i] = poses[steps - 1]


@kernel
def _at(grid: Float32Array, resolution: float, origin: FloatArray, x: float, y: float) -> float:
    """Return the value of the cell at a point, or -1 off the grid."""
    across, up = (x - origin[0]) / resolution, (y - origin[1]) / resolution
    if not (0.0 <= across < grid.shape[1] and 0.0 <= up < grid.shape[0]):
        return -1.0
    return float(grid[int(up), int(across)])


@kernel
def _outline(costs: Uint8Array, resolution: float, origin: FloatArray, footprint: FloatArray, poses: FloatArray,
             steps: int, place: FloatArray) -> Tuple[int, int]:
    """Return the greatest cost below the outline and the centre of a roll-out, and why it is rejected."""
    greatest = 0
    for k in range(steps):
        x, y, theta = poses[k]
        cost = outline_cost(costs, resolution, origin, footprint, x, y, theta)
        if cost >= 0:
            centre = costs[int((y - origin[1]) / resolution), int((x - origin[0]) / resolution)]
            if centre == LETHAL:
                cost = -1
            elif centre == NO_INFORMATION:
                cost = IN_UNKNOWN
            else:
                greatest = max(greatest, cost, int(centre))
        if cost < 0:
            place[0], place[1] = x, y
            return 0, UNKNOWN if cost == IN_UNKNOWN else OFF_MAP if cost == OUTSIDE else OBSTACLE
    return greatest, VALID


@kernel
def score_samples(samples: FloatArray, extra: FloatArray, barred: FloatArray, start: FloatArray,
                  velocity: FloatArray, acceleration: FloatArray, settings: FloatArray, costs: Uint8Array,
                  resolution: float, origin: FloatArray, footprint: FloatArray, grids: Float32Array, totals: FloatArray,
                  reasons: IndexArray, places: FloatArray) -> int:
    """Return the index of the best velocity sample, or -1 if none is valid.

    Parameters
    ----------
    samples : (N, 3) float64
        Velocities [m/s, m/s, rad/s].
    extra : (N,) float64
        Added to the cost of each sample; at least 0.
    barred : (3, 2) float64
        For x, y and theta: 1 if negative, and if positive velocities are barred because of oscillation.
    start, velocity, acceleration : (3,) float64
        As for :func:`roll_out`.
    settings : (15,) float64
        sim_time, sim_granularity, angular_sim_granularity, scale of the path's distance, of the goal's, of the front
        goal's, of the alignment, of the obstacles' cost, of the turn rate, forward_point_distance, scaling_speed,
        max_scaling_factor, max_vel_trans, greatest number of poses, and 1 if each sample is examined to the end.
    costs, resolution, origin
        The local costmap.
    footprint : (K, 2) float64
        Padded corners [m].
    grids : (3, H, W) float32
        Distances to the path, to the goal, and to the goal moved ahead, in cells, as of ``spread_distances``.
    totals : (N,) float64
        Written: the cost of each valid sample.
    reasons : (N,) int64
        Written: VALID, or why the sample is rejected; WORSE: not examined further, because it could not be the best.
    places : (N, 2) float64
        Written: where a rejected sample fails [m].
    """
    duration, granularity, turn_granularity, path_scale, goal_scale, front_scale, align_scale = settings[:7]
    obstacle_scale, twirl_scale, nose, scaling_speed, scaling, fastest = settings[7:13]
    most, complete = int(settings[13]), settings[14] > 0.0
    poses = np.empty((most, 3))
    scaled = np.empty_like(footprint)
    best, least = -1, math.inf
    for i in range(len(samples)):
        sample = samples[i]
        totals[i], reasons[i] = math.inf, VALID
        places[i, 0], places[i, 1] = start[0], start[1]
        for axis in range(3):
            if (barred[axis, 0] > 0.0 and sample[axis] < 0.0) or (barred[axis, 1] > 0.0 and sample[axis] > 0.0):
                reasons[i] = BARRED
        if reasons[i] != VALID:
            continue
        steps = step_count(sample, duration, granularity, turn_granularity, most)
        roll_out(start, velocity, sample, acceleration, duration, steps, poses)
        path = goal = 0.0
        for k in range(steps):
            path = _at(grids[0], resolution, origin, poses[k, 0], poses[k, 1])
            goal = _at(grids[1], resolution, origin, poses[k, 0], poses[k, 1])
            if path < 0.0 or path >= BLOCKED or goal >= BLOCKED:
                reasons[i] = OFF_MAP if path < 0.0 else OBSTACLE if path == BLOCKED or goal == BLOCKED else NO_WAY
                places[i, 0], places[i, 1] = poses[k, 0], poses[k, 1]
                break
        if reasons[i] != VALID:
            continue
        last = poses[steps - 1]
        front_x, front_y = last[0] + nose * math.cos(last[2]), last[1] + nose * math.sin(last[2])
        front = _at(grids[2], resolution, origin, front_x, front_y)
        aligned = _at(grids[0], resolution, origin, front_x, front_y)
        if front < 0.0 and (front_scale > 0.0 or align_scale > 0.0):
            reasons[i] = OFF_MAP
            places[i, 0], places[i, 1] = front_x, front_y
            continue
        total = path_scale * path + goal_scale * goal + front_scale * front + align_scale * aligned \
            + twirl_scale * abs(sample[2]) + extra[i]
        if total >= least and not complete:
            reasons[i] = WORSE
            continue
        speed = math.hypot(sample[0], sample[1])
        factor = 1.0
        if speed > scaling_speed and fastest > scaling_speed:
            factor += scaling * (speed - scaling_speed) / (fastest - scaling_speed)
        for k in range(len(footprint)):
            scaled[k, 0], scaled[k, 1] = factor * footprint[k, 0], factor * footprint[k, 1]
        cost, reason = _outline(costs, resolution, origin, scaled, poses, steps, places[i])
        if reason != VALID:
            reasons[i] = reason
            continue
        total += obstacle_scale * cost
        totals[i] = total
        if total < least:
            best, least = i, total
    return best
