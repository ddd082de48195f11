# SPDX-License-Identifier: BSD-3-Clause
"""Floor plans: straight walls, boxes and pillars, with places to visit; ROS-free and without randomness."""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Iterator, Tuple

import numpy as np

from m2wr_sim.geometry import quaternion_from_rpy, yaw_of
from m2wr_sim.model.types import Box, Cylinder

if TYPE_CHECKING:
    from typing import Union

    from m2wr_node.array_types import BoolArray, FloatArray
    from m2wr_sim.geometry import Pose

    Part = Tuple[str, Union[Box, Cylinder], Pose]

WALL_THICKNESS = 0.12       # light partition wall of an office [m]
HEIGHT = 2.5                # of walls, boxes and pillars [m]
_BLOCK = 2000               # points at a time, which bounds memory
_SDF_NUMBERS = "{:.4f}"


@dataclass(frozen=True)
class FloorPlan:
    """One floor.

    Attributes
    ----------
    name : str
    walls : (W, 4) float64
        Centre lines x0 y0 x1 y1 [m].
    glass : (W,) bool
        Which walls are of glass.
    boxes : (B, 5) float64
        Furniture: centre x y [m], length, width [m], yaw [rad].
    pillars : (P, 3) float64
        Centre x y and radius [m].
    places : (N, 2) float64
        Free points in different rooms, to be visited [m].
    in_order : bool
        Whether a tour visits them in their order, again and again.
    """

    name: str
    walls: FloatArray
    glass: BoolArray
    boxes: FloatArray
    pillars: FloatArray
    places: FloatArray
    in_order: bool = False

    @property
    def bounds(self) -> Tuple[float, float, float, float]:
        """Least and greatest coordinates of the walls: x0, y0, x1, y1 [m]."""
        xs, ys = self.walls[:, [0, 2]], self.walls[:, [1, 3]]
        return float(xs.min()), float(ys.min()), float(xs.max()), float(ys.max())

    def parts(self) -> Iterator[Part]:
        """Yield (name, shape, pose) of every wall, box and pillar, walls first and in order."""
        for number, (x0, y0, x1, y1) in enumerate(self.walls):
            length = float(np.hypot(x1 - x0, y1 - y0)) + WALL_THICKNESS
            yield ("wall_%d" % number, Box((length, WALL_THICKNESS, HEIGHT)),
                   upright(0.5 * (x0 + x1), 0.5 * (y0 + y1), float(np.arctan2(y1 - y0, x1 - x0))))
        for number, (x, y, length, width, yaw) in enumerate(self.boxes):
            yield "box_%d" % number, Box((float(length), float(width), HEIGHT)), upright(x, y, yaw)
        for number, (x, y, radius) in enumerate(self.pillars):
            yield "pillar_%d" % number, Cylinder(float(radius), HEIGHT), upright(x, y)

    def near(self, low: FloatArray, high: FloatArray, reach: float) -> FloorPlan:
        """Return the plan with only those parts that may be within a distance of an upright rectangle.

        Parameters
        ----------
        low, high : (2,) float64
            Corners of the rectangle with the least and with the greatest coordinates [m].
        reach : float
            [m]
        """
        def within(least: FloatArray, most: FloatArray) -> BoolArray:
            return np.asarray(((least <= high + reach) & (most >= low - reach)).all(axis=1))

        starts, ends, half = self.walls[:, :2], self.walls[:, 2:], 0.5 * WALL_THICKNESS
        walls = within(np.minimum(starts, ends) - half, np.maximum(starts, ends) + half)
        circle = 0.5 * np.hypot(self.boxes[:, 2:3], self.boxes[:, 3:4])
        boxes = within(self.boxes[:, :2] - circle, self.boxes[:, :2] + circle)
        pillars = within(self.pillars[:, :2] - self.pillars[:, 2:], self.pillars[:, :2] + self.pillars[:, 2:])
        return replace(self, walls=self.walls[walls], glass=self.glass[walls], boxes=self.boxes[boxes],
                       pillars=self.pillars[pillars])

    def clearance(self, points: FloatArray) -> FloatArray:
        """Return the distance of points (K, 2) from the nearest surface (K,) [m]; negative inside a wall or pillar."""
        blocks = [points[begin:begin + _BLOCK] for begin in range(0, len(points), _BLOCK)]
        return np.concatenate([self._clearance(block[:, None, :]) for block in blocks] or [np.empty(0)])

    def _clearance(self, points: FloatArray) -> FloatArray:
        """Return the same for points (K, 1, 2) against all parts at once."""
        walls, half = self.walls, 0.5 * WALL_THICKNESS
        nearest = [np.full(len(points), np.inf)]
        if len(walls):
            nearest.append((_segment_distance(points, walls[:, :2], walls[:, 2:]) - half).min(axis=1))
        if len(self.boxes):
            nearest.append(_box_distance(points, self.boxes).min(axis=1))
        if len(self.pillars):
            away = points - self.pillars[:, :2]
            nearest.append((np.hypot(away[..., 0], away[..., 1]) - self.pillars[:, 2]).min(axis=1))
        return np.asarray(np.minimum.reduce(nearest))

    def sdf(self) -> str:
        """Return a world file of SDF 1.6 that this simulator and Gazebo load: floor, sun and the parts as one model."""
        parts = []
        for name, shape, (position, orientation) in self.parts():
            if isinstance(shape, Box):
                geometry = "<box><size>%s</size></box>" % _words(shape.size)
            else:
                geometry = "<cylinder><radius>%s</radius><length>%s</length></cylinder>" % (
                    _words((shape.radius,)), _words((shape.length,)))
            pose = "<pose>%s</pose>" % _words((*position, 0.0, 0.0, yaw_of(orientation)))
            for kind in ("collision", "visual"):
                parts.append('        <{0} name="{1}_{0}">{2}<geometry>{3}</geometry></{0}>'.format(
                    kind, name, pose, geometry))
        return _WORLD.format(name=self.name, parts="\n".join(parts))


_WORLD = """<?xml version="1.0"?>
<sdf version="1.6">
  <world name="{name}">
    <include><uri>model://sun</uri></include>
    <include><uri>model://ground_plane</uri></include>
    <model name="building">
      <static>true</static>
      <link name="floor">
{parts}
      </link>
    </model>
  </world>
</sdf>
"""


def _words(values: Tuple[float, ...]) -> str:
    return " ".join(_SDF_NUMBERS.format(value) for value in values)


def upright(x: float, y: float, yaw: float = 0.0) -> Pose:
    """Return the pose of a wall, box or pillar that stands on the floor.

    Parameters
    ----------
    x, y : float
        [m]
    yaw : float
        [rad]
    """
    return (float(x), float(y), 0.5 * HEIGHT), quaternion_from_rpy(0.0, 0.0, float(yaw))


def _segment_distance(points: FloatArray, starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the distances (K, W) of points (K, 1, 2) from line segments (W, 2)."""
    ways, away = ends - starts, points - starts
    along = (away * ways).sum(axis=-1) / np.maximum((ways * ways).sum(axis=-1), 1e-12)
    beside = away - np.minimum(np.maximum(along, 0.0), 1.0)[..., None] * ways
    return np.asarray(np.hypot(beside[..., 0], beside[..., 1]))


def _box_distance(points: FloatArray, boxes: FloatArray) -> FloatArray:
    """Return the distances (K, B) of points (K, 1, 2) from boxes (B, 5); negative inside."""
    cosine, sine, away = np.cos(boxes[:, 4]), np.sin(boxes[:, 4]), points - boxes[:, :2]
    outside_x = np.abs(cosine * away[..., 0] + sine * away[..., 1]) - 0.5 * boxes[:, 2]
    outside_y = np.abs(cosine * away[..., 1] - sine * away[..., 0]) - 0.5 * boxes[:, 3]
    return np.asarray(np.hypot(np.maximum(outside_x, 0.0), np.maximum(outside_y, 0.0))
                      + np.minimum(np.maximum(outside_x, outside_y), 0.0))
