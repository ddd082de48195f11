# SPDX-License-Identifier: BSD-3-Clause
"""Rows of the arrays that ``tracking_kernels`` and ``odometry_kernels`` share, and their constants.

Array layouts
-------------
``track`` (TRACK_ROWS, 3) float64
    The motion since the last processed scan, and the calibration of odometry.  One row each:

    REL, EXPECTED
        pose by the newest match and odometry since then, and by odometry; from the last processed scan
    DRIVEN, SINCE
        motion by raw odometry since the last processed scan, and since the last match
    SLACK
        variances of the pose from which EXPECTED was propagated
    MOTION
        distance travelled [m] and absolute rotation [rad] since then
    SIGNED_MOTION
        forward distance [m] and rotation [rad] since then, with their signs
    SLIP_TRANSFORM, SLIP
        transform from odometry's newest pose to the matched one; MOTION at its first observation, number of
        observations
    DOUBT
        score share of a doubtful match that was checked, NO_DOUBT for none; motion [m], [rad] since then
    SCALE
        scales of odometry's deviations, one row for translation and one for heading; the columns are the
        parts caused by distance and by rotation
    SCALE_EVIDENCE
        number of steps that each scale was estimated from; two rows as SCALE
    BIAS, COVARIANCE
        bias of odometry: scale of distance, scale of rotation, rotation per metre; its covariance, three rows
    CENTRE
        offset of odometry's reference point ahead of the centre of rotation [m], and its variance
    AHEAD
        forward direction of the base in the laser's frame
    NOISE, NOISE_TURN
        user's noise of translation by distance and rotation; of heading by rotation and distance
    BIAS_INFORMATION
        information of the newest processed scan about the bias, three rows
    BIAS_INFORMATION_VECTOR
        that information times the measured bias
    APPLIED_BIAS
        bias that was removed from odometry up to that scan
    TRAVELLED
        forward distance [m] and rotation [rad] up to that scan, direction of AHEAD [rad]; the rows from
        BIAS_INFORMATION on are the last ones
``ask`` (ASK_ROWS, 3) float64
    START, WANTED
        start pose of a match in ``map``, and the pose by odometry
    VARIANCES, INVERSE
        of the latter along its axes [m^2, m^2, rad^2]
    WINDOW
        largest displacement by a slip [m, rad]
"""
from __future__ import annotations

(REL, EXPECTED, DRIVEN, SINCE, SLACK, MOTION, SIGNED_MOTION, SLIP_TRANSFORM, SLIP, DOUBT, SCALE, SCALE_EVIDENCE, BIAS,
 COVARIANCE, CENTRE, AHEAD, NOISE, NOISE_TURN, BIAS_INFORMATION, BIAS_INFORMATION_VECTOR, APPLIED_BIAS, TRAVELLED,
 TRACK_ROWS) = (
     0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 15, 18, 19, 20, 21, 22, 25, 26, 27, 28)
SINCE_PROCESSED = DOUBT     # each processed scan resets the rows before this one to 0
START, WANTED, VARIANCES, INVERSE, WINDOW, ASK_ROWS = 0, 1, 2, 3, 4, 5
COST, INFORMATION = 6, 7
STEP_UNOBSERVED, STEP_TURN, STEP_CENTRE, STEP_APPLIED = 0, 3, 4, 5
NO_DOUBT = -1.0

STATIONARY = 0.005, 0.005, 0.005                 # scans closer to the last matched one are not matched [m, m, rad]
LONG_STEP = 0.15, 0.15, 0.1                 # after such a step a match may converge to a wrong pose [m, m, rad]
SLIP_FLOOR, SLIP_SHARE = (0.2, 0.3), 0.4    # search window of a slip [m, rad]; growth with the step
SLIP_DISTANCE = 0.15, 0.1                       # a slip is accepted if it persists over this motion [m, rad]
SLIP_OBSERVATIONS = 20                             # or over this number of scans
SLIP_TOLERANCE = 0.1, 0.1, 0.1                 # and changes by at most this from scan to scan [m, m, rad]
SLIP_LEFT = 0.05**2, 0.05**2, 0.03**2       # variance of odometry after a slip [m^2, m^2, rad^2]
GOOD_SHARE = 0.8                            # share of the beams below whose score a match is doubted
RECHECK_AFTER, LOWER_SHARE = (0.15, 0.15), 0.1  # motion [m, rad], or fall of the score, after which to doubt again
UNEXPLAINED = 0.05, 0.05, 0.02              # errors of odometry that shift a point at 2.5 m by a cell [m, m, rad]
DEPENDENT = 10.0            # errors of beams are correlated: so many beams count as one

CROSS = 0.3                 # share of the noise along a direction that motion across it adds
MIN_DEVIATION = 0.004               # standard deviation of a step of length 0 [m] or [rad]
MIN_DEVIATION_SHARE = 0.005         # its growth with distance and rotation
MEMORY, FIRST_MEMORY = 10.0, 1.0    # memory of the scale [steps]; weight of the user's parameters [steps]
MAX_ERROR_RATIO = 9.0              # greatest ratio of squared error to expectation
MIN_SCALE_INFORMATION = 0.01        # a scan with less information changes no scale
MIN_SCALE, MAX_SCALE = 0.1, 30.0       # of the scale
BIAS_VARIANCE = 0.03 * 0.03         # initial variance: scales of distance and rotation, rotation per metre
BIAS_CHANGES = 1.0 / 300.0, 0.0, 1.0 / 300.0    # growth of the variance per metre, as a share of it
CENTRE_VARIANCE = 0.1 * 0.1         # initial variance of the offset of the centre of rotation [m^2]
MATCH_CORRELATION = 4.0              # errors of successive matches are correlated: so many count as one
MIN_BIAS_INFORMATION = 0.1          # a scan with less information does not change the bias
MIN_INFORMATION_RATIO = 0.085       # a smaller share of information along a direction is noise of the normals
OUTLIER_DEVIATIONS = 4.0               # errors beyond this are outliers [standard deviations]
