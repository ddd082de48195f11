# SPDX-License-Identifier: BSD-3-Clause
"""The laser and its scans: beam angles, mount, usable ranges, end points.

The filter's robot is the *centred laser*: the laser's frame turned about its axis so that the beams lie symmetrically
and grow counter-clockwise seen from above. The mount brings its poses back to the base.
"""
import functools
import math
from array import array
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.scan_kernels import classify_ranges, with_normals

FARTHEST = 1000.0           # no laser sees farther; drivers without a limit of their own send huge or infinite ones [m]
TILT_TOLERANCE = 1e-3       # of the cosine between the laser's axis and the vertical
NORMAL_REACH, NORMAL_SIDE = 0.3, 4
SLIDE_STRAIGHT = 0.02       # weight of sliding along a straight wall against moving across it


class ScanError(ValueError):
    """A scan, or the way its laser is mounted, cannot be used; says what was found and what was expected."""


def rotation(quaternion):
    """Return the (3, 3) matrix of a quaternion x, y, z, w of any length but zero."""
    x, y, z, w = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def _parts(quaternion):
    """Return x, y, z, w of a quaternion of any length, and 2 by its square: no number where all four are 0."""
    x, y, z, w = (float(value) for value in quaternion)
    squared = x * x + y * y + z * z + w * w
    return x, y, z, w, 2.0 / squared if squared else math.nan


def transform_parts(transform):
    """Translation and quaternion x, y, z, w of a TransformStamped."""
    t, r = transform.transform.translation, transform.transform.rotation
    return (t.x, t.y, t.z), (r.x, r.y, r.z, r.w)


@dataclass(frozen=True)
class LaserModel:
    """How one laser measures and where it sits.

    Attributes
    ----------
    angles : (B,) float64
        Beam angles in the centred frame [rad], growing.
    reverse : bool
        Whether the ranges of a message come in the opposite order.
    centre : float
        Angle of the scan's middle in the laser's own frame [rad].
    base_from_sensor : (3,) float64
        Pose of the centred laser in the base frame.
    range_min, range_max, max_range, max_urange : float
        Limits of the message, of what counts at all, and of what is used as a hit [m].
    """

    angles: np.ndarray
    reverse: bool
    centre: float
    base_from_sensor: np.ndarray
    range_min: float
    range_max: float
    max_range: float
    max_urange: float

    @classmethod
    def from_message(cls, angle_min, angle_max, angle_increment, count, range_min, range_max, base_from_laser=None,
                     max_range=None, max_urange=None):
        """Build the model from the fields of a LaserScan.

        Parameters
        ----------
        count : int
            Number of ranges.
        base_from_laser : tuple of ((3,), (4,)), optional
            Translation and quaternion x, y, z, w of the laser in the base frame; identity if left out.
        max_range, max_urange : float, optional
            Parameters ``maxRange`` (default: ``range_max`` - 0.01) and ``maxUrange`` (default: ``maxRange``).

        Raises
        ------
        ScanError
            If the scan has no beams, an angle is not finite, all beams point one way, no range is left between the
            limits, or the laser is mounted neither upright nor upside down.
        """
        if count < 1:
            raise ScanError("the scan has no ranges; expected at least one beam")
        if not all(math.isfinite(v) for v in (angle_min, angle_max, angle_increment)):
            raise ScanError("angle_min {}, angle_max {}, angle_increment {}: expected finite numbers".format(
                angle_min, angle_max, angle_increment))
        if count > 1 and not angle_increment:
            raise ScanError("{} beams with angle_increment 0: expected one that is not".format(count))
        max_range = min(range_max - 0.01 if max_range is None else max_range, FARTHEST)
        if not max_range > max(0.0, range_min):       # a range_min that is no number is no limit
            raise ScanError("range_min {}, range_max {}, beams used up to {} m: expected limits that leave some range; "
                            "the parameter maxRange stands in for range_max".format(range_min, range_max, max_range))
        translation, quaternion = base_from_laser or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        up = rotation(quaternion)[2, 2]
        if abs(abs(up) - 1.0) > TILT_TOLERANCE:
            raise ScanError("the laser is tilted: its axis points {:.1f} degrees off the vertical; expected it upright "
                            "or upside down".format(math.degrees(math.acos(min(1.0, abs(up))))))
        increment = abs(angle_increment)
        # The middle of the beams that are there. Drivers disagree on whether angle_max is the last beam or one step on.
        span = increment * (count - 1)
        falling = angle_max < angle_min or (angle_max == angle_min and angle_increment < 0.0)
        centre = angle_min + 0.5 * (-span if falling else span)
        angles = -0.5 * span + increment * np.arange(count)
        upside_down = up < 0.0
        model = cls(angles, falling != upside_down, centre, np.zeros(3), range_min, range_max, max_range,
                    max_range if max_urange is None else min(max_urange, FARTHEST))
        object.__setattr__(model, "base_from_sensor", model.sensor_pose(translation, quaternion))
        return model

    @functools.cached_property
    def directions(self):
        """Cosines and sines (2, B) of the beam angles."""
        return np.stack([np.cos(self.angles), np.sin(self.angles)])

    @functools.cached_property
    def limits(self):
        """The four limits (4,) as ``scan_kernels.take_in`` wants them."""
        return np.array([self.range_min, self.range_max, self.max_range, self.max_urange], float)

    @property
    def ahead(self):
        """Forward direction (2,) of the base in the centred laser's frame."""
        yaw = self.base_from_sensor[2]
        return np.array([math.cos(yaw), -math.sin(yaw)])

    @functools.cached_property
    def _middle(self):
        """Cosine and sine of the scan's middle in the laser's own frame."""
        return math.cos(self.centre), math.sin(self.centre)

    def sensor_pose(self, translation, quaternion):
        """Return the planar pose (3,) of the centred laser from a transform of the laser, both in the parent frame."""
        x, y, z, w, by = _parts(quaternion)
        c, s = self._middle
        ahead = (1.0 - by * (y * y + z * z)) * c + by * (x * y - w * z) * s
        aside = by * (x * y + w * z) * c + (1.0 - by * (x * x + z * z)) * s
        return np.array([translation[0], translation[1], math.atan2(aside, ahead)], float)

    def slope(self, quaternion):
        """Return the rise a metre along x and y of the centred laser, from the quaternion of its transform."""
        x, y, z, w, by = _parts(quaternion)
        c, s = self._middle
        ahead, aside = by * (x * z - y * w), by * (y * z + x * w)
        side = 1.0 if by * (x * x + y * y) <= 1.0 else -1.0         # upside down the centred laser is turned over
        return ahead * c + aside * s, side * (aside * c - ahead * s)

    def reading(self, ranges, skip=0, gap=0.0):
        """Return the ScanReading of one message's ranges (B,).

        ``skip`` beams (``lskip``) are left out of the matching between two used ones. End points nearer than ``gap``
        [m] to one before count, there and in the particles' maps, as one with it: their mean.

        Raises
        ------
        ScanError
            If the number of ranges is not the one the model was made for.
        """
        if isinstance(ranges, tuple) and ranges:        # as messages have them; this is the quickest way to read one
            ranges = array("d", ranges)
        ranges = np.array(ranges, float)
        if ranges.shape != self.angles.shape:
            raise ScanError("the scan has {} ranges; expected {} as in the first one".format(
                ranges.size, self.angles.size))
        if self.reverse:
            ranges = np.ascontiguousarray(ranges[::-1])
        return ScanReading(self, ranges, skip, gap)


class ScanReading:
    """End points of one scan in the centred laser's frame.

    Attributes
    ----------
    points : (2, H) float64
        End points that are registered [m].
    beams : (7, M) float64
        End points that are matched, with their normals: the layout of ``match_kernels``.
    rays : (2, S) float32
        Ends of all beams that clear space, cut at ``maxUrange``.
    ray_hits : (S,) bool
        Which of them also mark their end.
    """

    def __init__(self, laser, ranges, skip, gap):
        beams = ranges.size
        points, used = np.empty((2, beams)), np.empty(beams, bool)
        rays, ray_hits = np.empty((2, beams), np.float32), np.empty(beams, bool)
        count, seen = classify_ranges(ranges, laser.directions, laser.limits, skip, gap, points, used, rays, ray_hits)
        # copies: a reading is kept, and what it does not need is not
        self.points, self.rays, self.ray_hits = points[:, :count].copy(), rays[:, :seen].copy(), ray_hits[:seen].copy()
        # of the thinned points: neighbouring beams on a near wall lie closer together than they are exact
        beams = np.empty((mk.BEAM_ROWS, count))
        with_normals(self.points, NORMAL_REACH, NORMAL_SIDE, min(laser.limits[2:]), SLIDE_STRAIGHT, beams)
        self.beams = np.ascontiguousarray(beams[:, used[:count]]) if skip else beams

    def level_part(self, slope, lift):
        """Return the reading without what lies more than ``lift`` [m] above or below where it would be level.

        Such an end point shows a wall at another height, or the floor. Its beam clears space as far as it is level.

        Parameters
        ----------
        slope : (2,) float
            Rise a metre along x and y of the centred laser.
        """
        part = object.__new__(ScanReading)
        kept, held = (np.abs(slope[0] * x + slope[1] * y) <= lift for x, y in (self.points, self.beams[:2]))
        part.points, part.beams = np.ascontiguousarray(self.points[:, kept]), np.ascontiguousarray(self.beams[:, held])
        lifted = np.abs(slope[0] * self.rays[0] + slope[1] * self.rays[1])
        part.rays = self.rays * np.minimum(1.0, lift / np.maximum(lifted, lift)).astype(np.float32)
        part.ray_hits = self.ray_hits & (lifted <= lift)
        return part
