# SPDX-License-Identifier: BSD-3-Clause
"""Obstacle points seen by the laser around the robot, also beside and behind it, in the odometry frame.

The laser covers 90 degrees to each side, and the robot rotates about an axle 0.2 m behind it: a corner leaves the
field of view while the robot can still collide with it. So points are kept until the robot is far away or a beam
passes through them. No planning here: only the store and its two queries.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional, Sequence, Tuple

import numpy as np

from motion_plan.angles import wrap_angle
from motion_plan.body import AXLE_X, FOOTPRINT_BOXES, LASER_X
from motion_plan.planar_types import Point, Pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_plan.planar_types import BoolArray, FloatArray, IndexArray, Readings

#: Points farther than this from the robot are forgotten [m].
FORGET_DISTANCE = 3.0
#: Readings beyond this are not stored [m].
KEEP_RANGE = 2.5
#: Grid on which stored points are thinned [m].
CELL = 0.04
#: A beam must pass a point by this distance to clear it [m]: range noise, and the age of the pose.
CLEAR_MARGIN = 0.10
#: A reading within this distance of a part of the robot is that part [m]: four standard deviations of the noise.
WHEEL_MARGIN = 0.04
#: Parts of m2wr that its laser sees: the wheels.
WHEELS = FOOTPRINT_BOXES[1:2]
#: Jump of the pose between two scans that only a teleport can make [m].
TELEPORT = 0.5
#: Directions that are checked in one batch.
_AT_ONCE = 24


def axle_of(pose: Pose) -> Point:
    """Return the (x, y) of the axle [m] for a pose (x, y, yaw) of link_chassis, both in the odometry frame."""
    return pose[0] + AXLE_X * math.cos(pose[2]), pose[1] + AXLE_X * math.sin(pose[2])


class Surroundings:
    """Obstacle points around the robot in the odometry frame.

    Attributes
    ----------
    points : (N, 2) float64
        x, y [m] in the odometry frame.

    Parameters
    ----------
    laser : (float, float), optional
        Position of the laser in the frame of the pose [m].
    own_parts : sequence of (float, float, float, float), optional
        Parts of the robot that its laser sees, in the same frame: least and greatest x, least and greatest y without
        its sign [m].
    keep_range : float, optional
        Readings beyond this are not stored [m].
    """

    def __init__(self, laser: Point = (LASER_X, 0.0), own_parts: Sequence[Sequence[float]] = WHEELS,
                 keep_range: float = KEEP_RANGE) -> None:
        self._laser, self._own_parts, self._keep_range = laser, own_parts, keep_range
        self._forget_distance = keep_range + (FORGET_DISTANCE - KEEP_RANGE)
        self.points = np.empty((0, 2))
        self._pose: Optional[Pose] = None
        self._layout: Optional[Tuple[int, float, float]] = None
        self._angles = self._cos = self._sin = np.empty(0)

    def clear(self) -> None:
        """Forget everything, as after a reset."""
        self.points = np.empty((0, 2))
        self._pose = None

    def update(self, ranges: Readings, angle_min: float, angle_increment: float, pose: Pose,
               range_min: float = 0.10) -> None:
        """Add one scan.

        Parameters
        ----------
        ranges : (B,) array_like
            Readings [m]; +inf, -inf and NaN as in REP 117.
        angle_min, angle_increment : float
            Of the scan [rad].
        pose : (float, float, float)
            x, y [m], yaw [rad] of link_chassis in the odometry frame when the scan was taken.
        range_min : float
            Range that stands for a "too close" reading [m].
        """
        readings = np.array(ranges, dtype=np.float64)
        np.putmask(readings, readings < range_min, range_min)
        self._prepare(len(readings), angle_min, angle_increment)
        if self._pose is not None and math.hypot(pose[0] - self._pose[0], pose[1] - self._pose[1]) > TELEPORT:
            self.points = np.empty((0, 2))
        self._pose = pose
        self.points = self._points_after(readings, angle_min, angle_increment, pose)

    def _points_after(self, readings: FloatArray, angle_min: float, angle_increment: float, pose: Pose) -> FloatArray:
        """Return the points after a scan, in the order of their cells, one in each."""
        (ahead, left), (laser_x, laser_y, cos_yaw, sin_yaw) = self._laser, self._laser_at(pose)
        kept = self._unseen(readings, angle_min, angle_increment, laser_x, laser_y, pose[2])
        near = (readings < self._keep_range).nonzero()[0]
        distance = readings[near]
        local_x, local_y = distance * self._cos[near], distance * self._sin[near]
        own = own_points(ahead + local_x, np.abs(left + local_y), self._own_parts)
        if own.any():
            foreign = ~own
            local_x, local_y = local_x[foreign], local_y[foreign]
        points = np.empty((len(local_x) + len(kept), 2))
        points[:len(local_x), 0] = laser_x + cos_yaw * local_x - sin_yaw * local_y
        points[:len(local_x), 1] = laser_y + sin_yaw * local_x + cos_yaw * local_y
        points[len(local_x):] = kept
        return points[_first_in_cells(np.floor(points / CELL).astype(np.int64))]

    def _laser_at(self, pose: Pose) -> Tuple[float, float, float, float]:
        """Return the position of the laser in the odometry frame [m], and cosine and sine of the robot's yaw."""
        cos_yaw, sin_yaw = math.cos(pose[2]), math.sin(pose[2])
        ahead, left = self._laser
        return (pose[0] + ahead * cos_yaw - left * sin_yaw, pose[1] + ahead * sin_yaw + left * cos_yaw,
                cos_yaw, sin_yaw)

    def nearest(self, x: float, y: float) -> Tuple[float, Optional[FloatArray]]:
        """Return the distance [m] and the coordinates (2,) of the nearest stored point; (inf, None) without points.

        Parameters
        ----------
        x, y : float
            Odometry frame [m].
        """
        if len(self.points) == 0:
            return math.inf, None
        distance = np.hypot(self.points[:, 0] - x, self.points[:, 1] - y)
        index = int(np.argmin(distance))
        return float(distance[index]), self.points[index]

    def free_travel(self, x: float, y: float, directions: ArrayLike, radius: float) -> Tuple[FloatArray, IndexArray]:
        """Return how far a disc can travel from x, y before a stored point is inside it.

        Parameters
        ----------
        x, y : float
            Centre of the disc [m] in the odometry frame.
        directions : (D,) array_like
            Directions of travel [rad] in the odometry frame.
        radius : float
            Of the disc [m].

        Returns
        -------
        travel : (D,) float64
            Free travel [m], inf without an obstacle. 0 where a point inside the disc would be approached;
            a point inside the disc behind the motion is ignored.
        blockers : (D,) int64
            Index in ``points`` of the point that ends the travel, -1 if there is none.
        """
        directions = np.array(directions, dtype=np.float64, ndmin=1)
        if len(self.points) == 0:
            return np.full(len(directions), math.inf), np.full(len(directions), -1)
        return _travel(self.points[:, 0] - x, self.points[:, 1] - y, np.cos(directions), np.sin(directions), radius)

    def first_free(self, x: float, y: float, directions: FloatArray, radius: float, distance: float) -> Tuple[int, int]:
        """Find the first of many directions with enough free travel; like free_travel, but faster.

        Parameters
        ----------
        x, y, directions, radius
            As for `free_travel`.
        distance : float
            Required free travel [m].

        Returns
        -------
        first : int
            Index in ``directions``, -1 if there is none.
        blocker : int
            Index in ``points`` of the point that ends the travel in the previous direction, -1 for the first direction.
        """
        delta_x, delta_y = self.points[:, 0] - x, self.points[:, 1] - y
        # points farther away cannot end a travel of this length; with a margin for rounding
        near = (delta_x * delta_x + delta_y * delta_y < (distance + radius) ** 2 + 1e-6).nonzero()[0]
        if len(near) == 0:
            return 0, -1
        delta_x, delta_y = delta_x[near], delta_y[near]
        cos_dir, sin_dir = np.cos(directions), np.sin(directions)
        blocker = -1
        for begin in range(0, len(directions), _AT_ONCE):
            part = slice(begin, begin + _AT_ONCE)
            travel, blockers = _travel(delta_x, delta_y, cos_dir[part], sin_dir[part], radius)
            free = travel >= distance
            first = int(np.argmax(free))
            if free[first]:
                return begin + first, blocker if first == 0 else int(near[blockers[first - 1]])
            blocker = int(near[blockers[-1]])
        return -1, blocker

    def _prepare(self, count: int, angle_min: float, angle_increment: float) -> None:
        if self._layout != (count, angle_min, angle_increment):
            self._angles = angle_min + angle_increment * np.arange(count)
            self._cos, self._sin = np.cos(self._angles), np.sin(self._angles)
            self._layout = (count, angle_min, angle_increment)

    def _unseen(self, readings: FloatArray, angle_min: float, angle_increment: float, laser_x: float, laser_y: float,
                yaw: float) -> FloatArray:
        """Stored points not covered by the new scan: outside its field of view, or hidden."""
        if len(self.points) == 0:
            return self.points
        delta_x, delta_y = self.points[:, 0] - laser_x, self.points[:, 1] - laser_y
        distance = np.hypot(delta_x, delta_y)
        bearing = wrap_angle(np.arctan2(delta_y, delta_x) - yaw)
        middle = 0.5 * (self._angles[0] + self._angles[-1])
        beam = np.rint((middle + wrap_angle(bearing - middle) - angle_min) / angle_increment).astype(np.int64)
        inside = (beam >= 0) & (beam < len(readings))
        last = len(readings) - 1
        beam = np.minimum(np.maximum(beam, 1), last - 1) if last > 1 else np.zeros_like(beam)
        before, after = (beam - 1, beam + 1) if last > 1 else (beam, np.minimum(beam + 1, last))
        # the least of three beams: a thin post must not be cleared by the beam that passes beside it
        through = np.fmin(np.fmin(readings[before], readings[after]), readings[beam])
        seen = inside & (distance < through + CLEAR_MARGIN)
        return self.points[~seen & (distance < self._forget_distance)]


def _first_in_cells(cells: IndexArray) -> IndexArray:
    """Return the row of the first point in each cell, by cells; the result of np.unique, but faster."""
    number = cells[:, 0] * 1000003 + cells[:, 1]
    order = number.argsort(kind='stable')
    number = number[order]
    new = np.empty(len(number), dtype=bool)
    new[:1] = True
    np.not_equal(number[1:], number[:-1], out=new[1:])
    return order[new]


def own_points(x: FloatArray, y: FloatArray, parts: Sequence[Sequence[float]]) -> BoolArray:
    """Return which points are on parts of the robot, such as wheels.

    Parameters
    ----------
    x, y : (N,) float64
        In the robot's frame, y without its sign [m].
    parts : sequence of (float, float, float, float)
        See :class:`Surroundings`.
    """
    own = np.zeros(len(x), bool)
    for x_min, x_max, y_min, y_max in parts:
        own |= ((x > x_min - WHEEL_MARGIN) & (x < x_max + WHEEL_MARGIN)
                & (y > y_min - WHEEL_MARGIN) & (y < y_max + WHEEL_MARGIN))
    return own


def _travel(delta_x: FloatArray, delta_y: FloatArray, cos_dir: FloatArray, sin_dir: FloatArray,
            radius: float) -> Tuple[FloatArray, IndexArray]:
    """Return the result of free_travel for points relative to the disc and directions as cosine and sine."""
    if len(cos_dir) == 1:
        return _travel_one_way(delta_x, delta_y, cos_dir, sin_dir, radius)
    cos_dir, sin_dir = cos_dir[:, None], sin_dir[:, None]
    along = cos_dir * delta_x + sin_dir * delta_y
    across = cos_dir * delta_y - sin_dir * delta_x
    across *= across
    reach = np.subtract(radius * radius, across, out=across)
    away = (reach <= 0.0) | (along <= 0.0)
    np.maximum(reach, 0.0, out=reach)
    travel = np.subtract(along, np.sqrt(reach, out=reach), out=along)
    np.putmask(travel, away, math.inf)
    np.maximum(travel, 0.0, out=travel)
    blockers = travel.argmin(axis=1)
    least = travel[np.arange(len(cos_dir)), blockers]
    blockers[np.isinf(least)] = -1
    return least, blockers


def _travel_one_way(delta_x: FloatArray, delta_y: FloatArray, cos_dir: FloatArray, sin_dir: FloatArray,
                    radius: float) -> Tuple[FloatArray, IndexArray]:
    """Return the same for one direction, for which most points need no square root."""
    along = cos_dir * delta_x + sin_dir * delta_y
    across = cos_dir * delta_y - sin_dir * delta_x
    reach = radius * radius - across * across
    ahead = (~((reach <= 0.0) | (along <= 0.0))).nonzero()[0]
    if len(ahead) == 0:
        return np.full(1, math.inf), np.full(1, -1)
    travel = np.maximum(along[ahead] - np.sqrt(reach[ahead]), 0.0)
    first = travel.argmin()
    return travel[first:first + 1], ahead[first:first + 1]
