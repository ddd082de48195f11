# SPDX-License-Identifier: BSD-3-Clause
"""The report's five laser sectors: the least range in each, for any number of beams.

For the report's own scan (720 beams from -90 to +90 degrees) a sector is the printed slice, whose excluded ends
leave a few beams out. For any other scan a sector is the range of *angles* that slice covers on the report's scan.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple

import numpy as np

from motion_plan.angles import wrap_angle
from motion_plan.planar_types import Regions

if TYPE_CHECKING:
    from motion_plan.planar_types import IndexArray, Readings

#: Sector names in the order of the beams, which run counter-clockwise.
SECTOR_NAMES = ('right', 'fright', 'front', 'fleft', 'left')
#: Slices printed in reading_laser.py and in bug2.py; they differ in the end of the last one.
READING_LASER_BOUNDS = ((0, 143), (144, 287), (288, 431), (432, 575), (576, 713))
BUG2_BOUNDS = ((0, 143), (144, 287), (288, 431), (432, 575), (576, 719))
REPORT_BEAMS = 720
REPORT_ANGLE_MIN = -1.570796
REPORT_ANGLE_MAX = 1.570796
REPORT_INCREMENT = (REPORT_ANGLE_MAX - REPORT_ANGLE_MIN) / (REPORT_BEAMS - 1)
#: No sector reports more than this [m]; it also stands for "nothing in range".
MAX_REGION = 10.0
#: A quarter of the report's beam spacing: it includes beams on a sector's edge despite 32-bit angles.
_EDGE_TOLERANCE = 1e-3


class ScanError(ValueError):
    """A scan without usable sectors; the text gives the value found and the value expected."""


def check_scan(count: int, angle_min: float, angle_max: float, angle_increment: float) -> None:
    """Check that the number of readings fits the angles of a scan, to one beam, as drivers differ.

    Parameters
    ----------
    count : int
        Number of readings.
    angle_min, angle_max, angle_increment : float
        Of the scan [rad].

    Raises
    ------
    ScanError
        If it does not fit, or an angle is not finite.
    """
    if count == 0:
        raise ScanError('laser scan: 0 readings, expected at least 2')
    if count == 1:
        raise ScanError('laser scan: 1 reading, expected at least 2')
    if not all(math.isfinite(value) for value in (angle_min, angle_max, angle_increment)) or angle_increment == 0.0:
        raise ScanError('laser scan: angle_min %s, angle_max %s, angle_increment %s, expected finite numbers and an '
                        'increment that is not 0' % (angle_min, angle_max, angle_increment))
    expected = (angle_max - angle_min) / angle_increment + 1.0
    if abs(count - expected) > 1.5:
        raise ScanError('laser scan: %d readings, expected %d for %.4f to %.4f rad in steps of %.5f rad'
                        % (count, round(expected), angle_min, angle_max, angle_increment))


def sector_beams(count: int, angle_min: float, angle_increment: float,
                 bounds: Sequence[Tuple[int, int]]) -> List[IndexArray]:
    """Return one index array for each sector: the beams of a scan that belong to it.

    Parameters
    ----------
    count : int
        Number of beams.
    angle_min, angle_increment : float
        Of the scan [rad].
    bounds : sequence of (int, int)
        The slices of the report's 720 beams, end excluded.

    Returns
    -------
    list of (n,) int64
        May be empty for a sector that the scan does not cover.
    """
    if count == REPORT_BEAMS and abs(angle_min - REPORT_ANGLE_MIN) < _EDGE_TOLERANCE \
            and abs(angle_increment - REPORT_INCREMENT) * count < 2 * _EDGE_TOLERANCE:
        return [np.arange(first, end) for first, end in bounds]
    angles = wrap_angle(angle_min + angle_increment * np.arange(count))
    beams = []
    for first, end in bounds:
        low = REPORT_ANGLE_MIN + first * REPORT_INCREMENT - _EDGE_TOLERANCE
        high = REPORT_ANGLE_MIN + (end - 1) * REPORT_INCREMENT + _EDGE_TOLERANCE
        beams.append(np.flatnonzero((angles >= low) & (angles <= high)))
    return beams


class RegionReader:
    """Computes the sector minima of scans; stores the beam lists of the last scan layout.

    Parameters
    ----------
    bounds : sequence of (int, int)
        One of READING_LASER_BOUNDS and BUG2_BOUNDS.
    """

    def __init__(self, bounds: Sequence[Tuple[int, int]] = BUG2_BOUNDS) -> None:
        self._bounds = bounds
        self._layout: Optional[Tuple[int, float, float, float]] = None
        self._beams: List[IndexArray] = []
        self._notices: List[str] = []

    def read(self, ranges: Readings, angle_min: float, angle_max: float, angle_increment: float) -> Regions:
        """Return the least range of every sector.

        Parameters
        ----------
        ranges : sequence of float
            Readings [m]. +inf means nothing in range, -inf (or a negative number) means too close (REP 117),
            NaN means no measurement.
        angle_min, angle_max, angle_increment : float
            Of the scan [rad].

        Returns
        -------
        dict of str to float
            Keys SECTOR_NAMES; values in [0, 10] m: 0 for "too close", 10 for "nothing within 10 m" and for a sector
            that the scan does not cover (see `take_notices`).

        Raises
        ------
        ScanError
            For no reading, one reading, a number of readings that does not fit the angles, or a sector whose
            readings are all NaN.
        """
        readings = np.asarray(ranges, dtype=np.float64)
        layout = (len(readings), angle_min, angle_max, angle_increment)
        if layout != self._layout:
            check_scan(*layout)
            self._beams = sector_beams(len(readings), angle_min, angle_increment, self._bounds)
            self._layout = layout
            self._note_uncovered(angle_min, angle_max)
        if np.isnan(readings).all():
            raise ScanError('laser scan: all %d readings are NaN, expected ranges in metres' % len(readings))
        regions = {}
        for name, beams in zip(SECTOR_NAMES, self._beams):
            if len(beams) == 0:
                regions[name] = MAX_REGION
                continue
            least = np.fmin.reduce(readings[beams])
            if math.isnan(least):
                raise ScanError('laser scan: all %d readings of sector %s are NaN' % (len(beams), name))
            regions[name] = float(min(max(least, 0.0), MAX_REGION))
        return regions

    def take_notices(self) -> List[str]:
        """Return sentences about sectors the newest scan layout does not cover, each once."""
        notices, self._notices = self._notices, []
        return notices

    def _note_uncovered(self, angle_min: float, angle_max: float) -> None:
        missing = [name for name, beams in zip(SECTOR_NAMES, self._beams) if len(beams) == 0]
        if missing:
            self._notices.append(
                'laser scan: no beam in sector %s; the scan covers %.1f to %.1f degrees, the sectors -90 to 90; such a '
                'sector is regarded as free' % (', '.join(missing), math.degrees(angle_min), math.degrees(angle_max)))
