# SPDX-License-Identifier: BSD-3-Clause
"""The pose of a robot on rough ground from wheels and IMU: wheels know the distance, the IMU where it leads."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]


def rotation_of(quaternion: Sequence[float]) -> Values:
    """Return the rotation matrix (3, 3) of a quaternion x, y, z, w.

    Raises
    ------
    ValueError
        If it is not finite or nearly zero.
    """
    x, y, z, w = (float(value) for value in quaternion)
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not (math.isfinite(norm) and norm > 1e-6):
        raise ValueError("the quaternion ({}, {}, {}, {}) is no orientation".format(x, y, z, w))
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    return np.array([[1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
                     [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
                     [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)]])


def heading(rotation: Values) -> float:
    """Return the heading of a rotation matrix (3, 3) [rad]."""
    return math.atan2(rotation[1, 0], rotation[0, 0])


class DeadReckoning:
    """Adds up the distance of the wheels along the x axis of the IMU's orientation.

    Parameters
    ----------
    axle : float
        Place of the driven axle along x in the robot's frame [m]; a robot that pitches turns about it.

    Attributes
    ----------
    rotation : (3, 3) float64
        Of the robot.
    """

    def __init__(self, axle: float = 0.0) -> None:
        self._axle = axle
        self.rotation = np.eye(3)
        self._at_axle = np.array((axle, 0.0, 0.0))
        self._before: Optional[Tuple[float, float, float]] = None
        self._ahead = self.rotation[:, 0]       # when the wheels were read last

    @property
    def position(self) -> Values:
        """Place (3,) of the robot's frame in that in which it began [m]."""
        return self._at_axle - self._axle * self.rotation[:, 0]

    @property
    def axle(self) -> Values:
        """Place (3,) of the driven axle [m]."""
        return self._at_axle

    def shift(self, offset: Values) -> None:
        """Correct the position by (3,) what a map says [m]."""
        self._at_axle = self._at_axle + offset

    def orient(self, quaternion: Sequence[float]) -> None:
        """Take the orientation of the robot from an IMU."""
        self.rotation = rotation_of(quaternion)

    def travel(self, x: float, y: float, yaw: float) -> float:
        """Take a planar odometry pose; return the distance since the last one, backwards below 0 [m].

        Parameters
        ----------
        x, y : float
            Of the wheels' odometry [m].
        yaw : float
            Its heading [rad].

        Returns
        -------
        float

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        if not all(map(math.isfinite, (x, y, yaw))):
            raise ValueError("odometry ({}, {}, {}); expected finite numbers".format(x, y, yaw))
        if self._before is None:
            self._before, self._ahead = (x, y, yaw), self.rotation[:, 0]
            return 0.0
        middle = 0.5 * (yaw + self._before[2]) if abs(yaw - self._before[2]) < math.pi else yaw
        distance = (x - self._before[0]) * math.cos(middle) + (y - self._before[1]) * math.sin(middle)
        self._before = (x, y, yaw)
        self._at_axle = self._at_axle + 0.5 * distance * (self._ahead + self.rotation[:, 0])
        self._ahead = self.rotation[:, 0]
        return distance
