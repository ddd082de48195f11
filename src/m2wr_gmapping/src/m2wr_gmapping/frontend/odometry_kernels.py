# SPDX-License-Identifier: BSD-3-Clause
"""What scan matches tell of odometry: noise scales, bias and centre of rotation, and their covariances.

Array layouts are those of ``track_layout``, and result rows those of ``match_kernels``.
"""
import math

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

# ---- how far odometry is to be trusted


@njit(cache=True, nogil=True, error_model='numpy')
def user_noise(track, dx, dy, turn):
    """Deviations of a step by the user's parameters alone; as ``motion_model.MotionNoise``."""
    dx, dy, turn = abs(dx), abs(dy), abs(turn)
    by_way, by_turn = track[NOISE, 0], track[NOISE, 1]
    return (by_way * dx + by_turn * turn + CROSS * by_way * dy, by_way * dy + by_turn * turn + CROSS * by_way * dx,
            track[NOISE_TURN, 1] * turn + track[NOISE_TURN, 0] * math.hypot(dx, dy))


@njit(cache=True, nogil=True, error_model='numpy')
def noise_parts(track, distance, turn):
    """Return the parts of the deviations after a way with turns.

    Returns
    -------
    along, across : float
        What the way adds along and across [m].
    turned : float
        What turns add to either of them [m].
    heading, heading_turned : float
        What the way, and what turns add to that of the heading [rad].
    aside : float
        What the heading's makes of the way across [m].
    """
    along, across, _ = user_noise(track, distance, 0.0, 0.0)
    way, turns = track[SCALE, 0], track[SCALE, 1]
    along = (along + MIN_DEVIATION + MIN_DEVIATION_SHARE * distance) * way
    across = (across + MIN_DEVIATION + MIN_DEVIATION_SHARE * distance) * way
    heading = (track[NOISE_TURN, 0] * distance + MIN_DEVIATION) * track[SCALE + 1, 0]
    heading_turned = (track[NOISE_TURN, 1] + MIN_DEVIATION_SHARE) * turn * track[SCALE + 1, 1]
    return along, across, track[NOISE, 1] * turn * turns, heading, heading_turned, 0.5 * distance * (
        heading + heading_turned)


@njit(cache=True, nogil=True, error_model='numpy')
def odometry_variances(track, distance, turn):
    """Return the variances along, across [m^2] and of the heading [rad^2] after a way with turns."""
    along, across, turned, heading, heading_turned, aside = noise_parts(track, distance, turn)
    return (along + turned)**2, (across + turned)**2 + aside * aside, (heading + heading_turned)**2


@njit(cache=True, nogil=True, error_model='numpy')
def bias_variances(track, forward, turn):
    """Return the variances along, across [m^2] and of the heading [rad^2] that an odometry has which errs alike all the
    time, by what is not known of BIAS and CENTRE, after a way ``forward`` [m] and a ``turn`` [rad] with their signs.
    """
    x, y, centre, p = track[AHEAD, 0], track[AHEAD, 1], track[CENTRE, 1], track[COVARIANCE:COVARIANCE + 3]
    heading = p[1, 1] * turn * turn + 2.0 * p[1, 2] * turn * forward + p[2, 2] * forward * forward
    along, across = p[0, 0] * forward * forward, 0.25 * forward * forward * heading
    ahead, aside = 1.0 - math.cos(turn), math.sin(turn)     # what a centre a metre off moves by, as seen at the end
    one, other = x * ahead - y * aside, y * ahead + x * aside
    return (x * x * along + y * y * across + centre * one * one,
            y * y * along + x * x * across + centre * other * other, heading)


@njit(cache=True, nogil=True, error_model='numpy')
def expected_variances(track, out):
    """Write the variances (3,) of EXPECTED along its axes.

    What is not known of the bias is not in them: where walls are plain, noise would draw every match along them.
    """
    own, slack = odometry_variances(track, track[MOTION, 0], track[MOTION, 1]), track[SLACK]
    out[0], out[1], out[2] = own[0] + slack[0], own[1] + slack[1], own[2] + slack[2]


@njit(cache=True, nogil=True, error_model='numpy')
def update_noise_scales(track, error, variance, distance, turn):
    """Let the scales of the deviations follow what one stretch tells.

    Wheels are better or worse than the parameters say.  A match whose scan fixes the pose tells by how much: the scale
    of the deviations follows the expectation of the squared error, given scan and odometry together (the step of an EM
    algorithm).  Where the scan says nothing, as along a corridor, nothing is learnt.

    What way and turns add has a scale each, and hears its share: wheels that are exact straight ahead may scrub in
    turns. Before it has heard much, the scale of the way by turns goes by what is heard of the other, and the reverse:
    a user who thinks too little of the wheels does so in both.

    Parameters
    ----------
    error, variance : tuple of 3 float
        Pose found, from where odometry had it, and variances of the pose found.
    distance, turn : float
        Way since the start of the stretch [m], [rad].
    """
    along, across, turned, heading, heading_turned, _ = noise_parts(track, distance, turn)
    squared = odometry_variances(track, distance, turn)
    by_turn = turned / (along + turned), turned / (across + turned), heading_turned / (heading + heading_turned)
    for k in range(2):
        for part in range(2):
            share = weighted = 0.0
            for axis in range(2 * k, 2 + k):
                heard = max(1.0 - variance[axis] / squared[axis], 0.0)
                excess = min(error[axis] * error[axis] / squared[axis] / max(heard, 1e-3), MAX_ERROR_RATIO) - 1.0
                if axis == 1:       # the rest of what is across is the heading's
                    heard *= (across + turned)**2 / squared[1]
                own = by_turn[axis] if part == 1 else 1.0 - by_turn[axis]
                if k == 0:
                    own += (1.0 - own) / (1.0 + track[SCALE_EVIDENCE, part])
                share += heard * own
                weighted += heard * own * excess
            if share > MIN_SCALE_INFORMATION:
                track[SCALE_EVIDENCE + k, part] += min(share, 1.0)
                memory = min(FIRST_MEMORY + track[SCALE_EVIDENCE + k, part], MEMORY)
                scale = track[SCALE + k, part] * math.sqrt(1.0 + min(share, 1.0) * (weighted / share) / memory)
                track[SCALE + k, part] = min(max(scale, MIN_SCALE), MAX_SCALE)


# ---- what odometry errs by all the time


@njit(cache=True, nogil=True, error_model='numpy')
def corrected(track, x, y, turn):
    """Return a step of odometry without the error that it is known to have, and how far the step leads forwards."""
    forward = x * track[AHEAD, 0] + y * track[AHEAD, 1]
    way, turns, drift = track[BIAS, 0], track[BIAS, 1], track[BIAS, 2]
    turned = turn * (1.0 + turns) + drift * forward
    # a point so far ahead of the centre goes round it
    ahead, aside = track[CENTRE, 0] * (math.cos(turned) - 1.0), track[CENTRE, 0] * math.sin(turned)
    return (x * (1.0 + way) + track[AHEAD, 0] * ahead - track[AHEAD, 1] * aside,
            y * (1.0 + way) + track[AHEAD, 1] * ahead + track[AHEAD, 0] * aside, turned, forward)


@njit(cache=True, nogil=True, error_model='numpy')
def _update_bias_filter(track, row, seen, variance, heard):
    """Take in a measurement of the bias' Kalman filter: ``row`` times the bias, with that variance."""
    if heard < MIN_BIAS_INFORMATION:
        return
    p = track[COVARIANCE:COVARIANCE + 3]
    gain = (p[0, 0] * row[0] + p[0, 1] * row[1] + p[0, 2] * row[2],
            p[1, 0] * row[0] + p[1, 1] * row[1] + p[1, 2] * row[2],
            p[2, 0] * row[0] + p[2, 1] * row[1] + p[2, 2] * row[2])
    noise = MATCH_CORRELATION * variance
    expected = row[0] * gain[0] + row[1] * gain[1] + row[2] * gain[2] + noise
    if seen * seen > OUTLIER_DEVIATIONS * OUTLIER_DEVIATIONS * expected:
        return
    lacked = seen + row[0] * track[BIAS, 0] + row[1] * track[BIAS, 1] + row[2] * track[BIAS, 2]
    for i in range(3):
        track[BIAS_INFORMATION_VECTOR, i] += row[i] * lacked / noise
        for j in range(3):
            track[BIAS_INFORMATION + i, j] += row[i] * row[j] / noise
    for i in range(3):
        track[BIAS, i] += gain[i] * (seen / expected)
        for j in range(3):
            p[i, j] -= gain[i] * gain[j] / expected


@njit(cache=True, nogil=True, error_model='numpy')
def _update_centre(track, turn, seen, variance, heard):
    """Take in what turning has moved aside, as ``_update_bias_filter``."""
    if heard < MIN_BIAS_INFORMATION:
        return
    centre, lever = track[CENTRE], math.sin(turn)
    gain = centre[1] * lever
    expected = gain * lever + MATCH_CORRELATION * variance
    if seen * seen <= OUTLIER_DEVIATIONS * OUTLIER_DEVIATIONS * expected:
        centre[0] += gain * (seen / expected)
        centre[1] -= gain * gain / expected


@njit(cache=True, nogil=True, error_model='numpy')
def update_bias(track, error, variance, told, forward, turn):
    """Let the bias follow what one stretch tells.

    Wheels of other diameters than is thought, at another distance, or of two sizes make an error that adds up instead
    of averaging out, and a match that is held to odometry follows it a little each time. The three are followed by a
    Kalman filter whose measurements are the errors found by the matches; where a scan says nothing, nothing is learnt.
    By itself it is followed how far the centre that odometry tells of lies ahead of the axle: it moves aside in turns.

    Parameters
    ----------
    error : tuple of 3 float
        Where the scan alone has the pose, from where odometry, corrected, had it; in the laser's axes, as all here.
    variance : tuple of 3 float
        Of that, but for what is always the same: of odometry over the stretch, and of the scan.
    told : tuple of 3 float
        How much of each the scan has told, from nothing to all.
    forward, turn : float
        Way [m] and turn [rad] by odometry, with their signs.
    """
    p = track[COVARIANCE:COVARIANCE + 3]
    for i in range(3):
        p[i, i] = min(p[i, i] + BIAS_VARIANCE * BIAS_CHANGES[i] * abs(forward), BIAS_VARIANCE)
    x, y = track[AHEAD, 0], track[AHEAD, 1]         # a laser may look aside or backwards
    xx, yy = x * x, y * y
    _update_bias_filter(track, (forward, 0.0, 0.0), x * error[0] + y * error[1], xx * variance[0] + yy * variance[1],
                        xx * told[0] + yy * told[1])
    _update_bias_filter(track, (0.0, turn, forward), error[2], variance[2], told[2])
    _update_centre(track, turn, x * error[1] - y * error[0], yy * variance[0] + xx * variance[1],
                   yy * told[0] + xx * told[1])


# ---- the match of a processed scan


@njit(cache=True, nogil=True, error_model='numpy')
def _posterior_variances(row, share, prior):
    """Variances of what a scan tells, ``share`` of its information, together with a prior of those variances."""
    a, d, f = (row[INFORMATION] * share + 1.0 / prior[0], row[INFORMATION + 3] * share + 1.0 / prior[1],
               row[INFORMATION + 5] * share + 1.0 / prior[2])
    b, c, e = row[INFORMATION + 1] * share, row[INFORMATION + 2] * share, row[INFORMATION + 4] * share
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    by = 1.0 / (a * p + b * q + c * r)
    return p * by, (a * f - c * c) * by, (a * d - b * b) * by


@njit(cache=True, nogil=True, error_model='numpy')
def _scan_variance(prior, heard):
    """Variance of a scan alone, of which, beside a prior of that variance, so much is heard."""
    return prior * (1.0 - heard) / max(heard, 1e-9)


@njit(cache=True, nogil=True, error_model='numpy')
def _is_odometry_only(track):
    """Whether all that EXPECTED errs by is odometry's: it has led on from the last processed scan itself."""
    slack = track[SLACK]
    return slack[0] == 0.0 and slack[1] == 0.0 and slack[2] == 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def learn(track, anchor, row):
    """Take in how far odometry erred up to a processed scan, by its match in the map of the particle at ``anchor``."""
    way = track[MOTION]
    track[BIAS_INFORMATION:BIAS_INFORMATION_VECTOR + 1] = 0.0
    track[APPLIED_BIAS] = track[BIAS]
    track[TRAVELLED, 0], track[TRAVELLED, 1] = track[SIGNED_MOTION, 0], track[SIGNED_MOTION, 1]
    track[TRAVELLED, 2] = math.atan2(track[AHEAD, 1], track[AHEAD, 0])
    if not _is_odometry_only(track):
        return
    x, y, theta = between(anchor, row)
    prior = odometry_variances(track, way[0], way[1])
    error, variance = between(track[EXPECTED], (x, y, theta)), _posterior_variances(row, 1.0, prior)
    update_noise_scales(track, error, variance, way[0], way[1])


@njit(cache=True, nogil=True, error_model='numpy')
def _significant_share(row, x, y):
    """Return which share of a scan's information along the direction x, y is more than noise of normals makes of it."""
    xx, xy, yy = row[INFORMATION], row[INFORMATION + 1], row[INFORMATION + 3]
    along = x * x * xx + 2.0 * x * y * xy + y * y * yy
    return max(0.0, 1.0 - MIN_INFORMATION_RATIO * (xx + yy) / along) if along > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def _observed_share(row, prior):
    """Return how much a scan tells of where odometry leads along, across and in heading, from nothing to all."""
    left = _posterior_variances(row, 1.0 / DEPENDENT, prior)
    return (max(1.0 - left[0] / prior[0], 0.0) * _significant_share(row, 1.0, 0.0),
            max(1.0 - left[1] / prior[1], 0.0) * _significant_share(row, 0.0, 1.0), max(1.0 - left[2] / prior[2], 0.0))


@njit(cache=True, nogil=True, error_model='numpy')
def is_bias_observable(track, row, inverse):
    """Tell whether a match held less closely to odometry would teach of its bias, and write how closely.

    Wheels that err little from step to step, but always alike, hold every match so closely that no scan would ever tell
    of it. The pose stays held as it is.

    Parameters
    ----------
    row : (13,) float64
        Result of the match of the processed scan.
    inverse : (3,) float64
        Written: inverse variances of EXPECTED in which what is not known of the bias is contained.
    """
    if not _is_odometry_only(track):
        return False
    own = odometry_variances(track, track[MOTION, 0], track[MOTION, 1])
    always = bias_variances(track, track[SIGNED_MOTION, 0], track[SIGNED_MOTION, 1])
    prior = own[0] + always[0], own[1] + always[1], own[2] + always[2]
    for k in range(3):
        inverse[k] = 1.0 / prior[k]
    heard = _observed_share(row, prior)
    return heard[0] >= MIN_BIAS_INFORMATION or heard[1] >= MIN_BIAS_INFORMATION or heard[2] >= MIN_BIAS_INFORMATION


@njit(cache=True, nogil=True, error_model='numpy')
def update_bias_unconstrained(track, anchor, row, inverse):
    """Update the bias by the match of a processed scan, whose prior is ``inverse`` of ``is_bias_observable``."""
    own = odometry_variances(track, track[MOTION, 0], track[MOTION, 1])
    prior = 1.0 / inverse[0], 1.0 / inverse[1], 1.0 / inverse[2]
    x, y, theta = between(anchor, row)
    error = between(track[EXPECTED], (x, y, theta))
    left, heard = _posterior_variances(row, 1.0, prior), _observed_share(row, prior)
    told = (max(1.0 - left[0] / prior[0], MIN_BIAS_INFORMATION), max(1.0 - left[1] / prior[1], MIN_BIAS_INFORMATION),
            max(1.0 - left[2] / prior[2], MIN_BIAS_INFORMATION))
    seen = (own[0] + _scan_variance(prior[0], heard[0]), own[1] + _scan_variance(prior[1], heard[1]),
            own[2] + _scan_variance(prior[2], heard[2]))
    # a match is the mean of scan and odometry, weighted by what was told: alone the scan says that much more
    update_bias(track, (error[0] / told[0], error[1] / told[1], error[2] / told[2]), seen, heard, track[SIGNED_MOTION, 0],
                track[SIGNED_MOTION, 1])
