# SPDX-License-Identifier: BSD-3-Clause
"""A scan's beams in the frame of the robot's base."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

from m2wr_maps.transforms import rotation

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray

LEVEL = 1e-9                # rounding of the horizontal part of a unit vector
FARTHEST = 1000.0           # limit for drivers that send a huge or infinite range_max [m]


class ScanError(ValueError):
    """A scan cannot be used; the message says what was found and expected."""


@dataclass(frozen=True)
class ScanGeometry:
    """What the fields of a LaserScan beside the ranges say.

    Attributes
    ----------
    angle_min, angle_increment : float
        [rad]
    range_min, range_max : float
        [m]
    """

    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float


@dataclass(frozen=True)
class Beams:
    """The beams of one scan.

    Attributes
    ----------
    ends : (2, B) float64
        End points in the base frame [m]; of beams without return, at the greatest range.
    polar : (2, B) float64
        Direction in the base frame [rad] and horizontal length [m].
    hit : (B,) bool
        Whether the beam has hit something within the limits.
    mount : (2,) float64
        The laser in the base frame [m].
    reach : float
        Greatest range [m].
    """

    ends: FloatArray
    polar: FloatArray
    hit: BoolArray
    mount: FloatArray
    reach: float

    @classmethod
    def from_scan(cls, ranges: Sequence[float], geometry: ScanGeometry,
                  mount: Tuple[Sequence[float], Sequence[float]], least: float = -1.0,
                  most: float = -1.0) -> Beams:
        """Return the beams of a LaserScan.

        Parameters
        ----------
        ranges : (N,) float
            [m]; NaN and ranges of ``most`` and more are beams without return, NaN is left out at all.
        geometry : ScanGeometry
        mount : ((3,), (4,)) float
            Translation [m] and quaternion x, y, z, w of the laser in the base frame; the laser may be upside down.
        least, most : float
            ``laser_min_range`` and ``laser_max_range`` [m]; not positive: the scan's own.

        Raises
        ------
        ScanError
            If there are no beams, or the limits leave no range.
        """
        if len(ranges) < 1:
            raise ScanError("it has no ranges; expected at least one")
        if not (math.isfinite(geometry.angle_min) and math.isfinite(geometry.angle_increment)):
            raise ScanError("angle_min {}, angle_increment {}: expected finite numbers".format(
                geometry.angle_min, geometry.angle_increment))
        low = max(least, geometry.range_min) if least > 0.0 else geometry.range_min
        high = min(most, geometry.range_max) if most > 0.0 else geometry.range_max
        high = min(high, FARTHEST)
        if not high > max(0.0, low):
            raise ScanError("ranges from {} to {} m are used; expected limits that leave some range".format(low, high))
        length = np.asarray(ranges, float)
        known = ~np.isnan(length)
        length, place = length[known], np.flatnonzero(known)
        hit = (length > low) & (length < high)
        length = np.where(hit, length, high)
        angle = geometry.angle_min + place * geometry.angle_increment
        turn, shift = _checked_rotation(mount[1]), np.asarray(mount[0][:2], float)
        across = turn[:2, 0:1] * np.cos(angle) + turn[:2, 1:2] * np.sin(angle)      # of unit vectors along the beams
        flat = np.hypot(*across)
        flat[np.abs(flat - 1.0) < LEVEL] = 1.0      # a beam without return is exactly as long as the greatest range
        return cls(shift[:, None] + across * length, np.stack([np.arctan2(across[1], across[0]), flat * length]), hit,
                   shift, high)

    def spread(self, most: int, only_hits: bool = True) -> IndexArray:
        """Return indices (at most ``most``,) of beams, evenly over the scan.

        Parameters
        ----------
        most : int
        only_hits : bool
            Whether to leave out beams without return.
        """
        usable = np.flatnonzero(self.hit) if only_hits else np.arange(len(self.hit))
        if len(usable) <= most:
            return usable
        return usable[np.linspace(0, len(usable) - 1, most).astype(np.int64)]


def _checked_rotation(quaternion: Sequence[float]) -> FloatArray:
    """Return the rotation matrix (3, 3) of a quaternion x, y, z, w; raises ScanError if its length is 0."""
    length = float(np.linalg.norm(quaternion))
    if not (math.isfinite(length) and length > 0.0):
        raise ScanError("the laser's orientation is {}; expected a quaternion".format(tuple(quaternion)))
    return rotation(quaternion)
