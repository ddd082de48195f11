# SPDX-License-Identifier: BSD-3-Clause
"""Where the robot is between two processed scans, and what matches find of odometry: the arithmetic of ``tracking``.

All in one file: what numba keeps of a compiled kernel is renewed when the file of that kernel changes, not when one
that it calls does.

Array layouts
-------------
``track`` (TRACK_ROWS, 3) float64
    All that is known of the way since the last processed scan, and of odometry.  One row each:

    REL, EXPECTED       pose by the newest match and odometry since then, and by odometry; from the last processed scan
    DRIVEN, SINCE       way by plain odometry since the last processed scan, and since the last match
    SLACK               variances of the pose from which EXPECTED leads on
    WAY                 distance [m] and turns [rad] since then
    SIGNED              the same forwards and to the left, less what went back again
    ASIDE, SLIP         what takes odometry's newest pose to the one found; WAY when first seen, how often seen
    DOUBT               score share of a doubt that was answered, NO_DOUBT for none; way [m], [rad] since then
    SCALE, HEARD        scales of odometry's deviations, and how many steps have told of each; two rows each, of the way
                        and of the heading, both by way and by turn
    BIAS, COVARIANCE    scale of ways, of turns, turn a metre, that odometry lacks; three rows of their covariance
    CENTRE              how far odometry's centre lies ahead of that of turning [m], and the variance of that
    AHEAD               forward direction of the base in the laser's frame
    NOISE, NOISE_TURN   noise of the way by way and by turn, noise of the heading by way and by turn
    TOLD, TOLD_OF       what the newest processed scan has told of the bias: information, three rows, and that times the
                        bias it told of
    LED_BY, LED         bias that odometry was corrected by on the way to that scan; forward way [m] and turn [rad] with
                        their signs, direction of AHEAD [rad]; from TOLD on these are the last rows
``ask`` (ASK_ROWS, 3) float64
    START, WANTED       poses in ``map`` where a match begins, and where odometry has it
    VARIANCES, INVERSE  of the latter along its axes [m^2, m^2, rad^2]
    WINDOW              how far a slip may have led aside [m, rad]
Result rows of a match are those of ``match_kernels``: pose, score, log-likelihood, partners, cost, information.
"""
import math

from numba import njit

(REL, EXPECTED, DRIVEN, SINCE, SLACK, WAY, SIGNED, ASIDE, SLIP, DOUBT, SCALE, HEARD, BIAS, COVARIANCE, CENTRE, AHEAD,
 NOISE, NOISE_TURN, TOLD, TOLD_OF, LED_BY, LED, TRACK_ROWS) = (
     0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 15, 18, 19, 20, 21, 22, 25, 26, 27, 28)
SINCE_PROCESSED = DOUBT     # rows before this one begin anew, at 0, with each processed scan
START, WANTED, VARIANCES, INVERSE, WINDOW, ASK_ROWS = 0, 1, 2, 3, 4, 5
COST, INFORMATION = 6, 7
SILENT_AXIS, STEP_TURN, STEP_CENTRE, STEP_APPLIED = 0, 3, 4, 5
NO_DOUBT = -1.0

STILL = 0.005, 0.005, 0.005                 # a scan from so near the last matched one tells nothing new [m, m, rad]
LONG_STEP = 0.15, 0.15, 0.1                 # after such a step a plain match may be caught beside the right place
SLIP_FLOOR, SLIP_SHARE = (0.2, 0.3), 0.4    # how far a slip leads aside [m, rad]; growth with the step
SLIP_SEEN = 0.15, 0.1                       # a slip is believed when it is still there that much later [m, rad]
SLIP_LOOKS = 20                             # or has been seen so often in a row
SLIP_AGREES = 0.1, 0.1, 0.1                 # and changes by no more from one scan to the next [m, m, rad]
SLIP_LEFT = 0.05**2, 0.05**2, 0.03**2       # variance that odometry has after a slip was found [m^2, m^2, rad^2]
GOOD_SHARE = 0.8                            # share of the beams' best possible score below which a match is doubted
ASK_AGAIN, WORSE_SHARE = (0.15, 0.15), 0.1  # way [m, rad], or fall of the score, after which to doubt anew
UNEXPLAINED = 0.05, 0.05, 0.02              # errors of odometry that move what is 2.5 m away by a cell [m, m, rad]
DEPENDENT = 10.0            # beams of one scan err together: as if there were that many fewer

CROSS = 0.3                 # share of the noise along a direction that movement across it adds
LEAST = 0.004               # deviation of no step at all [m] or [rad]
LEAST_SHARE = 0.005         # and its share of the distance and of the turn
MEMORY, FIRST_MEMORY = 10.0, 1.0    # steps that the scale remembers; the parameters count for as much as so many
SURPRISE = 9.0              # a step counts for no more than that many times what was expected
LEAST_TOLD = 0.01           # a scan that says less is not heard
NARROWEST, WIDEST = 0.1, 30.0       # of the scale
BIAS_VARIANCE = 0.03 * 0.03         # what wheels may err by: scale of ways, of turns, turn a metre
BIAS_CHANGES = 1.0 / 300.0, 0.0, 1.0 / 300.0    # share of it by which they may change in a metre
CENTRE_VARIANCE = 0.1 * 0.1         # of how far off its axle a base frame may lie without odometry knowing [m^2]
TOGETHER = 4.0              # the errors of matches that follow each other are alike: as if there were that many fewer
LEAST_TAUGHT = 0.1          # a scan that says less teaches nothing about the bias
SILENT = 0.085              # what a scan says along a wall is noise below that share of what it says across
FAR_OFF = 4.0               # deviations beyond which an error is none of odometry's usual ones


@njit(cache=True, nogil=True, error_model='numpy')
def _wrapped(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit(cache=True, nogil=True, error_model='numpy')
def _compose(a, b, out):
    """Write the pose ``b``, given in the frame ``a``, in the frame in which ``a`` is given; ``out`` may be either."""
    c, s = math.cos(a[2]), math.sin(a[2])
    out[0], out[1], out[2] = a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], _wrapped(a[2] + b[2])


@njit(cache=True, nogil=True, error_model='numpy')
def _between(a, b):
    """Return the pose ``b`` as seen from ``a``, as three numbers."""
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    return c * dx + s * dy, c * dy - s * dx, _wrapped(b[2] - a[2])


@njit(cache=True, nogil=True, error_model='numpy')
def _exceeds(x, y, theta, limits):
    return abs(x) > limits[0] or abs(y) > limits[1] or abs(theta) > limits[2]


# ---- how far odometry is to be trusted


@njit(cache=True, nogil=True, error_model='numpy')
def _user_noise(track, dx, dy, turn):
    """Deviations of a step by the user's parameters alone; as ``motion_model.MotionNoise``."""
    dx, dy, turn = abs(dx), abs(dy), abs(turn)
    by_way, by_turn = track[NOISE, 0], track[NOISE, 1]
    return (by_way * dx + by_turn * turn + CROSS * by_way * dy, by_way * dy + by_turn * turn + CROSS * by_way * dx,
            track[NOISE_TURN, 1] * turn + track[NOISE_TURN, 0] * math.hypot(dx, dy))


@njit(cache=True, nogil=True, error_model='numpy')
def trust_parts(track, distance, turn):
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
    along, across, _ = _user_noise(track, distance, 0.0, 0.0)
    way, turns = track[SCALE, 0], track[SCALE, 1]
    along = (along + LEAST + LEAST_SHARE * distance) * way
    across = (across + LEAST + LEAST_SHARE * distance) * way
    heading = (track[NOISE_TURN, 0] * distance + LEAST) * track[SCALE + 1, 0]
    heading_turned = (track[NOISE_TURN, 1] + LEAST_SHARE) * turn * track[SCALE + 1, 1]
    return along, across, track[NOISE, 1] * turn * turns, heading, heading_turned, 0.5 * distance * (
        heading + heading_turned)


@njit(cache=True, nogil=True, error_model='numpy')
def odometry_variances(track, distance, turn):
    """Return the variances along, across [m^2] and of the heading [rad^2] after a way with turns."""
    along, across, turned, heading, heading_turned, aside = trust_parts(track, distance, turn)
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
def _variances(track, out):
    """Write the variances (3,) of EXPECTED along its axes.

    What is not known of the bias is not in them: where walls are plain, noise would draw every match along them.
    """
    own, slack = odometry_variances(track, track[WAY, 0], track[WAY, 1]), track[SLACK]
    out[0], out[1], out[2] = own[0] + slack[0], own[1] + slack[1], own[2] + slack[2]


@njit(cache=True, nogil=True, error_model='numpy')
def learn_trust(track, error, variance, distance, turn):
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
    along, across, turned, heading, heading_turned, _ = trust_parts(track, distance, turn)
    squared = odometry_variances(track, distance, turn)
    by_turn = turned / (along + turned), turned / (across + turned), heading_turned / (heading + heading_turned)
    for k in range(2):
        for part in range(2):
            share = weighted = 0.0
            for axis in range(2 * k, 2 + k):
                heard = max(1.0 - variance[axis] / squared[axis], 0.0)
                excess = min(error[axis] * error[axis] / squared[axis] / max(heard, 1e-3), SURPRISE) - 1.0
                if axis == 1:       # the rest of what is across is the heading's
                    heard *= (across + turned)**2 / squared[1]
                own = by_turn[axis] if part == 1 else 1.0 - by_turn[axis]
                if k == 0:
                    own += (1.0 - own) / (1.0 + track[HEARD, part])
                share += heard * own
                weighted += heard * own * excess
            if share > LEAST_TOLD:
                track[HEARD + k, part] += min(share, 1.0)
                memory = min(FIRST_MEMORY + track[HEARD + k, part], MEMORY)
                scale = track[SCALE + k, part] * math.sqrt(1.0 + min(share, 1.0) * (weighted / share) / memory)
                track[SCALE + k, part] = min(max(scale, NARROWEST), WIDEST)


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
def _update_bias(track, row, seen, variance, heard):
    """Take in a measurement of the bias' Kalman filter: ``row`` times the bias, with that variance."""
    if heard < LEAST_TAUGHT:
        return
    p = track[COVARIANCE:COVARIANCE + 3]
    gain = (p[0, 0] * row[0] + p[0, 1] * row[1] + p[0, 2] * row[2],
            p[1, 0] * row[0] + p[1, 1] * row[1] + p[1, 2] * row[2],
            p[2, 0] * row[0] + p[2, 1] * row[1] + p[2, 2] * row[2])
    noise = TOGETHER * variance
    expected = row[0] * gain[0] + row[1] * gain[1] + row[2] * gain[2] + noise
    if seen * seen > FAR_OFF * FAR_OFF * expected:
        return
    lacked = seen + row[0] * track[BIAS, 0] + row[1] * track[BIAS, 1] + row[2] * track[BIAS, 2]
    for i in range(3):
        track[TOLD_OF, i] += row[i] * lacked / noise
        for j in range(3):
            track[TOLD + i, j] += row[i] * row[j] / noise
    for i in range(3):
        track[BIAS, i] += gain[i] * (seen / expected)
        for j in range(3):
            p[i, j] -= gain[i] * gain[j] / expected


@njit(cache=True, nogil=True, error_model='numpy')
def _update_centre(track, turn, seen, variance, heard):
    """Take in what turning has moved aside, as ``_update_bias``."""
    if heard < LEAST_TAUGHT:
        return
    centre, lever = track[CENTRE], math.sin(turn)
    gain = centre[1] * lever
    expected = gain * lever + TOGETHER * variance
    if seen * seen <= FAR_OFF * FAR_OFF * expected:
        centre[0] += gain * (seen / expected)
        centre[1] -= gain * gain / expected


@njit(cache=True, nogil=True, error_model='numpy')
def learn_bias(track, error, variance, told, forward, turn):
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
    _update_bias(track, (forward, 0.0, 0.0), x * error[0] + y * error[1], xx * variance[0] + yy * variance[1],
                 xx * told[0] + yy * told[1])
    _update_bias(track, (0.0, turn, forward), error[2], variance[2], told[2])
    _update_centre(track, turn, x * error[1] - y * error[0], yy * variance[0] + xx * variance[1],
                   yy * told[0] + xx * told[1])


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
    step = _between(before, now)
    x, y, theta, forward = corrected(track, step[0], step[1], step[2])
    for row in (REL, EXPECTED):
        _compose(track[row], (x, y, theta), track[row])
    for row in (DRIVEN, SINCE):
        _compose(track[row], step, track[row])
    distance, turn = math.hypot(step[0], step[1]), abs(step[2])
    track[SIGNED, 0] += forward
    track[SIGNED, 1] += step[2]
    track[WAY, 0] += distance
    track[WAY, 1] += turn
    since = track[SINCE]
    return distance, turn, _exceeds(since[0], since[1], since[2], STILL)


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
    if doubt[1] > ASK_AGAIN[0] or doubt[2] > ASK_AGAIN[1]:
        doubt[0] = NO_DOUBT
        return GOOD_SHARE
    return min(GOOD_SHARE, doubt[0] - WORSE_SHARE)


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
    long = _exceeds(since[0], since[1], since[2], LONG_STEP)
    since[0] = since[1] = since[2] = 0.0
    _compose(anchor, track[REL], ask[START])
    _compose(anchor, track[EXPECTED], ask[WANTED])
    _variances(track, ask[VARIANCES])
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
    x, y, turn = _between(expected, row)
    pull = x * x / variances[0] + y * y / variances[1] + turn * turn / variances[2]
    return row[COST] / DEPENDENT + 0.5 * pull, pull


@njit(cache=True, nogil=True, error_model='numpy')
def silent_axis(row):
    """Return the projector, as xx, xy, yy, on the direction in which the scan of a match does not hold the place.

    Nothing where it holds both directions, or neither.
    """
    h = row[INFORMATION:]
    by = 1.0 / h[5] if h[5] > 0.0 else 0.0
    a, b, d = h[0] - h[2] * h[2] * by, h[1] - h[2] * h[4] * by, h[3] - h[4] * h[4] * by     # whatever the heading
    half, middle = 0.5 * (a - d), 0.5 * (a + d)
    root = math.sqrt(half * half + b * b)
    if not (root > 0.0 and middle - root < SILENT * (middle + root)):
        return 0.0, 0.0, 0.0
    # of the weak axis: (1 - (matrix - middle) / root) / 2
    return 0.5 * (1.0 - half / root), -0.5 * b / root, 0.5 * (1.0 + half / root)


@njit(cache=True, nogil=True, error_model='numpy')
def lead_back(row, expected):
    """Move the pose of a match to ``expected`` (3,) in the direction in which its scan says nothing."""
    xx, xy, yy = silent_axis(row)
    x, y, _ = _between(row, expected)
    _compose(row, (xx * x + xy * y, xy * x + yy * y, 0.0), row)


@njit(cache=True, nogil=True, error_model='numpy')
def lead_all_back(rows, expected):
    """``lead_back`` of many matches (N, 13), each to its own ``expected`` (N, 3)."""
    for n in range(rows.shape[0]):
        lead_back(rows[n], expected[n])


@njit(cache=True, nogil=True, error_model='numpy')
def _begin_from(track, rel, slack):
    """From here on odometry leads on from the pose ``rel``, which is known with the variances ``slack``."""
    for k in range(3):
        track[EXPECTED, k], track[SLACK, k] = rel[k], slack[k]
        track[WAY, k] = track[SIGNED, k] = 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def _judge(track, at_once):
    """Believe in a slip that is seen over some way: a robot that rocks looks like one for a moment."""
    aside, slip, way = track[ASIDE], track[SLIP], track[WAY]
    rel, expected = track[REL], track[EXPECTED]
    again = slip[2] > 0.0
    if again:
        c, s = math.cos(aside[2]), math.sin(aside[2])
        led = (aside[0] + c * expected[0] - s * expected[1], aside[1] + s * expected[0] + c * expected[1],
               _wrapped(aside[2] + expected[2]))
        x, y, theta = _between(led, rel)
        again = not _exceeds(x, y, theta, SLIP_AGREES)
    c, s = math.cos(expected[2]), math.sin(expected[2])     # rel (+) inverse(expected): wheels may go on slipping
    back = -c * expected[0] - s * expected[1], s * expected[0] - c * expected[1], _wrapped(-expected[2])
    _compose(rel, back, aside)
    if not again:
        slip[0], slip[1], slip[2] = way[0], way[1], 0.0
    slip[2] += 1.0
    if at_once or slip[2] > SLIP_LOOKS or way[0] - slip[0] > SLIP_SEEN[0] or way[1] - slip[1] > SLIP_SEEN[1]:
        slip[2] = 0.0
        learn_trust(track, _between(expected, rel), (0.0, 0.0, 0.0), way[0], way[1])
        _begin_from(track, rel, SLIP_LEFT)


@njit(cache=True, nogil=True, error_model='numpy')
def settle(track, anchor, row, share, slipped, at_once):
    """Take in a match: its result ``row``, its score as ``share`` of the best, and whether odometry has ``slipped``.

    ``at_once``: whether a slip is to be believed without a second look.
    """
    track[REL, 0], track[REL, 1], track[REL, 2] = _between(anchor, row)
    if share < GOOD_SHARE and track[DOUBT, 0] == NO_DOUBT:
        track[DOUBT, 0], track[DOUBT, 1], track[DOUBT, 2] = share, 0.0, 0.0
    if slipped:
        _judge(track, at_once)
    else:
        track[SLIP, 2] = 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def unexplained(track):
    """Whether odometry does not lead from the last processed scan to where the newest one was found."""
    x, y, theta = _between(track[DRIVEN], track[REL])
    return _exceeds(x, y, theta, UNEXPLAINED)


# ---- the processed scan


@njit(cache=True, nogil=True, error_model='numpy')
def lead(track, anchors, starts, predictions, known):
    """Lead all particles on from their poses ``anchors`` (N, 3) at the last processed scan.

    Written are ``starts`` and ``predictions`` (N, 3), by the newest match and by odometry, and ``known`` (3, 3):
    variances of the latter, their inverses, and deviations to draw particles with. Those are not more than the user's
    noise, less where odometry is better.
    """
    for n in range(anchors.shape[0]):
        _compose(anchors[n], track[REL], starts[n])
        _compose(anchors[n], track[EXPECTED], predictions[n])
    _variances(track, known[0])
    expected = track[EXPECTED]
    noise = _user_noise(track, expected[0], expected[1], expected[2])
    for k in range(3):
        known[1, k] = 1.0 / known[0, k]
        known[2, k] = min(math.sqrt(known[0, k]), noise[k])


@njit(cache=True, nogil=True, error_model='numpy')
def _left(row, share, prior):
    """Variances of what a scan tells, ``share`` of its information, together with a prior of those variances."""
    a, d, f = (row[INFORMATION] * share + 1.0 / prior[0], row[INFORMATION + 3] * share + 1.0 / prior[1],
               row[INFORMATION + 5] * share + 1.0 / prior[2])
    b, c, e = row[INFORMATION + 1] * share, row[INFORMATION + 2] * share, row[INFORMATION + 4] * share
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    by = 1.0 / (a * p + b * q + c * r)
    return p * by, (a * f - c * c) * by, (a * d - b * b) * by


@njit(cache=True, nogil=True, error_model='numpy')
def _alone(prior, heard):
    """Variance of a scan alone, of which, beside a prior of that variance, so much is heard."""
    return prior * (1.0 - heard) / max(heard, 1e-9)


@njit(cache=True, nogil=True, error_model='numpy')
def _odometry_alone(track):
    """Whether all that EXPECTED errs by is odometry's: it has led on from the last processed scan itself."""
    slack = track[SLACK]
    return slack[0] == 0.0 and slack[1] == 0.0 and slack[2] == 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def learn(track, anchor, row):
    """Take in how far odometry erred up to a processed scan, by its match in the map of the particle at ``anchor``."""
    way = track[WAY]
    track[TOLD:TOLD_OF + 1] = 0.0
    track[LED_BY] = track[BIAS]
    track[LED, 0], track[LED, 1] = track[SIGNED, 0], track[SIGNED, 1]
    track[LED, 2] = math.atan2(track[AHEAD, 1], track[AHEAD, 0])
    if not _odometry_alone(track):
        return
    x, y, theta = _between(anchor, row)
    prior = odometry_variances(track, way[0], way[1])
    learn_trust(track, _between(track[EXPECTED], (x, y, theta)), _left(row, 1.0, prior), way[0], way[1])


@njit(cache=True, nogil=True, error_model='numpy')
def _borne_out(row, x, y):
    """Return which share of a scan's information along the direction x, y is more than noise of normals makes of it."""
    xx, xy, yy = row[INFORMATION], row[INFORMATION + 1], row[INFORMATION + 3]
    along = x * x * xx + 2.0 * x * y * xy + y * y * yy
    return max(0.0, 1.0 - SILENT * (xx + yy) / along) if along > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model='numpy')
def _heard(row, prior):
    """Return how much a scan tells of where odometry leads along, across and in heading, from nothing to all."""
    left = _left(row, 1.0 / DEPENDENT, prior)
    return (max(1.0 - left[0] / prior[0], 0.0) * _borne_out(row, 1.0, 0.0),
            max(1.0 - left[1] / prior[1], 0.0) * _borne_out(row, 0.0, 1.0), max(1.0 - left[2] / prior[2], 0.0))


@njit(cache=True, nogil=True, error_model='numpy')
def would_teach(track, row, inverse):
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
    if not _odometry_alone(track):
        return False
    own = odometry_variances(track, track[WAY, 0], track[WAY, 1])
    always = bias_variances(track, track[SIGNED, 0], track[SIGNED, 1])
    prior = own[0] + always[0], own[1] + always[1], own[2] + always[2]
    for k in range(3):
        inverse[k] = 1.0 / prior[k]
    heard = _heard(row, prior)
    return heard[0] >= LEAST_TAUGHT or heard[1] >= LEAST_TAUGHT or heard[2] >= LEAST_TAUGHT


@njit(cache=True, nogil=True, error_model='numpy')
def learn_freely(track, anchor, row, inverse):
    """Take in the match of a processed scan that was held to odometry with ``inverse``, as ``would_teach`` wrote it."""
    own = odometry_variances(track, track[WAY, 0], track[WAY, 1])
    prior = 1.0 / inverse[0], 1.0 / inverse[1], 1.0 / inverse[2]
    x, y, theta = _between(anchor, row)
    error = _between(track[EXPECTED], (x, y, theta))
    left, heard = _left(row, 1.0, prior), _heard(row, prior)
    told = (max(1.0 - left[0] / prior[0], LEAST_TAUGHT), max(1.0 - left[1] / prior[1], LEAST_TAUGHT),
            max(1.0 - left[2] / prior[2], LEAST_TAUGHT))
    seen = (own[0] + _alone(prior[0], heard[0]), own[1] + _alone(prior[1], heard[1]),
            own[2] + _alone(prior[2], heard[2]))
    # a match is the mean of scan and odometry, weighted by what was told: alone the scan says that much more
    learn_bias(track, (error[0] / told[0], error[1] / told[1], error[2] / told[2]), seen, heard, track[SIGNED, 0],
               track[SIGNED, 1])


@njit(cache=True, nogil=True, error_model='numpy')
def learn_step(track, anchor, row, step):
    """``learn``, and write the ``step`` (STEP_SIZE,) in the layout of ``odometry_recalibration_kernels``."""
    step[SILENT_AXIS], step[SILENT_AXIS + 1], step[SILENT_AXIS + 2] = silent_axis(row)
    step[STEP_TURN], step[STEP_CENTRE] = track[SIGNED, 1], track[CENTRE, 0]
    step[STEP_APPLIED:] = 0.0
    learn(track, anchor, row)
