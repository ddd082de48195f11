# SPDX-License-Identifier: BSD-3-Clause
"""Right of way: robots that tell each other pose and velocity never collide.

Each robot has a sweep: the poses through which it comes before it has stopped. As long as the sweeps of all robots are
apart, every robot can stop without a contact. In the order of their priority robots choose commands; one may only take
a command whose sweep is apart from those of the robots before it, and from those with which the robots after it can
still stop. Stopping is always allowed, so sweeps that are apart stay apart.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, List, Sequence, Tuple

import numpy as np

from m2wr_exploration.team.sweep_kernels import least_gap, stopping_poses

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

CLEARANCE = 0.1             # m: between two sweeps; two cells of the costmap, in which the other robot is drawn
BRAKES = np.array([1.0, 3.0])   # m/s^2, rad/s^2: accelerations of the controller, acc_lim_x and acc_lim_theta
SAMPLED = 0.05              # s between two poses of a sweep: 2.5 cm at 0.5 m/s
SHARES = (1.0, 0.5, 0.25)   # of the wanted command, and then of its turn alone, that are tried before the robot stops
ROUNDING = 1e-3             # m


def sweep(pose: FloatArray, velocity: FloatArray, command: Tuple[float, float], period: float) -> FloatArray:
    """Return the poses (N, 3) through which a robot comes if it takes a command for a period and then stops.

    It may also keep its velocity during the period, as wheels take time.

    Parameters
    ----------
    pose : (3,) float64
        [m, m, rad]
    velocity : (2,) float64
        Measured [m/s, rad/s].
    command : (float, float)
        [m/s, rad/s]
    period : float
        [s]
    """
    velocity = np.asarray(velocity, float)
    kept = stopping_poses(pose, velocity, period, BRAKES, SAMPLED)
    if np.allclose(velocity, command, atol=1e-3) or not any(command):
        return kept
    return np.concatenate([kept, stopping_poses(pose, np.array(command, float), period, BRAKES, SAMPLED)])


def allowed(poses: Sequence[FloatArray], velocities: Sequence[FloatArray], wanted: Sequence[Tuple[float, float]],
            outline: FloatArray, period: float) -> List[Tuple[float, float]]:
    """Return the commands that robots may take, the first robot with the highest priority.

    Parameters
    ----------
    poses : sequence of (3,) float64
        In one frame [m, m, rad].
    velocities : sequence of (2,) float64
        Measured [m/s, rad/s].
    wanted : sequence of (float, float)
        Commands [m/s, rad/s].
    outline : (K, 2) float64
        Convex footprint of each robot, its corners anticlockwise [m].
    period : float
        Until the next command [s].

    Returns
    -------
    list of (float, float)
        The wanted command, a slower one on the same arc, a turn on the spot in its sense, or (0, 0).
    """
    taken = [sweep(pose, velocity, (0.0, 0.0), period) for pose, velocity in zip(poses, velocities)]
    result = []
    for number, (pose, command) in enumerate(zip(poses, wanted)):
        others = [each for other, each in enumerate(taken) if other != number]
        chosen = (0.0, 0.0)
        # two that are too near already may part
        needed = [least_gap(pose[None], other, outline, CLEARANCE) - ROUNDING for other in others]
        for tried in _slower(command):
            made = sweep(pose, velocities[number], tried, period)
            if all(least_gap(made, other, outline, CLEARANCE) >= gap for other, gap in zip(others, needed)):
                chosen, taken[number] = tried, made
                break
        result.append(chosen)
    return result


def _slower(command: Tuple[float, float]) -> List[Tuple[float, float]]:
    """Return a command and what may stand in for it, the best one first; none if it is to stop.

    A robot that faces another one may not drive on along its arc, however slowly, but it can turn away.
    """
    speed, rate = command
    arcs = [(share * speed, share * rate) for share in SHARES] if speed or rate else []
    return arcs + ([(0.0, share * rate) for share in SHARES] if speed and rate else [])
