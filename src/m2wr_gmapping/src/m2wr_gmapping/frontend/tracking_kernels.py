# SPDX-License-Identifier: BSD-3-Clause
"""Pose of the robot between two processed scans, by odometry and scan matches: the arithmetic of ``tracking``.

Array layouts are those of ``track_layout``, and result rows those of ``match_kernels``.
"""
import math

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

# ---- from scan to scan


@njit(cache=True, nogil=True, error_model='numpy')
def advance(track, before, now):
    """Take in that odometry went from the pose ``before`` (3,) to ``now``.

    Returns
    -------
    distance, turn : float
        Of the step [m], [rad].
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
def _good_share(track, distance, turn):
    """Share of the beams that a match must score not to be doubted, after a step.

    Where the robot sees what is new, many scans in a row score low; a doubt that was answered is not raised again at
    once.
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
def expect(track, anchor, ask):
    """Write where the match of the newest scan begins and what odometry says, in ``ask``.

    Parameters
    ----------
    anchor : (3,) float64
        Pose in ``map`` at the last processed scan.

    Returns
    -------
    long : bool
        Whether the step since the last match was so long that a match may be caught beside the right place.
    good_share : float
        Share of the beams' best possible score below which the match is doubted.
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
def cost_of(row, expected, variances):
    """Return the negative logarithm of the probability of a match, but for a constant, and what odometry adds to it.

    The latter is the squared distance of the match from ``expected`` (3,), in deviations.
    """
    x, y, turn = between(expected, row)
    pull = x * x / variances[0] + y * y / variances[1] + turn * turn / variances[2]
    return row[COST] / DEPENDENT + 0.5 * pull, pull


@njit(cache=True, nogil=True, error_model='numpy')
def degenerate_direction(row):
    """Return the projector, as xx, xy, yy, on the direction in which the scan of a match does not hold the place.

    Nothing where it holds both directions, or neither.
    """
    h = row[INFORMATION:]
    by = 1.0 / h[5] if h[5] > 0.0 else 0.0
    a, b, d = h[0] - h[2] * h[2] * by, h[1] - h[2] * h[4] * by, h[3] - h[4] * h[4] * by     # whatever the heading
    half, middle = 0.5 * (a - d), 0.5 * (a + d)
    root = math.sqrt(half * half + b * b)
    if not (root > 0.0 and middle - root < MIN_INFORMATION_RATIO * (middle + root)):
        return 0.0, 0.0, 0.0
    # of the weak axis: (1 - (matrix - middle) / root) / 2
    return 0.5 * (1.0 - half / root), -0.5 * b / root, 0.5 * (1.0 + half / root)


@njit(cache=True, nogil=True, error_model='numpy')
def project_onto_degenerate(row, expected):
    """Move the pose of a match to ``expected`` (3,) in the direction in which its scan says nothing."""
    xx, xy, yy = degenerate_direction(row)
    x, y, _ = between(row, expected)
    compose(row, (xx * x + xy * y, xy * x + yy * y, 0.0), row)


@njit(cache=True, nogil=True, error_model='numpy')
def project_all_onto_degenerate(rows, expected):
    """``project_onto_degenerate`` of many matches (N, 13), each to its own ``expected`` (N, 3)."""
    for n in range(rows.shape[0]):
        project_onto_degenerate(rows[n], expected[n])


@njit(cache=True, nogil=True, error_model='numpy')
def _restart_from(track, rel, slack):
    """From here on odometry leads on from the pose ``rel``, which is known with the variances ``slack``."""
    for k in range(3):
        track[EXPECTED, k], track[SLACK, k] = rel[k], slack[k]
        track[MOTION, k] = track[SIGNED_MOTION, k] = 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def _confirm_slip(track, at_once):
    """Believe in a slip that is seen over some way: a robot that rocks looks like one for a moment."""
    aside, slip, way = track[SLIP_TRANSFORM], track[SLIP], track[MOTION]
    rel, expected = track[REL], track[EXPECTED]
    again = slip[2] > 0.0
    if again:
        c, s = math.cos(aside[2]), math.sin(aside[2])
        led = (aside[0] + c * expected[0] - s * expected[1], aside[1] + s * expected[0] + c * expected[1],
               wrapped(aside[2] + expected[2]))
        x, y, theta = between(led, rel)
        again = not exceeds(x, y, theta, SLIP_TOLERANCE)
    c, s = math.cos(expected[2]), math.sin(expected[2])     # rel (+) inverse(expected): wheels may go on slipping
    back = -c * expected[0] - s * expected[1], s * expected[0] - c * expected[1], wrapped(-expected[2])
    compose(rel, back, aside)
    if not again:
        slip[0], slip[1], slip[2] = way[0], way[1], 0.0
    slip[2] += 1.0
    if at_once or slip[2] > SLIP_OBSERVATIONS or way[0] - slip[0] > SLIP_DISTANCE[0] or way[1] - slip[1] > SLIP_DISTANCE[1]:
        slip[2] = 0.0
        update_noise_scales(track, between(expected, rel), (0.0, 0.0, 0.0), way[0], way[1])
        _restart_from(track, rel, SLIP_LEFT)


@njit(cache=True, nogil=True, error_model='numpy')
def accept_match(track, anchor, row, share, slipped, at_once):
    """Take in a match: its result ``row``, its score as ``share`` of the best, and whether odometry has ``slipped``.

    ``at_once``: whether a slip is to be believed without a second look.
    """
    track[REL, 0], track[REL, 1], track[REL, 2] = between(anchor, row)
    if share < GOOD_SHARE and track[DOUBT, 0] == NO_DOUBT:
        track[DOUBT, 0], track[DOUBT, 1], track[DOUBT, 2] = share, 0.0, 0.0
    if slipped:
        _confirm_slip(track, at_once)
    else:
        track[SLIP, 2] = 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def unexplained(track):
    """Whether odometry does not lead from the last processed scan to where the newest one was found."""
    x, y, theta = between(track[DRIVEN], track[REL])
    return exceeds(x, y, theta, UNEXPLAINED)


# ---- the processed scan


@njit(cache=True, nogil=True, error_model='numpy')
def predict_all(track, anchors, starts, predictions, known):
    """Lead all particles on from their poses ``anchors`` (N, 3) at the last processed scan.

    Written are ``starts`` and ``predictions`` (N, 3), by the newest match and by odometry, and ``known`` (3, 3):
    variances of the latter, their inverses, and deviations to draw particles with. Those are not more than the user's
    noise, less where odometry is better.
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
def update_from_step(track, anchor, row, step):
    """``learn``, and write the ``step`` (STEP_SIZE,) in the layout of ``odometry_recalibration_kernels``."""
    step[STEP_UNOBSERVED], step[STEP_UNOBSERVED + 1], step[STEP_UNOBSERVED + 2] = degenerate_direction(row)
    step[STEP_TURN], step[STEP_CENTRE] = track[SIGNED_MOTION, 1], track[CENTRE, 0]
    step[STEP_APPLIED:] = 0.0
    learn(track, anchor, row)
