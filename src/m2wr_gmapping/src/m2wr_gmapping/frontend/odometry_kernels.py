# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of odometry by scan matches: noise scales, bias, centre of rotation, and their covariances.

Array layouts are those of ``track_layout``, and result rows those of ``match_kernels``.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

from numba import njit

from m2wr_gmapping.frontend.pose_kernels import between
from m2wr_gmapping.frontend.track_layout import (
    AHEAD,
    APPLIED_BIAS,
    BIAS,
    BIAS_CHANGES,
    BIAS_INFORMATION,
    BIAS_INFORMATION_VECTOR,
    BIAS_VARIANCE,
    CENTRE,
    COVARIANCE,
    CROSS,
    DEPENDENT,
    EXPECTED,
    FIRST_MEMORY,
    INFORMATION,
    MATCH_CORRELATION,
    MAX_ERROR_RATIO,
    MAX_SCALE,
    MEMORY,
    MIN_BIAS_INFORMATION,
    MIN_DEVIATION,
    MIN_DEVIATION_SHARE,
    MIN_INFORMATION_RATIO,
    MIN_SCALE,
    MIN_SCALE_INFORMATION,
    MOTION,
    NOISE,
    NOISE_TURN,
    OUTLIER_DEVIATIONS,
    SCALE,
    SCALE_EVIDENCE,
    SIGNED_MOTION,
    SLACK,
    TRAVELLED,
)

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray

# ---- noise of odometry


@njit(cache=True, nogil=True, error_model='numpy')
def user_noise(track: FloatArray, dx: float, dy: float, turn: float) -> Tuple[float, float, float]:
    """Return the standard deviations of a step by the user's parameters, as ``motion_model.MotionNoise``.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
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
    by_distance, by_turn = track[NOISE, 0], track[NOISE, 1]
    return (by_distance * dx + by_turn * turn + CROSS * by_distance * dy,
            by_distance * dy + by_turn * turn + CROSS * by_distance * dx,
            track[NOISE_TURN, 1] * turn + track[NOISE_TURN, 0] * math.hypot(dx, dy))


@njit(cache=True, nogil=True, error_model='numpy')
def noise_parts(track: FloatArray, distance: float, turn: float) -> Tuple[float, float, float, float, float, float]:
    """Return the parts of the standard deviations after a motion.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
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
    along, across, _ = user_noise(track, distance, 0.0, 0.0)
    distance_scale, rotation_scale = track[SCALE, 0], track[SCALE, 1]
    along = (along + MIN_DEVIATION + MIN_DEVIATION_SHARE * distance) * distance_scale
    across = (across + MIN_DEVIATION + MIN_DEVIATION_SHARE * distance) * distance_scale
    heading = (track[NOISE_TURN, 0] * distance + MIN_DEVIATION) * track[SCALE + 1, 0]
    heading_turned = (track[NOISE_TURN, 1] + MIN_DEVIATION_SHARE) * turn * track[SCALE + 1, 1]
    return along, across, track[NOISE, 1] * turn * rotation_scale, heading, heading_turned, 0.5 * distance * (
        heading + heading_turned)


@njit(cache=True, nogil=True, error_model='numpy')
def odometry_variances(track: FloatArray, distance: float, turn: float) -> Tuple[float, float, float]:
    """Return the variances of odometry after a motion.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    distance : float
        Distance travelled [m].
    turn : float
        Absolute rotation [rad].

    Returns
    -------
    along, across, heading : float
        [m^2, m^2, rad^2]
    """
    along, across, turned, heading, heading_turned, aside = noise_parts(track, distance, turn)
    return (along + turned)**2, (across + turned)**2 + aside * aside, (heading + heading_turned)**2


@njit(cache=True, nogil=True, error_model='numpy')
def bias_variances(track: FloatArray, forward: float, turn: float) -> Tuple[float, float, float]:
    """Return the variances after a motion due to the uncertainty of BIAS and CENTRE.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    forward : float
        Signed forward distance [m].
    turn : float
        Signed rotation [rad].

    Returns
    -------
    along, across, heading : float
        [m^2, m^2, rad^2]
    """
    x, y, centre, p = track[AHEAD, 0], track[AHEAD, 1], track[CENTRE, 1], track[COVARIANCE:COVARIANCE + 3]
    heading = p[1, 1] * turn * turn + 2.0 * p[1, 2] * turn * forward + p[2, 2] * forward * forward
    along, across = p[0, 0] * forward * forward, 0.25 * forward * forward * heading
    ahead, aside = 1.0 - math.cos(turn), math.sin(turn)     # displacement by an offset of 1 m, in the final frame
    one, other = x * ahead - y * aside, y * ahead + x * aside
    return (x * x * along + y * y * across + centre * one * one,
            y * y * along + x * x * across + centre * other * other, heading)


@njit(cache=True, nogil=True, error_model='numpy')
def expected_variances(track: FloatArray, out: FloatArray) -> None:
    """Write the variances of EXPECTED along its axes.

    The uncertainty of the bias is not included: with it, noise along plain walls would move every match.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    out : (3,) float64
        Written [m^2, m^2, rad^2].
    """
    own, slack = odometry_variances(track, track[MOTION, 0], track[MOTION, 1]), track[SLACK]
    out[0], out[1], out[2] = own[0] + slack[0], own[1] + slack[1], own[2] + slack[2]


@njit(cache=True, nogil=True, error_model='numpy')
def update_noise_scales(track: FloatArray, error: Tuple[float, float, float], variance: Tuple[float, float, float],
                        distance: float, turn: float) -> None:
    """Update the scales of odometry's noise by the error of one segment.

    A scale follows the expectation of the squared error, given scan and odometry together: the step of an EM algorithm.
    Directions without information change no scale. Distance and rotation have one scale each and share the error by
    their part of the variance. A scale with little evidence follows the other one too, because users tend to set both
    too low.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    error : Tuple[float, float, float]
        Matched pose, in the frame of the pose by odometry [m, m, rad].
    variance : Tuple[float, float, float]
        Variances of the matched pose [m^2, m^2, rad^2].
    distance : float
        Distance travelled in the segment [m].
    turn : float
        Absolute rotation in the segment [rad].
    """
    along, across, turned, heading, heading_turned, _ = noise_parts(track, distance, turn)
    squared = odometry_variances(track, distance, turn)
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
                    own += (1.0 - own) / (1.0 + track[SCALE_EVIDENCE, part])
                share += observed * own
                weighted += observed * own * excess
            if share > MIN_SCALE_INFORMATION:
                track[SCALE_EVIDENCE + k, part] += min(share, 1.0)
                memory = min(FIRST_MEMORY + track[SCALE_EVIDENCE + k, part], MEMORY)
                scale = track[SCALE + k, part] * math.sqrt(1.0 + min(share, 1.0) * (weighted / share) / memory)
                track[SCALE + k, part] = min(max(scale, MIN_SCALE), MAX_SCALE)


# ---- systematic errors of odometry


@njit(cache=True, nogil=True, error_model='numpy')
def corrected(track: FloatArray, x: float, y: float, turn: float) -> Tuple[float, float, float, float]:
    """Remove the known systematic error from a step of odometry.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    x : float
        Step [m].
    y : float
        Step [m].
    turn : float
        Rotation [rad].

    Returns
    -------
    x, y, turn : float
        Corrected step [m, m, rad].
    forward : float
        Forward distance of the step [m].
    """
    forward = x * track[AHEAD, 0] + y * track[AHEAD, 1]
    distance_scale, rotation_scale, drift = track[BIAS, 0], track[BIAS, 1], track[BIAS, 2]
    turned = turn * (1.0 + rotation_scale) + drift * forward
    # the reference point moves on a circle around the centre
    ahead, aside = track[CENTRE, 0] * (math.cos(turned) - 1.0), track[CENTRE, 0] * math.sin(turned)
    return (x * (1.0 + distance_scale) + track[AHEAD, 0] * ahead - track[AHEAD, 1] * aside,
            y * (1.0 + distance_scale) + track[AHEAD, 1] * ahead + track[AHEAD, 0] * aside, turned, forward)


@njit(cache=True, nogil=True, error_model='numpy')
def _update_bias_filter(track: FloatArray, row: Tuple[float, float, float], measured: float, variance: float,
                        observed: float) -> None:
    """Update the Kalman filter of the bias with a measurement: ``row`` times the bias, with that variance."""
    if observed < MIN_BIAS_INFORMATION:
        return
    p = track[COVARIANCE:COVARIANCE + 3]
    gain = (p[0, 0] * row[0] + p[0, 1] * row[1] + p[0, 2] * row[2],
            p[1, 0] * row[0] + p[1, 1] * row[1] + p[1, 2] * row[2],
            p[2, 0] * row[0] + p[2, 1] * row[1] + p[2, 2] * row[2])
    noise = MATCH_CORRELATION * variance
    expected = row[0] * gain[0] + row[1] * gain[1] + row[2] * gain[2] + noise
    if measured * measured > OUTLIER_DEVIATIONS * OUTLIER_DEVIATIONS * expected:
        return
    total = measured + row[0] * track[BIAS, 0] + row[1] * track[BIAS, 1] + row[2] * track[BIAS, 2]
    for i in range(3):
        track[BIAS_INFORMATION_VECTOR, i] += row[i] * total / noise
        for j in range(3):
            track[BIAS_INFORMATION + i, j] += row[i] * row[j] / noise
    for i in range(3):
        track[BIAS, i] += gain[i] * (measured / expected)
        for j in range(3):
            p[i, j] -= gain[i] * gain[j] / expected


@njit(cache=True, nogil=True, error_model='numpy')
def _update_centre(track: FloatArray, turn: float, measured: float, variance: float, observed: float) -> None:
    """Update the offset of the centre of rotation with a lateral error, as ``_update_bias_filter``."""
    if observed < MIN_BIAS_INFORMATION:
        return
    centre, lever = track[CENTRE], math.sin(turn)
    gain = centre[1] * lever
    expected = gain * lever + MATCH_CORRELATION * variance
    if measured * measured <= OUTLIER_DEVIATIONS * OUTLIER_DEVIATIONS * expected:
        centre[0] += gain * (measured / expected)
        centre[1] -= gain * gain / expected


@njit(cache=True, nogil=True, error_model='numpy')
def update_bias(track: FloatArray, error: Tuple[float, float, float], variance: Tuple[float, float, float],
                shares: Tuple[float, float, float], forward: float, turn: float) -> None:
    """Update the bias of odometry by the error of one segment.

    Wrong wheel radii or a wrong wheel distance cause an error that accumulates, and a match with an odometry prior
    follows it. A Kalman filter estimates the three parameters from the errors of the matches. The offset of odometry's
    reference point ahead of the axle has a filter of its own: it causes lateral errors in turns.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    error : Tuple[float, float, float]
        Pose by the scan alone, in the frame of the pose by corrected odometry; all in the laser's axes [m, m, rad].
    variance : Tuple[float, float, float]
        Variances of odometry over the segment and of the scan [m^2, m^2, rad^2].
    shares : Tuple[float, float, float]
        Share of each component that the scan observes, 0 to 1.
    forward : float
        Signed forward distance by odometry [m].
    turn : float
        Signed rotation by odometry [rad].
    """
    p = track[COVARIANCE:COVARIANCE + 3]
    for i in range(3):
        p[i, i] = min(p[i, i] + BIAS_VARIANCE * BIAS_CHANGES[i] * abs(forward), BIAS_VARIANCE)
    x, y = track[AHEAD, 0], track[AHEAD, 1]         # the laser may be mounted sideways or backwards
    xx, yy = x * x, y * y
    _update_bias_filter(track, (forward, 0.0, 0.0), x * error[0] + y * error[1], xx * variance[0] + yy * variance[1],
                        xx * shares[0] + yy * shares[1])
    _update_bias_filter(track, (0.0, turn, forward), error[2], variance[2], shares[2])
    _update_centre(track, turn, x * error[1] - y * error[0], yy * variance[0] + xx * variance[1],
                   yy * shares[0] + xx * shares[1])


# ---- the match of a processed scan


@njit(cache=True, nogil=True, error_model='numpy')
def _posterior_variances(row: FloatArray, share: float,
                         prior: Tuple[float, float, float]) -> Tuple[float, float, float]:
    """Return the variances of a share of a scan's information, combined with a prior of those variances."""
    a, d, f = (row[INFORMATION] * share + 1.0 / prior[0], row[INFORMATION + 3] * share + 1.0 / prior[1],
               row[INFORMATION + 5] * share + 1.0 / prior[2])
    b, c, e = row[INFORMATION + 1] * share, row[INFORMATION + 2] * share, row[INFORMATION + 4] * share
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    by = 1.0 / (a * p + b * q + c * r)
    return p * by, (a * f - c * c) * by, (a * d - b * b) * by


@njit(cache=True, nogil=True, error_model='numpy')
def _scan_variance(prior: float, observed: float) -> float:
    """Return the variance of a scan alone from the prior's variance and the observed share."""
    return prior * (1.0 - observed) / max(observed, 1e-9)


@njit(cache=True, nogil=True, error_model='numpy')
def _is_odometry_only(track: FloatArray) -> bool:
    """Whether EXPECTED was propagated by odometry from the last processed scan itself."""
    slack = track[SLACK]
    return slack[0] == 0.0 and slack[1] == 0.0 and slack[2] == 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def learn(track: FloatArray, anchor: FloatArray, row: FloatArray) -> None:
    """Update the noise scales by the match of a processed scan, and write its bias information.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    row : (13,) float64
        Result row of ``match_kernels``.
    """
    motion = track[MOTION]
    track[BIAS_INFORMATION:BIAS_INFORMATION_VECTOR + 1] = 0.0
    track[APPLIED_BIAS] = track[BIAS]
    track[TRAVELLED, 0], track[TRAVELLED, 1] = track[SIGNED_MOTION, 0], track[SIGNED_MOTION, 1]
    track[TRAVELLED, 2] = math.atan2(track[AHEAD, 1], track[AHEAD, 0])
    if not _is_odometry_only(track):
        return
    x, y, theta = between(anchor, row)
    prior = odometry_variances(track, motion[0], motion[1])
    error, variance = between(track[EXPECTED], (x, y, theta)), _posterior_variances(row, 1.0, prior)
    update_noise_scales(track, error, variance, motion[0], motion[1])


@njit(cache=True, nogil=True, error_model='numpy')
def _significant_share(row: FloatArray, x: float, y: float) -> float:
    """Return the share of a scan's information along x, y that noise of the normals cannot explain."""
    xx, xy, yy = row[INFORMATION], row[INFORMATION + 1], row[INFORMATION + 3]
    along = x * x * xx + 2.0 * x * y * xy + y * y * yy
    return max(0.0, 1.0 - MIN_INFORMATION_RATIO * (xx + yy) / along) if along > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def _observed_share(row: FloatArray, prior: Tuple[float, float, float]) -> Tuple[float, float, float]:
    """Return how much a scan observes the errors of odometry along, across and in heading, 0 to 1."""
    left = _posterior_variances(row, 1.0 / DEPENDENT, prior)
    return (max(1.0 - left[0] / prior[0], 0.0) * _significant_share(row, 1.0, 0.0),
            max(1.0 - left[1] / prior[1], 0.0) * _significant_share(row, 0.0, 1.0), max(1.0 - left[2] / prior[2], 0.0))


@njit(cache=True, nogil=True, error_model='numpy')
def is_bias_observable(track: FloatArray, row: FloatArray, inverse: FloatArray) -> bool:
    """Return whether a match with a weaker odometry prior observes the bias, and write that prior.

    Exact wheels with a constant bias make the prior so strong that no scan could ever correct it. The pose itself keeps
    the strong prior.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    row : (13,) float64
        Result row of ``match_kernels``.
    inverse : (3,) float64
        Written: inverse variances of EXPECTED, with the uncertainty of the bias included.
    """
    if not _is_odometry_only(track):
        return False
    own = odometry_variances(track, track[MOTION, 0], track[MOTION, 1])
    always = bias_variances(track, track[SIGNED_MOTION, 0], track[SIGNED_MOTION, 1])
    prior = own[0] + always[0], own[1] + always[1], own[2] + always[2]
    for k in range(3):
        inverse[k] = 1.0 / prior[k]
    observed = _observed_share(row, prior)
    return (observed[0] >= MIN_BIAS_INFORMATION or observed[1] >= MIN_BIAS_INFORMATION
            or observed[2] >= MIN_BIAS_INFORMATION)


@njit(cache=True, nogil=True, error_model='numpy')
def update_bias_unconstrained(track: FloatArray, anchor: FloatArray, row: FloatArray, inverse: FloatArray) -> None:
    """Update the bias by the match of a processed scan with the prior of ``is_bias_observable``.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    row : (13,) float64
        Result row of ``match_kernels``.
    inverse : (3,) float64
        That prior.
    """
    own = odometry_variances(track, track[MOTION, 0], track[MOTION, 1])
    prior = 1.0 / inverse[0], 1.0 / inverse[1], 1.0 / inverse[2]
    x, y, theta = between(anchor, row)
    error = between(track[EXPECTED], (x, y, theta))
    left, observed = _posterior_variances(row, 1.0, prior), _observed_share(row, prior)
    shares = (max(1.0 - left[0] / prior[0], MIN_BIAS_INFORMATION), max(1.0 - left[1] / prior[1], MIN_BIAS_INFORMATION),
              max(1.0 - left[2] / prior[2], MIN_BIAS_INFORMATION))
    measured = (own[0] + _scan_variance(prior[0], observed[0]), own[1] + _scan_variance(prior[1], observed[1]),
                own[2] + _scan_variance(prior[2], observed[2]))
    # a match is the weighted mean of scan and odometry; divide by the weight for the error of the scan alone
    update_bias(track, (error[0] / shares[0], error[1] / shares[1], error[2] / shares[2]), measured, observed,
                track[SIGNED_MOTION, 0], track[SIGNED_MOTION, 1])
