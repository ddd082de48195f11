# SPDX-License-Identifier: BSD-3-Clause
"""Pose of the robot between two processed scans, by odometry and scan matches: the arithmetic of ``tracking``.

Array layouts are those of ``track_layout``, and result rows those of ``match_kernels``.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Tuple

from numba import njit

from m2wr_gmapping.frontend.odometry_kernels import (
    corrected,
    expected_variances,
    learn,
    update_noise_scales,
    user_noise,
)
from m2wr_gmapping.frontend.pose_kernels import between, compose, exceeds, wrapped
from m2wr_gmapping.frontend.track_layout import (
    CENTRE,
    COST,
    DEPENDENT,
    DOUBT,
    DRIVEN,
    EXPECTED,
    GOOD_SHARE,
    INFORMATION,
    INVERSE,
    LONG_STEP,
    LOWER_SHARE,
    MIN_INFORMATION_RATIO,
    MOTION,
    NO_DOUBT,
    RECHECK_AFTER,
    REL,
    SIGNED_MOTION,
    SINCE,
    SLACK,
    SLIP,
    SLIP_DISTANCE,
    SLIP_FLOOR,
    SLIP_LEFT,
    SLIP_OBSERVATIONS,
    SLIP_SHARE,
    SLIP_TOLERANCE,
    SLIP_TRANSFORM,
    START,
    STATIONARY,
    STEP_APPLIED,
    STEP_CENTRE,
    STEP_TURN,
    STEP_UNOBSERVED,
    UNEXPLAINED,
    VARIANCES,
    WANTED,
    WINDOW,
)

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray

# ---- between processed scans


@njit(cache=True, nogil=True, error_model='numpy')
def advance(track: FloatArray, before: FloatArray, now: FloatArray) -> Tuple[float, float, bool]:
    """Propagate the poses by a step of odometry.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    before : (3,) float64
        Poses of odometry before and after the step [m, m, rad].
    now : (3,) float64
        Poses of odometry before and after the step [m, m, rad].

    Returns
    -------
    distance, turn : float
        Length [m] and rotation [rad] of the step.
    moved : bool
        Whether odometry has moved since the last match.
    """
    step = between(before, now)
    x, y, theta, forward = corrected(track, step[0], step[1], step[2])
    for row in (REL, EXPECTED):
        compose(track[row], (x, y, theta), track[row])
    for row in (DRIVEN, SINCE):
        compose(track[row], step, track[row])
    distance, turn = math.hypot(step[0], step[1]), abs(step[2])
    track[SIGNED_MOTION, 0] += forward
    track[SIGNED_MOTION, 1] += step[2]
    track[MOTION, 0] += distance
    track[MOTION, 1] += turn
    since = track[SINCE]
    return distance, turn, exceeds(since[0], since[1], since[2], STATIONARY)


@njit(cache=True, nogil=True, error_model='numpy')
def _good_share(track: FloatArray, distance: float, turn: float) -> float:
    """Return the share of the beams below whose score a match is doubted, after a step.

    In unknown areas many scans in a row have a low score; a doubt that was checked is not raised again at once.
    """
    doubt = track[DOUBT]
    if doubt[0] == NO_DOUBT:
        return GOOD_SHARE
    doubt[1] += distance
    doubt[2] += turn
    if doubt[1] > RECHECK_AFTER[0] or doubt[2] > RECHECK_AFTER[1]:
        doubt[0] = NO_DOUBT
        return GOOD_SHARE
    return min(GOOD_SHARE, doubt[0] - LOWER_SHARE)


@njit(cache=True, nogil=True, error_model='numpy')
def expect(track: FloatArray, anchor: FloatArray, ask: FloatArray) -> Tuple[bool, float]:
    """Write the start and the prediction of the newest scan's match into ``ask``.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    ask : (ASK_ROWS, 3) float64
        Written; see ``track_layout``.

    Returns
    -------
    long : bool
        Whether the step since the last match was so long that a match may converge to a wrong pose.
    good_share : float
        Share of the beams below whose score the match is doubted.
    """
    since = track[SINCE]
    distance, turn = math.hypot(since[0], since[1]), abs(since[2])
    long = exceeds(since[0], since[1], since[2], LONG_STEP)
    since[0] = since[1] = since[2] = 0.0
    compose(anchor, track[REL], ask[START])
    compose(anchor, track[EXPECTED], ask[WANTED])
    expected_variances(track, ask[VARIANCES])
    for k in range(3):
        ask[INVERSE, k] = 1.0 / ask[VARIANCES, k]
    ask[WINDOW, 0] = SLIP_FLOOR[0] + SLIP_SHARE * distance
    ask[WINDOW, 1] = SLIP_FLOOR[1] + SLIP_SHARE * turn
    return long, _good_share(track, distance, turn)


@njit(cache=True, nogil=True, error_model='numpy')
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
    return row[COST] / DEPENDENT + 0.5 * pull, pull


@njit(cache=True, nogil=True, error_model='numpy')
def degenerate_direction(row: FloatArray) -> Tuple[float, float, float]:
    """Return the projector xx, xy, yy onto the direction that the scan of a match does not observe.

    It is 0 if the scan observes both directions, or none.
    """
    h = row[INFORMATION:]
    by = 1.0 / h[5] if h[5] > 0.0 else 0.0
    # with the heading eliminated
    a, b, d = h[0] - h[2] * h[2] * by, h[1] - h[2] * h[4] * by, h[3] - h[4] * h[4] * by
    half, middle = 0.5 * (a - d), 0.5 * (a + d)
    root = math.sqrt(half * half + b * b)
    if not (root > 0.0 and middle - root < MIN_INFORMATION_RATIO * (middle + root)):
        return 0.0, 0.0, 0.0
    # projector onto the weak axis: (1 - (matrix - middle) / root) / 2
    return 0.5 * (1.0 - half / root), -0.5 * b / root, 0.5 * (1.0 + half / root)


@njit(cache=True, nogil=True, error_model='numpy')
def project_onto_degenerate(row: FloatArray, expected: FloatArray) -> None:
    """Move the pose of a match to ``expected`` along its degenerate direction.

    Parameters
    ----------
    row : (13,) float64
        Result row; its pose changes.
    expected : (3,) float64
        Pose by odometry in ``map``.
    """
    xx, xy, yy = degenerate_direction(row)
    x, y, _ = between(row, expected)
    compose(row, (xx * x + xy * y, xy * x + yy * y, 0.0), row)


@njit(cache=True, nogil=True, error_model='numpy')
def project_all_onto_degenerate(rows: FloatArray, expected: FloatArray) -> None:
    """Apply ``project_onto_degenerate`` to many matches.

    Parameters
    ----------
    rows : (N, 13) float64
        Result rows; their poses change.
    expected : (N, 3) float64
        Poses by odometry in ``map``.
    """
    for n in range(rows.shape[0]):
        project_onto_degenerate(rows[n], expected[n])


@njit(cache=True, nogil=True, error_model='numpy')
def _restart_from(track: FloatArray, rel: FloatArray, slack: Any) -> None:
    """Propagate EXPECTED from now on from the pose ``rel`` with the variances ``slack``."""
    for k in range(3):
        track[EXPECTED, k], track[SLACK, k] = rel[k], slack[k]
        track[MOTION, k] = track[SIGNED_MOTION, k] = 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def _confirm_slip(track: FloatArray, at_once: bool) -> None:
    """Accept a slip that persists over some distance: a pitching robot looks like a slip for a moment."""
    aside, slip, motion = track[SLIP_TRANSFORM], track[SLIP], track[MOTION]
    rel, expected = track[REL], track[EXPECTED]
    again = slip[2] > 0.0
    if again:
        c, s = math.cos(aside[2]), math.sin(aside[2])
        led = (aside[0] + c * expected[0] - s * expected[1], aside[1] + s * expected[0] + c * expected[1],
               wrapped(aside[2] + expected[2]))
        x, y, theta = between(led, rel)
        again = not exceeds(x, y, theta, SLIP_TOLERANCE)
    c, s = math.cos(expected[2]), math.sin(expected[2])     # rel (+) inverse(expected): the slip may continue
    back = -c * expected[0] - s * expected[1], s * expected[0] - c * expected[1], wrapped(-expected[2])
    compose(rel, back, aside)
    if not again:
        slip[0], slip[1], slip[2] = motion[0], motion[1], 0.0
    slip[2] += 1.0
    if at_once or slip[2] > SLIP_OBSERVATIONS or motion[0] - slip[0] > SLIP_DISTANCE[0] \
            or motion[1] - slip[1] > SLIP_DISTANCE[1]:
        slip[2] = 0.0
        update_noise_scales(track, between(expected, rel), (0.0, 0.0, 0.0), motion[0], motion[1])
        _restart_from(track, rel, SLIP_LEFT)


@njit(cache=True, nogil=True, error_model='numpy')
def accept_match(track: FloatArray, anchor: FloatArray, row: FloatArray, share: float, slipped: bool,
                 at_once: bool) -> None:
    """Update the track by a match.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    row : (13,) float64
        Result row of ``match_kernels``.
    share : float
        Score of the match as a share of the beams.
    slipped : bool
        Whether odometry has slipped.
    at_once : bool
        Whether a slip is accepted without confirmation.
    """
    track[REL, 0], track[REL, 1], track[REL, 2] = between(anchor, row)
    if share < GOOD_SHARE and track[DOUBT, 0] == NO_DOUBT:
        track[DOUBT, 0], track[DOUBT, 1], track[DOUBT, 2] = share, 0.0, 0.0
    if slipped:
        _confirm_slip(track, at_once)
    else:
        track[SLIP, 2] = 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def unexplained(track: FloatArray) -> bool:
    """Return whether odometry since the last processed scan differs from the newest match."""
    x, y, theta = between(track[DRIVEN], track[REL])
    return exceeds(x, y, theta, UNEXPLAINED)


# ---- the processed scan


@njit(cache=True, nogil=True, error_model='numpy')
def predict_all(track: FloatArray, anchors: FloatArray, starts: FloatArray, predictions: FloatArray,
                known: FloatArray) -> None:
    """Predict all particles from their poses at the last processed scan.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
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
    for n in range(anchors.shape[0]):
        compose(anchors[n], track[REL], starts[n])
        compose(anchors[n], track[EXPECTED], predictions[n])
    expected_variances(track, known[0])
    expected = track[EXPECTED]
    noise = user_noise(track, expected[0], expected[1], expected[2])
    for k in range(3):
        known[1, k] = 1.0 / known[0, k]
        known[2, k] = min(math.sqrt(known[0, k]), noise[k])


@njit(cache=True, nogil=True, error_model='numpy')
def update_from_step(track: FloatArray, anchor: FloatArray, row: FloatArray, step: FloatArray) -> None:
    """Call ``learn``, and write a step of the path.

    Parameters
    ----------
    track : (TRACK_ROWS, 3) float64
        See ``track_layout``.
    anchor : (3,) float64
        Pose of the particle at the last processed scan, in ``map``.
    row : (13,) float64
        Result row of ``match_kernels``.
    step : (STEP_SIZE,) float64
        Written; layout of ``odometry_recalibration_kernels``.
    """
    step[STEP_UNOBSERVED], step[STEP_UNOBSERVED + 1], step[STEP_UNOBSERVED + 2] = degenerate_direction(row)
    step[STEP_TURN], step[STEP_CENTRE] = track[SIGNED_MOTION, 1], track[CENTRE, 0]
    step[STEP_APPLIED:] = 0.0
    learn(track, anchor, row)
