# SPDX-License-Identifier: BSD-3-Clause
"""Odometry models: particles move as odometry says, with noise that grows with the motion."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from m2wr_maps.pose_kernels import wrapped
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

STILL = 0.01            # a shorter way has no direction [m]
OFFSET = 0.3            # m: a base frame so far from the wheels' axle moves sideways when the robot turns on the spot


@kernel
def _folded(turn: float) -> float:
    """Size of a turn, where one by half a revolution counts as none: driving backwards [rad]."""
    size = abs(wrapped(turn))
    return min(size, math.pi - size)


@kernel
def move_differential(poses: FloatArray, heading: float, step: FloatArray, alphas: FloatArray, corrected: bool,
                      noise: FloatArray) -> None:
    """Move particles of a robot that turns, drives straight and turns again.

    Parameters
    ----------
    poses : (N, 3) float64
        Changed in place: x, y [m], theta [rad] in ``map``.
    heading : float
        Odometry's heading before the motion [rad].
    step : (3,) float64
        Difference of the odometry poses, in ``odom``: x, y [m], theta [rad].
    alphas : (5,) float64
        ``odom_alpha1`` to 5: turn from turn, turn from way, way from way, way from turn; the last one is not used.
    corrected : bool
        Whether the sums are variances, as in the book; if not, they are taken for standard deviations, as amcl's
        model ``diff`` does.
    noise : (N, 3) float64
        Standard normal numbers.

    Notes
    -----
    S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, 2005, table 5.6. The book's robot turns about its base frame.
    Another one turns on the spot, and its frame moves sideways: by the table, that is a turn by 90 degrees, a short
    way, and 90 degrees back, with the noise of both. So a sideways motion that a turn explains is no turn of its own.
    """
    way = math.hypot(step[0], step[1])
    first = 0.0 if way < STILL else wrapped(math.atan2(step[1], step[0]) - heading)
    second = wrapped(step[2] - first)
    folded_first, folded_second = _folded(first), _folded(second)
    first2, second2, way2 = folded_first * folded_first, folded_second * folded_second, way * way
    off = wrapped(first - 0.5 * step[2])            # of the way from the direction of an arc
    if abs(way * math.sin(off)) <= 2.0 * OFFSET * abs(math.sin(0.5 * step[2])):
        first2, second2, way2 = 0.0, step[2] * step[2], (way * math.cos(off)) ** 2
    spread_first = alphas[0] * first2 + alphas[1] * way2
    spread_way = alphas[2] * way2 + alphas[3] * (first2 + second2)
    spread_second = alphas[0] * second2 + alphas[1] * way2
    if corrected:
        spread_first, spread_way = math.sqrt(spread_first), math.sqrt(spread_way)
        spread_second = math.sqrt(spread_second)
    for i in range(len(poses)):
        turn = first + spread_first * noise[i, 0]
        length = way + spread_way * noise[i, 1]
        direction = poses[i, 2] + turn
        poses[i, 0] += length * math.cos(direction)
        poses[i, 1] += length * math.sin(direction)
        poses[i, 2] = wrapped(direction + second + spread_second * noise[i, 2])


@kernel
def move_omnidirectional(poses: FloatArray, heading: float, step: FloatArray, alphas: FloatArray, corrected: bool,
                         noise: FloatArray) -> None:
    """Move particles of a robot that drives in any direction.

    Parameters
    ----------
    poses : (N, 3) float64
        Changed in place: x, y [m], theta [rad] in ``map``.
    heading : float
        Odometry's heading before the motion [rad].
    step : (3,) float64
        Difference of the odometry poses, in ``odom``: x, y [m], theta [rad].
    alphas : (5,) float64
        ``odom_alpha1`` to 5.
    corrected : bool
        Whether the sums are variances; the two forms also use the numbers in another order.
    noise : (N, 3) float64
        Standard normal numbers.

    Notes
    -----
    amcl's models ``omni`` and ``omni-corrected``: along the way, across it, and of the turn.
    """
    way2, turn2 = step[0] * step[0] + step[1] * step[1], step[2] * step[2]
    if corrected:
        along = math.sqrt(alphas[2] * way2 + alphas[3] * turn2)
        across = math.sqrt(alphas[3] * turn2 + alphas[4] * way2)
        turning = math.sqrt(alphas[0] * turn2 + alphas[1] * way2)
    else:
        along = alphas[2] * way2 + alphas[0] * turn2
        across = alphas[0] * turn2 + alphas[4] * way2
        turning = alphas[3] * turn2 + alphas[1] * way2
    way = math.sqrt(way2)
    bearing = wrapped(math.atan2(step[1], step[0]) - heading) if way2 else 0.0
    for i in range(len(poses)):
        direction = poses[i, 2] + bearing
        cos, sin = math.cos(direction), math.sin(direction)
        ahead, aside = way + along * noise[i, 0], across * noise[i, 1]
        poses[i, 0] += ahead * cos + aside * sin
        poses[i, 1] += ahead * sin - aside * cos
        poses[i, 2] = wrapped(poses[i, 2] + step[2] + turning * noise[i, 2])
