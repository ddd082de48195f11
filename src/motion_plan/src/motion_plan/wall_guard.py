# SPDX-License-Identifier: BSD-3-Clause
"""The guard of the wall follower: keeps contact with a wall and keeps clear of it.

The report's table uses three sectors in front of the laser. It cuts corners that have left the field of view, and it
turns without end where the passage is narrower than about 0.9 m. The guard passes the table's commands while it
follows no wall and no obstacle is near. Near a wall it stores a contact point and models the robot as a disc around
its axle, wide enough to rotate on the spot. It follows the wall by the right-hand rule: starting at the contact point,
the first direction to the left in which the disc is free. The configuration of a disc is a point in the plane of
free centres, so it cannot get stuck, and its path around an obstacle is the border of that plane, a closed curve.
"""
from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np

from motion_plan.angles import wrap_angle
from motion_plan.body import AXLE_X, FOOTPRINT_BOXES, FOOTPRINT_DISCS, TURNING_RADIUS
from motion_plan.planar_types import Command, Pose
from motion_plan.surroundings import Surroundings, axle_of

if TYPE_CHECKING:
    from motion_plan.planar_types import FloatArray

LOG = logging.getLogger(__name__)

#: Distance from the axle to the wall that is kept while following [m]; gaps below twice this are walls.
FOLLOW_RADIUS = 0.56
#: Radius of the disc that must stay free [m]: the turning radius and a margin.
HARD_RADIUS = TURNING_RADIUS + 0.03
#: Below this clearance a rotation on the spot could collide; then only checked single moves are made [m].
ESCAPE_RADIUS = TURNING_RADIUS + 0.015
#: A direction is free if the disc can travel this far in it [m].
LOOK_AHEAD = 0.6
#: The guard starts to follow a wall nearer to the axle than this [m].
HOLD_DISTANCE = 1.35
#: The contact point may move this far along the wall between two updates [m].
SLIDE = 0.3
#: In a tight place the disc shrinks to this [m]. A place is tight if no direction is free, or if the robot has moved
#: less than STUCK_DISTANCE [m] in STUCK_TIME [s]; it stays tight for TIGHT_WAY [m].
TIGHT_RADIUS = 0.50
#: A disc smaller by the noise of the remembered points [m]: tried, and kept for this distance [m], before a rotation
#: back by more than TURN_BACK [rad].
NOISE_RADIUS = 0.53
NOISE_WAY = 0.5
TURN_BACK = 1.9
STUCK_DISTANCE = 0.4
STUCK_TIME = 12.0
TIGHT_WAY = 1.5
#: Steps of the search for a free direction [rad].
SWEEP = np.radians(np.arange(0.0, 360.0, 3.0))
CRUISE_SPEED = 0.5
TURN_SPEED = 0.5
STEER_GAIN = 2.5
STEER_LIMIT = 0.8
#: A heading error above this is corrected on the spot [rad].
TURN_ON_SPOT = 0.7
#: An escape continues until the axle is this far from all obstacles [m].
ESCAPED_RADIUS = HARD_RADIUS + 0.015
#: Clearance of an escaping move from every stored point [m]: preferred, and least; if it is already smaller, no move
#: may reduce it.
ESCAPE_CLEARANCE = (0.06, 0.03)
ESCAPE_SPEED = 0.15
ESCAPE_TURN = 0.3
ESCAPE_ALIGNED = 0.4
ESCAPE_TIMES = np.arange(0.1, 0.91, 0.1)


def footprint_clearance(points: FloatArray, pose: Pose) -> float:
    """Return the least distance [m] between the robot's outline and some points; negative inside.

    Parameters
    ----------
    points : (n, 2) float64
        Frame of ``pose`` [m].
    pose : (float, float, float)
        x, y [m] and yaw [rad] of link_chassis.
    """
    delta = points - np.asarray(pose[:2])
    cos_yaw, sin_yaw = math.cos(pose[2]), math.sin(pose[2])
    local_x = cos_yaw * delta[:, 0] + sin_yaw * delta[:, 1]
    local_y = cos_yaw * delta[:, 1] - sin_yaw * delta[:, 0]
    least = math.inf
    for x_min, x_max, y_min, y_max in FOOTPRINT_BOXES:
        out_x = np.maximum(x_min - local_x, local_x - x_max)
        out_y = np.maximum(y_min - local_y, local_y - y_max)
        outside = np.hypot(np.maximum(out_x, 0.0), np.maximum(out_y, 0.0))
        least = min(least, float(np.min(outside + np.minimum(np.maximum(out_x, out_y), 0.0))))
    for x, y, radius in FOOTPRINT_DISCS:
        least = min(least, float(np.min(np.hypot(local_x - x, local_y - y))) - radius)
    return least


def drive(pose: Pose, linear_x: float, angular_z: float, dt: float) -> Pose:
    """Return the pose after driving an arc for ``dt`` seconds; the axle moves along the heading.

    Parameters
    ----------
    pose : (float, float, float)
        x, y [m] and yaw [rad] of link_chassis.
    linear_x, angular_z : float
        Speed [m/s] and rotation rate [rad/s].
    dt : float
        Duration [s].
    """
    x, y = axle_of(pose)
    yaw = pose[2] + angular_z * dt
    middle = pose[2] + 0.5 * angular_z * dt
    x, y = x + linear_x * dt * math.cos(middle), y + linear_x * dt * math.sin(middle)
    return x - AXLE_X * math.cos(yaw), y - AXLE_X * math.sin(yaw), yaw


class WallGuard:
    """Right-hand rule for a disc; keeps one contact point of the wall between updates.

    Attributes
    ----------
    contact : (2,) float64 or None
        The contact point of the wall, odometry frame [m].
    """

    def __init__(self) -> None:
        self.contact: Optional[FloatArray] = None
        self._anchor: Optional[Tuple[float, float, float]] = None
        self._tight_at: Optional[Tuple[float, float]] = None
        self._escaping = False

    def release(self) -> None:
        """Forget the wall, as when the behaviour is switched on or off."""
        self.contact = None
        self._anchor = None
        self._tight_at = None
        self._escaping = False

    def update(self, now: float, pose: Pose, surroundings: Surroundings, nominal: Command) -> Command:
        """Return the command that keeps clear of all obstacles.

        Parameters
        ----------
        now : float
            Time [s].
        pose : (float, float, float)
            x, y [m], yaw [rad] of link_chassis in the odometry frame.
        surroundings : motion_plan.surroundings.Surroundings
            Obstacles seen until now.
        nominal : (float, float)
            The command of the report's table; returned while no wall is followed.

        Returns
        -------
        (float, float)
            linear_x [m/s] and angular_z [rad/s].
        """
        x, y = axle_of(pose)
        nearest = surroundings.nearest(x, y)[0]
        self._escaping = nearest < (ESCAPED_RADIUS if self._escaping else ESCAPE_RADIUS)
        if self._escaping:
            return self._escape(pose, nearest, surroundings)
        self._hold(x, y, pose[2], surroundings)
        if self.contact is None:
            return self._limited(nominal, x, y, pose[2], surroundings)
        self._watch_progress(now, x, y)
        direction = self._direction(x, y, pose[2], nearest, surroundings)
        if direction is None:
            return 0.0, TURN_SPEED
        error = wrap_angle(direction - pose[2])
        if abs(error) > TURN_ON_SPOT:
            return 0.0, math.copysign(TURN_SPEED, error)
        angular_z = max(-STEER_LIMIT, min(STEER_LIMIT, STEER_GAIN * error))
        return self._limited((CRUISE_SPEED * (1.0 - abs(error) / TURN_ON_SPOT), angular_z), x, y, pose[2], surroundings)

    def _hold(self, x: float, y: float, yaw: float, surroundings: Surroundings) -> None:
        """Keep the contact point on its wall; start to follow a wall that is near enough."""
        if self.contact is not None:
            distance, point = surroundings.nearest(self.contact[0], self.contact[1])
            if distance < SLIDE:
                self.contact = point
                return
            LOG.debug('the followed wall has disappeared')
            self.contact = None
        travel, blocker = surroundings.free_travel(x, y, [yaw], FOLLOW_RADIUS)
        if travel[0] < HOLD_DISTANCE - FOLLOW_RADIUS:
            self.contact = surroundings.points[blocker[0]]
            return
        distance, point = surroundings.nearest(x, y)
        if distance < HOLD_DISTANCE:
            self.contact = point

    def _watch_progress(self, now: float, x: float, y: float) -> None:
        """Determine whether the place is tight: about as wide as the disc, where noise opens and closes the passage."""
        if self._tight_at is not None \
                and math.hypot(x - self._tight_at[0], y - self._tight_at[1]) > self._tight_way:
            self._tight_at = None
        if self._anchor is None or math.hypot(x - self._anchor[1], y - self._anchor[2]) > STUCK_DISTANCE:
            self._anchor = (now, x, y)
        elif now - self._anchor[0] > STUCK_TIME and (self._tight_at is None or self._radius > TIGHT_RADIUS):
            self._tighten(x, y, TIGHT_RADIUS, TIGHT_WAY)

    def _direction(self, x: float, y: float, yaw: float, nearest: float, surroundings: Surroundings) -> Optional[float]:
        """Direction to drive [rad] or None; shrinks the disc if none is free, or if noise makes it turn back."""
        contact = self.contact
        direction = self._first_free(x, y, nearest, surroundings)
        if self._tight_at is not None or (direction is not None and abs(wrap_angle(direction - yaw)) < TURN_BACK):
            return direction
        held, self.contact = self.contact, contact
        if direction is None:
            self._tighten(x, y, TIGHT_RADIUS, TIGHT_WAY)
            return self._first_free(x, y, nearest, surroundings)
        self._tighten(x, y, NOISE_RADIUS, NOISE_WAY)
        onward = self._first_free(x, y, nearest, surroundings)
        if onward is not None and abs(wrap_angle(onward - yaw)) < TURN_BACK:
            return onward
        self.contact, self._tight_at = held, None
        return direction

    def _tighten(self, x: float, y: float, radius: float, way: float) -> None:
        self._tight_at, self._radius, self._tight_way = (x, y), radius, way

    def _first_free(self, x: float, y: float, nearest: float, surroundings: Surroundings) -> Optional[float]:
        """Direction to drive [rad], or None if no direction is free; moves the contact point along."""
        wanted = FOLLOW_RADIUS if self._tight_at is None else self._radius
        radius = min(wanted, max(HARD_RADIUS, nearest - 0.005))
        assert self.contact is not None         # called only while a wall is held
        start = math.atan2(self.contact[1] - y, self.contact[0] - x)
        directions = start + SWEEP
        first, blocker = surroundings.first_free(x, y, directions, radius, LOOK_AHEAD)
        if first < 0:
            return None
        if first == 0:
            return directions[0]
        # the point that ends the last blocked direction is the part of the wall next to the path
        self.contact = surroundings.points[blocker]
        # the wall is too near: a little more to the left, if that is free as well
        outward = directions[first] + (wanted - radius) / LOOK_AHEAD
        if surroundings.free_travel(x, y, [outward], radius)[0][0] >= 0.5 * LOOK_AHEAD:
            return outward
        return directions[first]

    @staticmethod
    def _limited(command: Command, x: float, y: float, yaw: float, surroundings: Surroundings) -> Command:
        """Slow ``command`` down so that the robot stops before an obstacle enters the hard disc."""
        linear_x, angular_z = command
        travel = surroundings.free_travel(x, y, [yaw], HARD_RADIUS)[0][0]
        # 0.4 s covers the reaction, late commands and braking
        return max(0.0, min(linear_x, (travel - 0.03) / 0.4)), angular_z

    def _escape(self, pose: Pose, nearest: float, surroundings: Surroundings) -> Command:
        """An obstacle is inside the turning disc: the first safe move that leads to a free direction."""
        x, y = axle_of(pose)
        self._hold(x, y, pose[2], surroundings)
        direction = None if self.contact is None else self._first_free(x, y, nearest, surroundings)
        delta = surroundings.points - np.asarray(pose[:2])
        points = surroundings.points[np.hypot(delta[:, 0], delta[:, 1]) < 1.2]
        clearance = footprint_clearance(points, pose)
        if direction is None:
            moves = [(ESCAPE_SPEED, 0.0), (0.0, ESCAPE_TURN), (0.0, -ESCAPE_TURN)]
        else:
            error = wrap_angle(direction - pose[2])
            turn = math.copysign(min(ESCAPE_TURN, STEER_GAIN * abs(error)), error)
            if abs(error) > ESCAPE_ALIGNED and not self._can_turn(points, pose, error, clearance):
                # an obstacle blocks this direction of rotation: rotate the other way, if that is free
                turn = -turn
                if not self._can_turn(points, pose, error - math.copysign(2 * math.pi, error), clearance):
                    turn = 0.0
            ahead = abs(error) < ESCAPE_ALIGNED or turn == 0.0
            moves = [(ESCAPE_SPEED if ahead else 0.0, turn), (0.0, turn), (ESCAPE_SPEED, turn), (ESCAPE_SPEED, 0.0)]
        least = []
        for linear_x, angular_z in moves:
            poses = [drive(pose, linear_x, angular_z, time) for time in ESCAPE_TIMES]
            least.append(min(footprint_clearance(points, later) for later in poses))
        for allowed in ESCAPE_CLEARANCE:
            for move, reached in zip(moves, least):
                if reached >= min(allowed, clearance):
                    return move
        return 0.0, 0.0

    @staticmethod
    def _can_turn(points: FloatArray, pose: Pose, angle: float, clearance: float) -> bool:
        """Whether the robot can turn on the spot by ``angle`` [rad] with enough clearance to ``points``."""
        for part in np.linspace(0.0, 1.0, 2 + int(abs(angle) / 0.1))[1:]:
            if footprint_clearance(points, drive(pose, 0.0, part * angle, 1.0)) < min(ESCAPE_CLEARANCE[1], clearance):
                return False
        return True
