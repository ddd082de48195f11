# SPDX-License-Identifier: BSD-3-Clause
"""The points of a scan in the odometry frame, without the robot's own parts."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from motion_plan.surroundings import own_points

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody
    from m2wr_navigation.methods.method import Sensing
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray

NEAREST = 0.1               # m: stands for a reading that is too close


@dataclass(frozen=True)
class ScanPoints:
    """The ends of a scan's beams.

    Attributes
    ----------
    stamp : float
        ROS time [s].
    laser : (3,) float64
        Pose of the laser [m, m, rad].
    ends : (N, 2) float64
        Of the beams, or the points up to which they are free [m].
    hits : (N,) bool
        Whether a beam ends at an obstacle.
    beams : (N,) int64
        Their numbers.
    ranges : (B,) float64
        Of all beams, free beyond the reach [m]; NaN: unknown, or the robot itself.
    angle_min, increment : float
        In the frame of the laser [rad].
    """

    stamp: float
    laser: FloatArray
    ends: FloatArray
    hits: BoolArray
    beams: IndexArray
    ranges: FloatArray
    angle_min: float
    increment: float


def scan_points(sensing: Sensing, body: RobotBody, reach: float) -> ScanPoints:
    """Return the points of a scan.

    Parameters
    ----------
    sensing : Sensing
    body : RobotBody
    reach : float
        Readings beyond this are no hits; beams are followed up to it [m].
    """
    ahead, left, turn = body.laser
    readings = np.asarray(sensing.ranges, float)
    beams = np.flatnonzero(~np.isnan(readings))
    angles = sensing.angle_min + turn + sensing.angle_increment * beams
    known = np.maximum(readings[beams], NEAREST)
    hits, known = known < reach, np.minimum(known, reach)
    x, y = ahead + known * np.cos(angles), left + known * np.sin(angles)
    foreign = ~own_points(x, np.abs(y), body.own_parts)
    cosine, sine = math.cos(sensing.pose[2]), math.sin(sensing.pose[2])
    ends = np.column_stack([sensing.pose[0] + cosine * x - sine * y, sensing.pose[1] + sine * x + cosine * y])
    laser = np.array([sensing.pose[0] + cosine * ahead - sine * left, sensing.pose[1] + sine * ahead + cosine * left,
                      sensing.pose[2] + turn])
    ranges = np.full(len(readings), np.nan)
    ranges[beams[foreign]] = known[foreign]
    return ScanPoints(sensing.stamp, laser, ends[foreign], hits[foreign], beams[foreign], ranges,
                      float(sensing.angle_min), float(sensing.angle_increment))
