# SPDX-License-Identifier: BSD-3-Clause
"""From the pose, velocity and acceleration of a message to a measurement of the filter's state."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_navigation.fusion.ekf import Measurement
from m2wr_navigation.fusion.ekf_kernels import ACCELERATION, SIZE, TURN, rotation

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

GRAVITY = 9.80665           # m/s^2, standard gravity


class SourceSettings(NamedTuple):
    """How one sensor is used: ``config`` 15 truth values in the order of the state; thresholds in sigmas."""

    config: Sequence[bool]
    differential: bool = False
    relative: bool = False
    remove_gravity: bool = False
    pose_threshold: float = math.inf
    twist_threshold: float = math.inf
    acceleration_threshold: float = math.inf


def matrix_of(quaternion: Sequence[float]) -> FloatArray:
    """Return the (3, 3) rotation of a quaternion (x, y, z, w); ValueError if its length is 0 or not finite."""
    length = math.sqrt(sum(value * value for value in quaternion))
    if not 1e-6 < length < math.inf:
        raise ValueError("the orientation is (%g, %g, %g, %g); expected a unit quaternion" % tuple(quaternion))
    x, y, z, w = (value / length for value in quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def angles_of(matrix: FloatArray) -> FloatArray:
    """Return roll, pitch, yaw [rad] of a (3, 3) rotation."""
    return np.array([math.atan2(matrix[2, 1], matrix[2, 2]), math.asin(max(-1.0, min(1.0, -matrix[2, 0]))),
                     math.atan2(matrix[1, 0], matrix[0, 0])])


def _spread(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return a (6, 6) covariance turned by a rotation."""
    both = np.zeros((6, 6))
    both[:3, :3] = both[3:, 3:] = matrix
    return both @ covariance @ both.T


class Source:
    """One topic of the filter.

    Parameters
    ----------
    settings : SourceSettings
    """

    def __init__(self, settings: SourceSettings) -> None:
        self.settings = settings
        self._used = np.array(settings.config, dtype=bool)
        self.reset()

    def reset(self) -> None:
        """Forget earlier messages."""
        self._first: Optional[Tuple[FloatArray, FloatArray]] = None
        self._last: Optional[Tuple[float, FloatArray, FloatArray, FloatArray]] = None

    def wants(self, first: int, count: int) -> bool:
        """Return whether some of these members of the state are used.

        Parameters
        ----------
        first : int
            The first of them.
        count : int
            How many.
        """
        return bool(self._used[first:first + count].any())

    def pose(self, stamp: float, position: FloatArray, matrix: FloatArray,
             covariance: FloatArray) -> List[Measurement]:
        """Return the measurements that a pose in the world gives: none, or one.

        Parameters
        ----------
        stamp : float
            [s].
        position : (3,) float64
            [m].
        matrix : (3, 3) float64
            Rotation from the body into the world.
        covariance : (6, 6) float64
            In the world.
        """
        if not self.wants(0, 6):
            return []
        if self.settings.differential:
            return self._difference(stamp, position, matrix, covariance)
        if self.settings.relative:
            if self._first is None:
                self._first = position, matrix
            origin, turned = self._first
            position, matrix = turned.T @ (position - origin), turned.T @ matrix
            covariance = _spread(turned.T, covariance)
        return [self._measurement(stamp, 0, np.concatenate([position, angles_of(matrix)]), covariance,
                                  self.settings.pose_threshold)]

    def _difference(self, stamp: float, position: FloatArray, matrix: FloatArray,
                    covariance: FloatArray) -> List[Measurement]:
        last, self._last = self._last, (stamp, position, matrix, covariance)
        if last is None or stamp - last[0] < 1e-6:
            return []
        elapsed = stamp - last[0]
        way, turn = last[2].T @ (position - last[1]), last[2].T @ matrix
        used = np.zeros(SIZE, dtype=bool)
        used[6:12] = self._used[:6]
        both = (_spread(matrix.T, covariance) + _spread(last[2].T, last[3])) * elapsed      # as the original has it
        found = self._measurement(stamp, 6, np.concatenate([way, angles_of(turn)]) / elapsed, both,
                                  self.settings.pose_threshold)
        return [found._replace(used=used)]

    def twist(self, stamp: float, linear: FloatArray, angular: FloatArray, matrix: FloatArray,
              covariance: FloatArray) -> List[Measurement]:
        """Return the measurements that a velocity gives: none, or one.

        Parameters
        ----------
        stamp : float
            [s].
        linear, angular : (3,) float64
            In the sensor's frame [m/s, rad/s].
        matrix : (3, 3) float64
            Rotation from the sensor's frame into the body.
        covariance : (6, 6) float64
            In the sensor's frame.
        """
        if not self.wants(6, 6):
            return []
        return [self._measurement(stamp, 6, np.concatenate([matrix @ linear, matrix @ angular]),
                                  _spread(matrix, covariance), self.settings.twist_threshold)]

    def turn(self, stamp: float, angular: FloatArray, matrix: FloatArray, covariance: FloatArray) -> List[Measurement]:
        """Return the measurements that an IMU's angular velocity gives.

        Parameters
        ----------
        stamp : float
            [s].
        angular : (3,) float64
            In the sensor's frame [rad/s].
        matrix : (3, 3) float64
            Rotation from the sensor's frame into the body.
        covariance : (3, 3) float64
            In the sensor's frame.
        """
        if not self.wants(TURN, 3):
            return []
        found = self._measurement(stamp, TURN, matrix @ angular, matrix @ covariance @ matrix.T,
                                  self.settings.twist_threshold)
        found.used[6:TURN] = False
        return [found]

    def acceleration(self, stamp: float, value: FloatArray, matrix: FloatArray, covariance: FloatArray,
                     sensor: FloatArray) -> List[Measurement]:
        """Return the measurements that an IMU's acceleration gives.

        Parameters
        ----------
        stamp : float
            [s].
        value : (3,) float64
            In the sensor's frame, with gravity [m/s^2].
        matrix : (3, 3) float64
            Rotation from the sensor's frame into the body.
        covariance : (3, 3) float64
            In the sensor's frame.
        sensor : (3, 3) float64
            Rotation from the sensor's frame into the world, to remove gravity.
        """
        if not self.wants(ACCELERATION, 3):
            return []
        if self.settings.remove_gravity:
            value = value - sensor.T @ np.array([0.0, 0.0, GRAVITY])
        return [self._measurement(stamp, ACCELERATION, matrix @ value, matrix @ covariance @ matrix.T,
                                  self.settings.acceleration_threshold)]

    def _measurement(self, stamp: float, first: int, values: FloatArray, covariance: FloatArray,
                     threshold: float) -> Measurement:
        count = len(values)
        used, whole, spread = np.zeros(SIZE, dtype=bool), np.zeros(SIZE), np.zeros((SIZE, SIZE))
        used[first:first + count] = self._used[first:first + count]
        whole[first:first + count] = values
        spread[first:first + count, first:first + count] = covariance
        return Measurement(stamp, used, whole, spread, threshold)


def rotation_of_state(state: FloatArray) -> FloatArray:
    """Return the (3, 3) rotation from the body into the world of a filter's state."""
    return rotation(state[3], state[4], state[5], -1)
