# SPDX-License-Identifier: BSD-3-Clause
"""The poses through which a robot comes before it has stopped, and the gap between two robots on their ways."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray


@kernel
def stopping_poses(pose: FloatArray, velocity: FloatArray, held: float, brakes: FloatArray, step: float) -> FloatArray:
    """Return the poses of a robot that keeps its velocity for a while and then brakes.

    Parameters
    ----------
    pose : (3,) float64
        [m, m, rad]
    velocity : (2,) float64
        Forward and about z [m/s, rad/s].
    held : float
        Time without braking [s].
    brakes : (2,) float64
        Decelerations [m/s^2, rad/s^2].
    step : float
        Between two poses [s].

    Returns
    -------
    (N, 3) float64
        The first is the given one [m, m, rad].
    """
    ends = held + max(abs(velocity[0]) / brakes[0], abs(velocity[1]) / brakes[1])
    count = int(math.ceil(ends / step)) + 1
    poses = np.empty((count, 3))
    x, y, yaw = pose[0], pose[1], pose[2]
    for k in range(count):
        poses[k, 0], poses[k, 1], poses[k, 2] = x, y, yaw
        since = max(0.0, (k + 0.5) * step - held)
        forward = math.copysign(max(0.0, abs(velocity[0]) - brakes[0] * since), velocity[0])
        turn = math.copysign(max(0.0, abs(velocity[1]) - brakes[1] * since), velocity[1])
        x += forward * step * math.cos(yaw + 0.5 * turn * step)
        y += forward * step * math.sin(yaw + 0.5 * turn * step)
        yaw += turn * step
    return poses


@kernel
def _apart(first: FloatArray, second: FloatArray) -> float:
    """Return the greatest gap between two convex outlines (K, 2) along the normals of the first one [m]."""
    best = -np.inf
    before = len(first) - 1
    for k in range(len(first)):
        across, up = first[k, 1] - first[before, 1], first[before, 0] - first[k, 0]
        length = math.hypot(across, up)
        before = k
        if length < 1e-9:
            continue
        least = np.inf
        for j in range(len(second)):
            least = min(least, (across * (second[j, 0] - first[k, 0]) + up * (second[j, 1] - first[k, 1])) / length)
        best = max(best, least)
    return best


@kernel
def _placed(outline: FloatArray, pose: FloatArray, out: FloatArray) -> None:
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(outline)):
        out[k, 0] = pose[0] + cosine * outline[k, 0] - sine * outline[k, 1]
        out[k, 1] = pose[1] + sine * outline[k, 0] + cosine * outline[k, 1]


@kernel
def least_gap(first: FloatArray, second: FloatArray, outline: FloatArray, enough: float) -> float:
    """Return the least gap between two robots, each at any of its poses, by the theorem of the separating axis.

    Parameters
    ----------
    first, second : (N, 3), (M, 3) float64
        Poses [m, m, rad].
    outline : (K, 2) float64
        Convex, its corners anticlockwise, in the robots' frames [m].
    enough : float
        A greater gap need not be told apart [m].

    Returns
    -------
    float
        At most the true distance; negative: they overlap by so much. At most ``enough`` [m].
    """
    reach = 0.0
    for k in range(len(outline)):
        reach = max(reach, math.hypot(outline[k, 0], outline[k, 1]))
    one, other = np.empty(outline.shape), np.empty(outline.shape)
    least = enough
    for i in range(len(first)):
        _placed(outline, first[i], one)
        for j in range(len(second)):
            if math.hypot(first[i, 0] - second[j, 0], first[i, 1] - second[j, 1]) - 2.0 * reach >= least:
                continue
            _placed(outline, second[j], other)
            least = min(least, max(_apart(one, other), _apart(other, one)))
    return least
