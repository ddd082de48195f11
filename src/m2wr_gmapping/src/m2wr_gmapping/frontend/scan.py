# SPDX-License-Identifier: BSD-3-Clause
"""Lasers and their scans: beam angles, mount, valid ranges, end points.

The frame of the filter is the *centred laser*: the laser's frame rotated about its axis so that the beams are
symmetrical and ordered counter-clockwise seen from above. The mount transforms its poses to the base.
"""
from __future__ import annotations

import functools
import math
from array import array
from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.scan_kernels import classify_ranges, with_normals
from m2wr_maps.transforms import rotation

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray, Vector

FARTHEST = 1000.0           # limit for drivers that send a huge or infinite range_max [m]
TILT_TOLERANCE = 1e-3       # of the cosine between the laser's axis and the vertical


class ScanError(ValueError):
    """A scan or the mount of its laser cannot be used; the message says what was found and expected."""


def _parts(quaternion: Vector) -> Tuple[float, float, float, float, float]:
    """Return x, y, z, w of a quaternion, and 2 / squared length; NaN if the length is 0."""
    x, y, z, w = (float(value) for value in quaternion)
    squared = x * x + y * y + z * z + w * w
    return x, y, z, w, 2.0 / squared if squared else math.nan


@dataclass(frozen=True)
class LaserModel:
    """Geometry and limits of a laser.

    Attributes
    ----------
    angles : (B,) float64
        Beam angles in the centred frame [rad], growing.
    reverse : bool
        Whether the ranges of a message are in the opposite order.
    centre : float
        Angle of the scan's middle in the laser's own frame [rad].
    base_from_sensor : (3,) float64
        Pose of the centred laser in the base frame.
    range_min, range_max, max_range, max_urange : float
        Limits of the message, greatest valid range, and greatest range of a hit [m].
    """

    angles: FloatArray
    reverse: bool
    centre: float
    base_from_sensor: FloatArray
    range_min: float
    range_max: float
    max_range: float
    max_urange: float

    @classmethod
    def from_message(cls, angle_min: float, angle_max: float, angle_increment: float, count: int, range_min: float,
                     range_max: float, base_from_laser: Optional[Tuple[Vector, Vector]] = None,
                     max_range: Optional[float] = None, max_urange: Optional[float] = None) -> LaserModel:
        """Create the model from the fields of a LaserScan.

        Parameters
        ----------
        angle_min : float
            As in the message [rad].
        angle_max : float
            As in the message [rad].
        angle_increment : float
            As in the message [rad].
        count : int
            Number of ranges.
        range_min : float
            As in the message [m].
        range_max : float
            As in the message [m].
        base_from_laser : ((3,), (4,)) float or None
            Translation [m] and quaternion x, y, z, w of the laser in the base frame; None: identity.
        max_range : float or None
            Parameter ``maxRange`` [m]; default ``range_max`` - 0.01.
        max_urange : float or None
            Parameter ``maxUrange`` [m]; default ``maxRange``.

        Returns
        -------
        LaserModel

        Raises
        ------
        ScanError
            If there are no beams, an angle is not finite, the increment is 0, the limits leave no range, or the laser
            is mounted neither upright nor upside down.
        """
        if count < 1:
            raise ScanError("the scan has no ranges; expected at least one beam")
        if not all(math.isfinite(v) for v in (angle_min, angle_max, angle_increment)):
            raise ScanError("angle_min {}, angle_max {}, angle_increment {}: expected finite numbers".format(
                angle_min, angle_max, angle_increment))
        if count > 1 and not angle_increment:
            raise ScanError("{} beams with angle_increment 0: expected one that is not".format(count))
        max_range = min(range_max - 0.01 if max_range is None else max_range, FARTHEST)
        if not max_range > max(0.0, range_min):       # a range_min of NaN is no limit
            raise ScanError("range_min {}, range_max {}, beams used up to {} m: expected limits that leave some range; "
                            "the parameter maxRange replaces range_max".format(range_min, range_max, max_range))
        translation, quaternion = base_from_laser or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        up = rotation(quaternion)[2, 2]
        if abs(abs(up) - 1.0) > TILT_TOLERANCE:
            raise ScanError("the laser is tilted: its axis points {:.1f} degrees off the vertical; expected it upright "
                            "or upside down".format(math.degrees(math.acos(min(1.0, abs(up))))))
        increment = abs(angle_increment)
        # Centre of the actual beams. Drivers disagree on whether angle_max is the last beam or one step beyond.
        span = increment * (count - 1)
        falling = angle_max < angle_min or (angle_max == angle_min and angle_increment < 0.0)
        centre = angle_min + 0.5 * (-span if falling else span)
        angles = -0.5 * span + increment * np.arange(count)
        upside_down = up < 0.0
        model = cls(angles, falling != upside_down, centre, np.zeros(3), range_min, range_max, max_range,
                    max_range if max_urange is None else min(max_urange, FARTHEST))
        object.__setattr__(model, "base_from_sensor", model.sensor_pose(translation, quaternion))
        return model

    @property
    def view(self) -> float:
        """Angle between the first and the last beam [rad]."""
        return float(self.angles[-1] - self.angles[0])

    @functools.cached_property
    def directions(self) -> FloatArray:
        """Cosines and sines (2, B) of the beam angles."""
        return np.stack([np.cos(self.angles), np.sin(self.angles)])

    @functools.cached_property
    def limits(self) -> FloatArray:
        """The four limits (4,) as of ``scan_kernels.classify_ranges``."""
        return np.array([self.range_min, self.range_max, self.max_range, self.max_urange], float)

    @property
    def ahead(self) -> FloatArray:
        """Forward direction (2,) of the base in the centred laser's frame."""
        yaw = self.base_from_sensor[2]
        return np.array([math.cos(yaw), -math.sin(yaw)])

    @functools.cached_property
    def _middle(self) -> Tuple[float, float]:
        """Cosine and sine of the scan's centre in the laser's own frame."""
        return math.cos(self.centre), math.sin(self.centre)

    def sensor_pose(self, translation: Vector, quaternion: Vector) -> FloatArray:
        """Return the planar pose of the centred laser from a transform of the laser.

        Parameters
        ----------
        translation : (3,) float
            Position of the laser in the parent frame [m].
        quaternion : (4,) float
            Its orientation x, y, z, w.

        Returns
        -------
        (3,) float64
            Pose in the parent frame [m, m, rad].
        """
        x, y, z, w, by = _parts(quaternion)
        c, s = self._middle
        ahead = (1.0 - by * (y * y + z * z)) * c + by * (x * y - w * z) * s
        aside = by * (x * y + w * z) * c + (1.0 - by * (x * x + z * z)) * s
        return np.array([translation[0], translation[1], math.atan2(aside, ahead)], float)

    def slope(self, quaternion: Vector) -> Tuple[float, float]:
        """Return the rise along x and y of the centred laser [m/m], from the quaternion of its transform."""
        x, y, z, w, by = _parts(quaternion)
        c, s = self._middle
        ahead, aside = by * (x * z - y * w), by * (y * z + x * w)
        side = 1.0 if by * (x * x + y * y) <= 1.0 else -1.0         # upside down: the y axis is mirrored
        return ahead * c + aside * s, side * (aside * c - ahead * s)

    def reading(self, ranges: ArrayLike, skip: int = 0, gap: float = 0.0) -> ScanReading:
        """Create the reading of one scan.

        Parameters
        ----------
        ranges : (B,) float
            Ranges of the message [m].
        skip : int
            Beams that are left out of the matching between two used ones (``lskip``).
        gap : float
            End points closer than this to the one before are merged into their mean [m].

        Returns
        -------
        ScanReading

        Raises
        ------
        ScanError
            If the number of ranges is not that of the model.
        """
        if isinstance(ranges, tuple) and ranges:        # as in messages; the fastest conversion
            ranges = array("d", ranges)
        metres = np.array(ranges, float)
        if metres.shape != self.angles.shape:
            raise ScanError("the scan has {} ranges; expected {} as in the first one".format(
                metres.size, self.angles.size))
        if self.reverse:
            metres = np.ascontiguousarray(metres[::-1])
        return ScanReading(self, metres, skip, gap)


class ScanReading:
    """End points of one scan in the centred laser's frame.

    Attributes
    ----------
    points : (2, H) float64
        End points that are registered in the maps [m].
    rays : (2, S) float32
        Ends of all beams that clear space, limited to ``maxUrange`` [m].
    ray_hits : (S,) bool
        Whether each of them marks its end as occupied.
    """

    points: FloatArray
    rays: Float32Array
    ray_hits: BoolArray
    _beams: Optional[FloatArray]        # None: computed from the points
    _limit: float = 0.0                 # for that, see ``surface_normals`` [m]; 0: they follow from other points, too

    def __init__(self, laser: LaserModel, ranges: FloatArray, skip: int, gap: float) -> None:
        size = ranges.size
        points, used = np.empty((2, size)), np.empty(size, bool)
        rays, ray_hits = np.empty((2, size), np.float32), np.empty(size, bool)
        count, seen = classify_ranges(ranges, laser.directions, laser.limits, skip, gap, points, used, rays, ray_hits)
        # copies, because readings are stored for the whole run
        self.points, self.rays, self.ray_hits = points[:, :count].copy(), rays[:, :seen].copy(), ray_hits[:seen].copy()
        # of the merged points: neighbouring beams on a close wall are closer together than their noise
        limit = min(laser.max_range, laser.max_urange)
        self._beams = _beams_of(self.points, limit)
        if skip:
            self._beams = np.ascontiguousarray(self._beams[:, used[:count]])
        else:
            self._limit = limit

    @classmethod
    def of_parts(cls, points: FloatArray, beams: FloatArray, rays: Float32Array, ray_hits: BoolArray) -> ScanReading:
        """Return a reading with these attributes.

        Parameters
        ----------
        points, beams, rays, ray_hits
            As of the class; ``beams`` is (7, M) float64.
        """
        reading = object.__new__(cls)
        reading.points, reading._beams, reading.rays, reading.ray_hits = points, beams, rays, ray_hits
        return reading

    @classmethod
    def of_walls(cls, points: FloatArray) -> ScanReading:
        """Return a saved map as a reading: its walls are end points, seen from the map's origin.

        It has no beams to match, and no rays that clear space.

        Parameters
        ----------
        points : (2, M) float64
            Centres of the occupied cells in ``map`` [m].
        """
        return cls.of_parts(points, np.empty((mk.BEAM_ROWS, 0)), np.empty((2, 0), np.float32), np.zeros(0, bool))

    @property
    def beams(self) -> FloatArray:
        """End points that are matched, with their normals, (7, M) float64: the layout of ``match_kernels``."""
        return _beams_of(self.points, self._limit) if self._beams is None else self._beams

    def compact(self) -> None:
        """Save memory: compute the beams from the points when they are asked for. They need most of a reading."""
        if self._limit:
            self._beams = None

    def level_part(self, slope: Vector, lift: float) -> ScanReading:
        """Return the reading without end points that are more than ``lift`` above or below the plane of a level laser.

        Such an end point shows a wall at another height, or the floor. Its beam clears space only where it is level.

        Parameters
        ----------
        slope : (2,) float
            Rise along x and y of the centred laser [m/m].
        lift : float
            Greatest vertical displacement [m].

        Returns
        -------
        ScanReading
        """
        kept, held = (np.abs(slope[0] * x + slope[1] * y) <= lift for x, y in (self.points, self.beams[:2]))
        lifted = np.abs(slope[0] * self.rays[0] + slope[1] * self.rays[1])
        rays = self.rays * np.minimum(1.0, lift / np.maximum(lifted, lift)).astype(np.float32)
        return ScanReading.of_parts(np.ascontiguousarray(self.points[:, kept]),
                                    np.ascontiguousarray(self.beams[:, held]), rays, self.ray_hits & (lifted <= lift))


def _beams_of(points: FloatArray, limit: float) -> FloatArray:
    """Return the beams (7, M) of all end points (2, M) of a laser of ``limit`` metres."""
    beams = np.empty((mk.BEAM_ROWS, points.shape[1]))
    with_normals(points, tuning.SCANS.normal_reach, tuning.SCANS.normal_side, limit, tuning.SCANS.slide, beams)
    return beams
