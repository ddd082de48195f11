# SPDX-License-Identifier: BSD-3-Clause
"""Poses and maps from messages, checked."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Sequence, Tuple

import numpy as np

from m2wr_navigation.localization.localization_map import FARTHEST, LocalizationMap, MapError
from m2wr_navigation.ros.transforms import quaternion_yaw

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

LEAST_LENGTH = 1e-3         # of a quaternion: below, its direction is noise
MOST_VARIANCE = 1e12        # of an initial pose: beyond, particles lie where sums of positions lose metres
PLANE = np.array([0, 1, 5])     # x, y and yaw among the six coordinates of a covariance


def planar(translation: Sequence[float], quaternion: Sequence[float]) -> FloatArray:
    """Return x, y [m], theta [rad] of a transform's parts.

    Parameters
    ----------
    translation : (3,) float
    quaternion : (4,) float
        x, y, z, w.
    """
    return np.array([translation[0], translation[1], quaternion_yaw(*quaternion)])


def checked_pose(pose: Any) -> FloatArray:
    """Return x, y [m], theta [rad] of a Pose; raises ValueError if it is none."""
    place, turn = pose.position, pose.orientation
    numbers = (turn.x, turn.y, turn.z, turn.w)
    if not all(abs(value) <= FARTHEST for value in (place.x, place.y)):
        raise ValueError("its position is ({}, {}); expected numbers up to {:g}".format(place.x, place.y, FARTHEST))
    if not (all(abs(value) <= 1e6 for value in numbers) and math.hypot(*numbers) >= LEAST_LENGTH):
        raise ValueError("its orientation is {}; expected a quaternion".format(numbers))
    return np.array([place.x, place.y, quaternion_yaw(*numbers)])


def pose_of_message(message: Any) -> Tuple[FloatArray, FloatArray]:
    """Return pose (3,) and covariance (3, 3) of x, y, theta of a PoseWithCovariance.

    Raises
    ------
    ValueError
        If the pose is none, or the covariance is not one.
    """
    full = np.array(message.covariance, float).reshape(6, 6)
    covariance = full[np.ix_(PLANE, PLANE)]
    if not (np.abs(covariance) <= MOST_VARIANCE).all() or (np.diag(covariance) < 0.0).any():
        raise ValueError("its covariance of x, y, yaw is {}; expected finite numbers, and none below 0 for x, y, yaw "
                         "themselves".format(covariance.tolist()))
    return checked_pose(message.pose), 0.5 * (covariance + covariance.T)


def map_of_message(message: Any) -> LocalizationMap:
    """Return the map of an OccupancyGrid; raises MapError if it cannot be used."""
    info = message.info
    try:
        origin = checked_pose(info.origin)
    except ValueError as error:
        raise MapError("origin: {}".format(error)) from error
    return LocalizationMap.from_message(np.asarray(message.data, np.int8), info.width, info.height,
                                        float(info.resolution), tuple(origin))
