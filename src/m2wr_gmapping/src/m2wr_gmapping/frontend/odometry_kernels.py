# SPDX-License-Identifier: BSD-3-Clause
"""Random errors of odometry: standard deviations of a motion, and their scales, estimated from scan matches."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

from m2wr_gmapping import tuning
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_gmapping.frontend.track import Noise
    from m2wr_node.array_types import FloatArray

CROSS = tuning.CROSS_NOISE
MIN_DEVIATION, MIN_DEVIATION_SHARE = tuning.ODOMETRY.floor
MEMORY, FIRST_MEMORY = tuning.ODOMETRY.memory
MAX_ERROR_RATIO = tuning.MATCHING.certain**2        # greatest ratio of squared error to expectation
MIN_SCALE, MAX_SCALE = tuning.ODOMETRY.scale


@kernel
def user_noise(user: FloatArray, dx: float, dy: float, turn: float) -> Tuple[float, float, float]:
    """Return the standard deviations of a step by the user's parameters, in the frame where the step starts.

    Parameters
    ----------
    user : (2, 2) float64
        See ``Noise``.
    dx : float
        Step [m].
    dy : float
        Step [m].
    turn : float
        Rotation [rad].

    Returns
    -------
    along, across, heading : float
        [m, m, rad]
    """
    dx, dy, turn = abs(dx), abs(dy), abs(turn)
    by_distance, by_turn = user[0, 0], user[0, 1]
    return (by_distance * dx + by_turn * turn + CROSS * by_distance * dy,
            by_distance * dy + by_turn * turn + CROSS * by_distance * dx,
            user[1, 1] * turn + user[1, 0] * math.hypot(dx, dy))


@kernel
def noise_parts(noise: Noise, distance: float, turn: float) -> Tuple[float, float, float, float, float, float]:
    """Return the parts of the standard deviations after a motion.

    Parameters
    ----------
    noise : Noise
        User's parameters and their scales.
    distance : float
        Distance travelled [m].
    turn : float
        Absolute rotation [rad].

    Returns
    -------
    along, across : float
        Parts by distance, along and across [m].
    turned : float
        Part by rotation, along and across [m].
    heading, heading_turned : float
        Parts of the heading by distance and by rotation [rad].
    aside : float
        Lateral deviation that the heading causes [m].
    """
    along, across, _ = user_noise(noise.user, distance, 0.0, 0.0)
    distance_scale, rotation_scale = noise.scale[0, 0], noise.scale[0, 1]
    along = (along + MIN_DEVIATION + MIN_DEVIATION_SHARE * distance) * distance_scale
    across = (across + MIN_DEVIATION + MIN_DEVIATION_SHARE * distance) * distance_scale
    heading = (noise.user[1, 0] * distance + MIN_DEVIATION) * noise.scale[1, 0]
    heading_turned = (noise.user[1, 1] + MIN_DEVIATION_SHARE) * turn * noise.scale[1, 1]
    return along, across, noise.user[0, 1] * turn * rotation_scale, heading, heading_turned, 0.5 * distance * (
        heading + heading_turned)


@kernel
def odometry_variances(noise: Noise, distance: float, turn: float) -> Tuple[float, float, float]:
    """Return the variances of odometry after a motion.

    Parameters
    ----------
    noise : Noise
        User's parameters and their scales.
    distance : float
        Distance travelled [m].
    turn : float
        Absolute rotation [rad].

    Returns
    -------
    along, across, heading : float
        [m^2, m^2, rad^2]
    """
    along, across, turned, heading, heading_turned, aside = noise_parts(noise, distance, turn)
    return (along + turned)**2, (across + turned)**2 + aside * aside, (heading + heading_turned)**2


@kernel
def update_noise_scales(noise: Noise, error: Tuple[float, float, float], variance: Tuple[float, float, float],
                        distance: float, turn: float) -> None:
    """Update the scales of odometry's noise by the error of one segment.

    A scale follows the expectation of the squared error, given scan and odometry together: the step of an EM algorithm.
    Directions without information change no scale. Distance and rotation have one scale each and share the error by
    their part of the variance. A scale with little evidence follows the other one too, because users tend to set both
    too low.

    Parameters
    ----------
    noise : Noise
        User's parameters and their scales.
    error : Tuple[float, float, float]
        Matched pose, in the frame of the pose by odometry [m, m, rad].
    variance : Tuple[float, float, float]
        Variances of the matched pose [m^2, m^2, rad^2].
    distance : float
        Distance travelled in the segment [m].
    turn : float
        Absolute rotation in the segment [rad].
    """
    along, across, turned, heading, heading_turned, _ = noise_parts(noise, distance, turn)
    squared = odometry_variances(noise, distance, turn)
    by_turn = turned / (along + turned), turned / (across + turned), heading_turned / (heading + heading_turned)
    for k in range(2):
        for part in range(2):
            share = weighted = 0.0
            for axis in range(2 * k, 2 + k):
                observed = max(1.0 - variance[axis] / squared[axis], 0.0)
                excess = min(error[axis] * error[axis] / squared[axis] / max(observed, 1e-3), MAX_ERROR_RATIO) - 1.0
                if axis == 1:       # the rest of the lateral error is due to the heading
                    observed *= (across + turned)**2 / squared[1]
                own = by_turn[axis] if part == 1 else 1.0 - by_turn[axis]
                if k == 0:
                    own += (1.0 - own) / (1.0 + noise.evidence[0, part])
                share += observed * own
                weighted += observed * own * excess
            if share > 0.0:
                noise.evidence[k, part] += min(share, 1.0)
                memory = min(FIRST_MEMORY + noise.evidence[k, part], MEMORY)
                scale = noise.scale[k, part] * math.sqrt(1.0 + min(share, 1.0) * (weighted / share) / memory)
                noise.scale[k, part] = min(max(scale, MIN_SCALE), MAX_SCALE)
