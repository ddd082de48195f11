# SPDX-License-Identifier: BSD-3-Clause
"""The body of a robot, as methods without a map need it: where it turns, what it covers, where its laser is."""
from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

from m2wr_view.outlines import M2WR_FOOTPRINT, ROBOT_HEIGHT, convex_hull
from motion_plan import body as m2wr

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_view.outlines import Outline

ROUND = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)     # of a rounded corner [rad]


@dataclass(frozen=True)
class RobotBody:
    """A robot with a differential drive, from above, in the frame of its pose.

    Attributes
    ----------
    footprint : tuple of Outline
        Its parts.
    axle_x : float
        The point about which it turns on the spot [m].
    laser : (float, float, float)
        Position and direction of the laser [m, m, rad].
    own_parts : tuple of (float, float, float, float)
        What the laser sees of the robot, see :class:`motion_plan.surroundings.Surroundings`.
    height : float
        Of its top above the ground [m]; what is higher is no obstacle.
    """

    footprint: Tuple[Outline, ...]
    axle_x: float
    laser: Tuple[float, float, float]
    own_parts: Tuple[Tuple[float, ...], ...] = ()
    height: float = ROBOT_HEIGHT

    @cached_property
    def turning_radius(self) -> float:
        """Of the least disc around the axle that covers the robot at every heading [m]."""
        return max(float(np.hypot(part.vertices[:, 0] - self.axle_x, part.vertices[:, 1]).max()) + part.radius
                   for part in self.footprint)

    @cached_property
    def inscribed_radius(self) -> float:
        """Of the greatest disc around the axle inside of the robot's hull [m]."""
        corners = self.hull - (self.axle_x, 0.0)
        along = np.roll(corners, -1, axis=0) - corners
        return float(np.min((along[:, 1] * corners[:, 0] - along[:, 0] * corners[:, 1]) / np.hypot(*along.T)))

    @cached_property
    def hull(self) -> FloatArray:
        """Corners (N, 2) of the robot's convex hull, counter-clockwise [m]."""
        rim = np.stack([np.cos(ROUND), np.sin(ROUND)], -1)
        parts = [(part.vertices[:, None] + part.radius * rim).reshape(-1, 2) if part.radius else part.vertices
                 for part in self.footprint]
        found = convex_hull(np.concatenate(parts))
        found.flags.writeable = False
        return found

    def axle(self, pose: Vector) -> Tuple[float, float]:
        """Return x, y of the axle [m].

        Parameters
        ----------
        pose : (3,) float
            Of the robot [m, m, rad]; the axle is in the same frame.
        """
        return (float(pose[0] + self.axle_x * math.cos(pose[2])), float(pose[1] + self.axle_x * math.sin(pose[2])))

    def axles(self, poses: FloatArray) -> FloatArray:
        """Return x, y (N, 2) of the axle [m] for poses (N, 3)."""
        return np.asarray(poses[:, :2] + self.axle_x * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], -1))


def boxes_of(parts: Sequence[Outline]) -> Tuple[Tuple[float, ...], ...]:
    """Return the bounds of parts: least and greatest x, least and greatest y without its sign [m].

    Parameters
    ----------
    parts : sequence of Outline
    """
    found = []
    for part in parts:
        low, high = part.vertices.min(axis=0) - part.radius, part.vertices.max(axis=0) + part.radius
        least = 0.0 if low[1] <= 0.0 <= high[1] else float(min(abs(low[1]), abs(high[1])))
        found.append((float(low[0]), float(high[0]), least, float(max(abs(low[1]), abs(high[1])))))
    return tuple(found)


#: The robot of m2wr_description.
M2WR = RobotBody(M2WR_FOOTPRINT, m2wr.AXLE_X, (m2wr.LASER_X, 0.0, 0.0), m2wr.FOOTPRINT_BOXES[1:2])
