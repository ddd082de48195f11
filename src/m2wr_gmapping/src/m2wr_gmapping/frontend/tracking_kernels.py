# SPDX-License-Identifier: BSD-3-Clause
"""Pose of the robot between two processed scans, by odometry and scan matches: the arithmetic of ``tracking``.

Result rows are those of ``match_kernels``.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend import calibration_kernels as ck
from m2wr_gmapping.frontend import information_kernels as ik
from m2wr_gmapping.frontend import track as tr
from m2wr_gmapping.frontend.match_kernels import COST, RESULT_SIZE, match_particles
from m2wr_gmapping.frontend.odometry_kernels import odometry_variances, update_noise_scales, user_noise
from m2wr_maps.linear_kernels import product, transformed
from m2wr_maps.pose_kernels import between, compose, exceeds, wrapped
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int32Array, Uint8Array

STATIONARY = (tuning.TRACKING.stationary,) * 3
LONG_STEP = tuning.MATCHING.basin[0], *tuning.MATCHING.basin
SLIP_FLOOR, SLIP_SHARE = tuning.SLIPS.window, tuning.SLIPS.window_share
SLIP_DISTANCE = tuning.MATCHING.basin
SLIP_OBSERVATIONS = tuning.SLIPS.confirm_scans
SLIP_TOLERANCE = (math.sqrt(tuning.MATCHING.narrow),) * 3
SLIP_LEFT = tuple(deviation**2 for deviation in tuning.SLIPS.left)      # [m^2, m^2, rad^2]


# ---- between processed scans


@kernel
def advance(track_data: FloatArray, calibration_data: FloatArray, raw: FloatArray) -> Tuple[float, float, bool]:
    """Propagate the poses by a step of odometry.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    calibration_data : (CALIBRATION_SIZE,) float64
        Of a Calibration.
    raw : (3,) float64
        Step of odometry [m, m, rad].

    Returns
    -------
    distance, turn : float
        Length [m] and rotation [rad] of the step.
    moved : bool
        Whether odometry has moved since the last match.
    """
    track, calibration = tr.track_of(track_data), tr.calibration_of(calibration_data)
    step, of_step = np.empty(3), np.empty((3, tr.PARAMETERS))
    forward = ck.corrected_step(calibration, raw[0], raw[1], raw[2], step, of_step)
    ck.propagate_jacobian(step, of_step, track.jacobian)
    compose(track.matched, step, track.matched)
    compose(track.predicted, step, track.predicted)
    compose(track.since_match, raw, track.since_match)
    distance, turn = math.hypot(raw[0], raw[1]), abs(raw[2])
    track.motion[0] += distance
    track.motion[1] += turn
    track.motion[2] += forward
    since = track.since_match
    return distance, turn, exceeds(since[0], since[1], since[2], STATIONARY)


@kernel
def prediction_variances(track: tr.Track, noise: tr.Noise, out: FloatArray) -> None:
    """Write the variances (3,) of ``Track.predicted`` along its axes.

    The uncertainty of the calibration is not included: it is an error of all steps alike, not of this one.

    Parameters
    ----------
    track : Track
    noise : Noise
    out : (3,) float64
        Written [m^2, m^2, rad^2].
    """
    own = odometry_variances(noise, track.motion[0], track.motion[1])
    for k in range(3):
        out[k] = own[k] + track.slack[k]


@kernel
def expect(track_data: FloatArray, noise_data: FloatArray, anchor: FloatArray, request_data: FloatArray) -> bool:
    """Write start and prediction of the newest scan's match.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    noise_data : (NOISE_SIZE,) float64
        Of a Noise.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    request_data : (REQUEST_SIZE,) float64
        Of a Request; written.

    Returns
    -------
    bool
        Whether the step since the last match was so long that a match may converge to a wrong pose.
    """
    track, noise, ask = tr.track_of(track_data), tr.noise_of(noise_data), tr.request_of(request_data)
    since = track.since_match
    distance, turn = math.hypot(since[0], since[1]), abs(since[2])
    long = exceeds(since[0], since[1], since[2], LONG_STEP)
    since[:] = 0.0
    compose(anchor, track.matched, ask.start)
    compose(anchor, track.predicted, ask.expected)
    prediction_variances(track, noise, ask.variances)
    ask.window[0], ask.window[1] = SLIP_FLOOR[0] + SLIP_SHARE * distance, SLIP_FLOOR[1] + SLIP_SHARE * turn
    ask.anchor[:] = anchor
    return long


@kernel
def cost_of(row: FloatArray, expected: FloatArray, variances: FloatArray) -> Tuple[float, float]:
    """Return the cost of a match, and the part of odometry.

    Parameters
    ----------
    row : (13,) float64
        Result row of ``match_kernels``.
    expected : (3,) float64
        Pose by odometry in ``map``.
    variances : (3,) float64
        Its variances [m^2, m^2, rad^2].

    Returns
    -------
    cost : float
        Negative log-likelihood up to a constant.
    pull : float
        Squared Mahalanobis distance of the match from ``expected``.
    """
    x, y, turn = between(expected, row)
    pull = x * x / variances[0] + y * y / variances[1] + turn * turn / variances[2]
    return row[COST] / ik.DEPENDENT + 0.5 * pull, pull


@kernel
def match_with_odometry(start: FloatArray, expected: FloatArray, variances: FloatArray, beams: FloatArray,
                        table: Int32Array, blocks: Int32Array, mean: Uint8Array, hits: Uint8Array, frame: FloatArray,
                        settings: FloatArray, row: FloatArray) -> Tuple[float, float]:
    """Match in one map, with odometry along directions that the scan does not observe.

    Parameters
    ----------
    start : (3,) float64
        Start pose in ``map``.
    expected : (3,) float64
        Pose by odometry in ``map``.
    variances : (3,) float64
        Its variances [m^2, m^2, rad^2].
    beams, blocks, mean, hits, frame, settings
        As of ``match_particles``.
    table : (1, H, W) int32
        Block at each place, -1 for none.
    row : (13,) float64
        Result row; written.

    Returns
    -------
    cost, pull : float
        As of ``cost_of``.
    """
    prior = 1.0 / variances
    match_particles(start.reshape(1, 3), expected.reshape(1, 3), 0, 1, beams, table, blocks, mean, hits, frame, prior,
                    settings, -math.inf, row.reshape(1, RESULT_SIZE))
    ik.fuse(row, expected, prior)
    return cost_of(row, expected, variances)


@kernel
def _restart_from(track: tr.Track, matched: FloatArray, slack: Any) -> None:
    """Predict from now on from the pose ``matched`` with the variances ``slack``."""
    track.jacobian[:] = 0.0
    for k in range(3):
        track.predicted[k], track.slack[k], track.motion[k] = matched[k], slack[k], 0.0


@kernel
def _confirm_slip(track: tr.Track, noise: tr.Noise, at_once: bool) -> None:
    """Accept a slip that persists over some distance: a pitching robot looks like a slip for a moment."""
    aside, slip, motion = track.slip_transform, track.slip, track.motion
    matched, predicted = track.matched, track.predicted
    again = slip[2] > 0.0
    if again:
        c, s = math.cos(aside[2]), math.sin(aside[2])
        led = (aside[0] + c * predicted[0] - s * predicted[1], aside[1] + s * predicted[0] + c * predicted[1],
               wrapped(aside[2] + predicted[2]))
        x, y, theta = between(led, matched)
        again = not exceeds(x, y, theta, SLIP_TOLERANCE)
    c, s = math.cos(predicted[2]), math.sin(predicted[2])     # matched (+) inverse(predicted): the slip may continue
    back = -c * predicted[0] - s * predicted[1], s * predicted[0] - c * predicted[1], wrapped(-predicted[2])
    compose(matched, back, aside)
    if not again:
        slip[0], slip[1], slip[2] = motion[0], motion[1], 0.0
    slip[2] += 1.0
    if at_once or slip[2] > SLIP_OBSERVATIONS or motion[0] - slip[0] > SLIP_DISTANCE[0] \
            or motion[1] - slip[1] > SLIP_DISTANCE[1]:
        slip[2] = 0.0
        update_noise_scales(noise, between(predicted, matched), (0.0, 0.0, 0.0), motion[0], motion[1])
        _restart_from(track, matched, SLIP_LEFT)


@kernel
def accept_match(track_data: FloatArray, noise_data: FloatArray, anchor: FloatArray, row: FloatArray, slipped: bool,
                 at_once: bool) -> None:
    """Update the track by a match.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    noise_data : (NOISE_SIZE,) float64
        Of a Noise.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    row : (13,) float64
        Result row of ``match_kernels``.
    slipped : bool
        Whether odometry has slipped.
    at_once : bool
        Whether a slip is accepted without confirmation.
    """
    track, noise = tr.track_of(track_data), tr.noise_of(noise_data)
    track.matched[0], track.matched[1], track.matched[2] = between(anchor, row)
    if slipped:
        _confirm_slip(track, noise, at_once)
    else:
        track.slip[2] = 0.0


# ---- the processed scan


@kernel
def predict_all(track_data: FloatArray, noise_data: FloatArray, anchors: FloatArray, starts: FloatArray,
                predictions: FloatArray, known: FloatArray) -> None:
    """Predict all particles from their poses at the last processed scan.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    noise_data : (NOISE_SIZE,) float64
        Of a Noise.
    anchors : (N, 3) float64
        Those poses, in ``map``.
    starts : (N, 3) float64
        Written: by the newest match.
    predictions : (N, 3) float64
        Written: by odometry.
    known : (3, 3) float64
        Written: variances of the predictions, their inverses, and standard deviations for drawing particles. The latter
        do not exceed the user's noise.
    """
    track, noise = tr.track_of(track_data), tr.noise_of(noise_data)
    for n in range(anchors.shape[0]):
        compose(anchors[n], track.matched, starts[n])
        compose(anchors[n], track.predicted, predictions[n])
    prediction_variances(track, noise, known[0])
    predicted = track.predicted
    by_user = user_noise(noise.user, predicted[0], predicted[1], predicted[2])
    for k in range(3):
        known[1, k] = 1.0 / known[0, k]
        known[2, k] = min(math.sqrt(known[0, k]), by_user[k])


@kernel
def _is_odometry_only(track: tr.Track) -> bool:
    """Whether the prediction was propagated by odometry from the last processed scan itself."""
    return track.slack[0] == 0.0 and track.slack[1] == 0.0 and track.slack[2] == 0.0


@kernel
def weak_prior(track_data: FloatArray, noise_data: FloatArray, calibration_data: FloatArray, out: FloatArray) -> bool:
    """Write the inverse variances (3,) of the prediction with the uncertainty of the calibration included.

    Exact wheels make the prior of the pose so strong that no scan could ever correct the calibration. So the scan is
    matched a second time with this one.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    noise_data : (NOISE_SIZE,) float64
        Of a Noise.
    calibration_data : (CALIBRATION_SIZE,) float64
        Of a Calibration.
    out : (3,) float64
        Written [1/m^2, 1/m^2, 1/rad^2].

    Returns
    -------
    bool
        False after a slip, which says nothing about the calibration.
    """
    track, noise, calibration = tr.track_of(track_data), tr.noise_of(noise_data), tr.calibration_of(calibration_data)
    if not _is_odometry_only(track):
        return False
    own = np.array(odometry_variances(noise, track.motion[0], track.motion[1]))
    by_calibration = product(product(track.jacobian, calibration.covariance), track.jacobian.T)
    out[:] = 1.0 / (own + np.diag(by_calibration))
    return True


@kernel
def learn_noise(track_data: FloatArray, noise_data: FloatArray, anchor: FloatArray, row: FloatArray) -> None:
    """Update the scales of odometry's noise by the match of a processed scan.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    noise_data : (NOISE_SIZE,) float64
        Of a Noise; changed.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    row : (13,) float64
        Result row of ``match_kernels``.
    """
    track, noise = tr.track_of(track_data), tr.noise_of(noise_data)
    if not _is_odometry_only(track):
        return
    prior = odometry_variances(noise, track.motion[0], track.motion[1])
    x, y, theta = between(anchor, row)
    known = ik.fused_covariance(ik.unfold(row), np.array(prior))
    update_noise_scales(noise, between(track.predicted, (x, y, theta)), (known[0, 0], known[1, 1], known[2, 2]),
                        track.motion[0], track.motion[1])


@kernel
def learn(track_data: FloatArray, noise_data: FloatArray, calibration_data: FloatArray, prediction: FloatArray,
          row: FloatArray, prior: FloatArray, step_data: FloatArray) -> None:
    """Update the calibration by the match of a processed scan with the prior of ``weak_prior``.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    noise_data : (NOISE_SIZE,) float64
        Of a Noise.
    calibration_data : (CALIBRATION_SIZE,) float64
        Of a Calibration; changed.
    prediction : (3,) float64
        Pose by odometry in ``map``.
    row : (13,) float64
        Result row of ``match_kernels``.
    prior : (3,) float64
        That prior.
    step_data : (RECORD_SIZE,) float64
        Of a StepRecord, whose information and vector are written.
    """
    track, noise = tr.track_of(track_data), tr.noise_of(noise_data)
    calibration, step = tr.calibration_of(calibration_data), tr.record_of(step_data)
    information, told = ik.scan_vector(row, prediction, prior)
    own = np.array(odometry_variances(noise, track.motion[0], track.motion[1]))
    about, vector = ck.observation(information / ik.DEPENDENT, own, told / ik.DEPENDENT)
    ck.drift(calibration.covariance, track.motion[2], tr.CALIBRATION_PRIOR, tr.CALIBRATION_CHANGE)
    before, jacobian = calibration.value.copy(), track.jacobian
    if ck.update(calibration, jacobian, about, vector):
        step.information[:] = product(product(jacobian.T, about), jacobian)
        step.vector[:] = transformed(jacobian.T, vector) + transformed(step.information, before)


@kernel
def record_step(track_data: FloatArray, noise_data: FloatArray, calibration_data: FloatArray, row: FloatArray,
                step_data: FloatArray) -> None:
    """Write how the newest step depends on the calibration; before ``learn``.

    Parameters
    ----------
    track_data : (TRACK_SIZE,) float64
        Of a Track.
    noise_data : (NOISE_SIZE,) float64
        Of a Noise.
    calibration_data : (CALIBRATION_SIZE,) float64
        Of a Calibration.
    row : (13,) float64
        Result row of the match.
    step_data : (RECORD_SIZE,) float64
        Of a StepRecord; written.
    """
    track, noise = tr.track_of(track_data), tr.noise_of(noise_data)
    calibration, step = tr.calibration_of(calibration_data), tr.record_of(step_data)
    step.information[:], step.vector[:], step.derivative[:] = 0.0, 0.0, 0.0
    step.applied[:] = calibration.value
    step.forward[0] = track.motion[2]
    if not _is_odometry_only(track):
        return
    variances = np.empty(3)
    prediction_variances(track, noise, variances)
    step.derivative[:] = ck.share_of_odometry(ik.scan_information(row, 1.0), variances, track.jacobian)
