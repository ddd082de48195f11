# SPDX-License-Identifier: BSD-3-Clause
"""State of the tracker, with names for its parts; the kernels change it in place."""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

#: Components of the calibration: relative error of distance and of rotation, rotation per metre [rad/m], position
#: of the laser relative to the centre of rotation x, y [m] and its yaw [rad], all as corrections of what is given.
DISTANCE, ROTATION, DRIFT, MOUNT_X, MOUNT_Y, MOUNT_YAW, PARAMETERS = 0, 1, 2, 3, 4, 5, 6
NAMES = "distance", "rotation", "drift", "laser_x", "laser_y", "laser_yaw"
#: Standard deviations before the first scan.
CALIBRATION_PRIOR = np.array(tuning.CALIBRATION.prior)
#: Growth of the variance per distance as a share of the prior's [1/m]: wheels change, mounts do not.
CALIBRATION_CHANGE = tuning.CALIBRATION.change * np.array([1.0, 0.0, 1.0, 0.0, 0.0, 0.0])


class Calibration(NamedTuple):
    """Estimate of the systematic errors of odometry and of the laser's mount.

    Attributes
    ----------
    value : (6,) float64
        See ``PARAMETERS``.
    covariance : (6, 6) float64
    mount : (3,) float64
        Pose of the centred laser in the base frame, as given [m, m, rad].
    """

    value: FloatArray
    covariance: FloatArray
    mount: FloatArray


class Noise(NamedTuple):
    """Standard deviations of the random errors of odometry.

    Attributes
    ----------
    user : (2, 2) float64
        By the user's parameters; rows translation and heading, columns by distance and by rotation.
    scale : (2, 2) float64
        Estimated factors of these.
    evidence : (2, 2) float64
        Number of steps that each factor was estimated from.
    """

    user: FloatArray
    scale: FloatArray
    evidence: FloatArray


class Track(NamedTuple):
    """Motion since the last processed scan.

    Attributes
    ----------
    matched : (3,) float64
        Pose by the newest match and odometry since then, relative to the last processed scan.
    predicted : (3,) float64
        Pose by odometry alone, relative to the last processed scan.
    jacobian : (3, 6) float64
        Derivative of ``predicted`` by the calibration, in the axes of ``predicted``.
    since_match : (3,) float64
        Motion by odometry as it was received, since the last match.
    slack : (3,) float64
        Variances of the pose from which ``predicted`` was propagated; 0 for the last processed scan.
    motion : (3,) float64
        Since that pose: distance travelled [m], absolute rotation [rad], signed forward distance [m].
    slip_transform : (3,) float64
        Transform from the newest predicted pose to the matched one, while a slip is not confirmed.
    slip : (3,) float64
        Distance and rotation of ``motion`` when the slip was first observed; number of observations, 0 for none.
    """

    matched: FloatArray
    predicted: FloatArray
    jacobian: FloatArray
    since_match: FloatArray
    slack: FloatArray
    motion: FloatArray
    slip_transform: FloatArray
    slip: FloatArray


class Request(NamedTuple):
    """What is asked of the next match; see ``tracking_kernels.expect``.

    Attributes
    ----------
    start : (3,) float64
        Start pose in ``map``.
    expected : (3,) float64
        Pose by odometry in ``map``.
    variances : (3,) float64
        Of the latter along its axes [m^2, m^2, rad^2].
    window : (2,) float64
        Largest displacement by a slip [m, rad].
    anchor : (3,) float64
        Pose at the last processed scan, in ``map``.
    """

    start: FloatArray
    expected: FloatArray
    variances: FloatArray
    window: FloatArray
    anchor: FloatArray


class StepRecord(NamedTuple):
    """What the scan at the end of a step says about the calibration; written by ``tracking_kernels.learn``.

    Attributes
    ----------
    information : (6, 6) float64
        About the calibration.
    vector : (6,) float64
        That information times the observed calibration.
    applied : (6,) float64
        Calibration that was used for the step.
    derivative : (3, 6) float64
        Of the step by the calibration, in the axes of the pose that it leads to.
    forward : (1,) float64
        Distance driven [m].
    """

    information: FloatArray
    vector: FloatArray
    applied: FloatArray
    derivative: FloatArray
    forward: FloatArray


# Each of these is stored in one flat array, which the kernels take: numba needs microseconds to recognise a tuple of
# several arrays. The functions below give names to its parts, in kernels and in Python.

TRACK_SIZE, CALIBRATION_SIZE, NOISE_SIZE, REQUEST_SIZE, RECORD_SIZE = 39, 45, 12, 14, 67


@kernel
def track_of(data: FloatArray) -> Track:
    """Return the named parts of ``data`` (TRACK_SIZE,) float64, as views."""
    return Track(data[:3], data[3:6], data[6:24].reshape(3, PARAMETERS), data[24:27], data[27:30], data[30:33],
                 data[33:36], data[36:39])


@kernel
def calibration_of(data: FloatArray) -> Calibration:
    """Return the named parts of ``data`` (CALIBRATION_SIZE,) float64, as views."""
    return Calibration(data[:6], data[6:42].reshape(PARAMETERS, PARAMETERS), data[42:45])


@kernel
def noise_of(data: FloatArray) -> Noise:
    """Return the named parts of ``data`` (NOISE_SIZE,) float64, as views."""
    return Noise(data[:4].reshape(2, 2), data[4:8].reshape(2, 2), data[8:12].reshape(2, 2))


@kernel
def request_of(data: FloatArray) -> Request:
    """Return the named parts of ``data`` (REQUEST_SIZE,) float64, as views."""
    return Request(data[:3], data[3:6], data[6:9], data[9:11], data[11:14])


@kernel
def record_of(data: FloatArray) -> StepRecord:
    """Return the named parts of ``data`` (RECORD_SIZE,) float64, as views."""
    return StepRecord(data[:36].reshape(PARAMETERS, PARAMETERS), data[36:42], data[42:48],
                      data[48:66].reshape(3, PARAMETERS), data[66:67])


def new_calibration(mount: FloatArray) -> FloatArray:
    """Return the data of a Calibration before the first scan, for a laser at ``mount`` (3,) in the base frame."""
    data = np.zeros(CALIBRATION_SIZE)
    parts = calibration_of.py_func(data)
    parts.covariance[:], parts.mount[:] = np.diag(np.square(CALIBRATION_PRIOR)), mount
    return data


def new_noise(user: FloatArray) -> FloatArray:
    """Return the data of a Noise by the user's parameters (2, 2)."""
    data = np.zeros(NOISE_SIZE)
    parts = noise_of.py_func(data)
    parts.user[:], parts.scale[:] = user, 1.0
    return data


def new_track() -> FloatArray:
    """Return the data of a Track before the first scan."""
    return np.zeros(TRACK_SIZE)
