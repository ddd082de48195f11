# SPDX-License-Identifier: BSD-3-Clause
"""Shapes from above, and their distances from a robot.

Robot and obstacles are outlines in the plane: the part of their shapes between the floor and the top of the robot,
from above.  An outline is a convex polygon rounded by a radius, so that discs are exact.
"""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray, IndexArray

FLOOR = 0.001           # m; a plate below this height is no obstacle
ROBOT_HEIGHT = 0.2      # m; higher shapes do not stop m2wr
RIM_POINTS = 120        # of a lying or tilted cylinder; its outline is too small by less than 4e-4 of the radius
_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_BOX_EDGES = np.array([(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1])
_TRIANGLE_EDGES = np.array([(0, 1), (1, 2), (2, 0)])
_POSES_AT_ONCE = 256


@dataclass(frozen=True)
class Outline:
    """A convex polygon widened by a radius.

    Attributes
    ----------
    vertices : (m, 2) float64
        Corners [m], counter-clockwise; one alone makes a disc, two a rounded line.
    radius : float
        What is added all around [m].
    name : str
        The model it belongs to.
    """

    vertices: FloatArray
    radius: float = 0.0
    name: str = ""


def _rectangle(x: float, y: float, length: float, width: float) -> FloatArray:
    return np.array([(x - length / 2, y - width / 2), (x + length / 2, y - width / 2),
                     (x + length / 2, y + width / 2), (x - length / 2, y + width / 2)])


#: m2wr from above, in the frame of link_chassis: chassis, the caster that collides, the two wheels.
M2WR_FOOTPRINT = (Outline(_rectangle(0.0, 0.0, 0.5, 0.3), name="chassis"),
                  Outline(np.array([(0.35, 0.0)]), 0.05, "caster"),
                  Outline(_rectangle(-0.05, 0.20, 0.2, 0.04), name="wheel at the left"),
                  Outline(_rectangle(-0.05, -0.20, 0.2, 0.04), name="wheel at the right"))


@dataclass(frozen=True)
class Clearance:
    """The closest approach: distance [m] (0: they overlap), index of the pose, name of the obstacle."""

    distance: float
    index: Optional[int] = None
    name: str = ""


# ---- outlines ----------------------------------------------------------------------------------------------------

def convex_hull(points: ArrayLike) -> FloatArray:
    """Return the corners of the convex hull of points (n, 2), counter-clockwise, without those on a straight edge."""
    ordered = sorted(set(map(tuple, np.asarray(points, float).tolist())))
    if len(ordered) < 3:
        return np.array(ordered)
    hull: List[Tuple[float, float]] = []
    for chain in (ordered, ordered[::-1]):          # monotone chain: lower side, then upper side
        side: List[Tuple[float, float]] = []
        for x, y in chain:
            while len(side) > 1 and ((side[-1][0] - side[-2][0]) * (y - side[-2][1])
                                     - (side[-1][1] - side[-2][1]) * (x - side[-2][0])) <= 0.0:
                side.pop()
            side.append((x, y))
        hull += side[:-1]
    return np.array(hull)


def slice_from_above(corners: FloatArray, edges: IndexArray, low: float, high: float) -> Optional[FloatArray]:
    """Return the outline from above of the part of a convex body between two heights.

    Parameters
    ----------
    corners : (n, 3) float64
        Of the body, in world [m].
    edges : (k, 2) int
        Indices of the corners that its edges connect.
    low, high : float
        Heights of the slice [m].

    Returns
    -------
    (m, 2) float64 or None
        Corners [m], counter-clockwise; None if no part is between the heights.
    """
    heights = corners[:, 2]
    if heights.max() <= low or heights.min() >= high:
        return None
    parts = [corners[(heights >= low) & (heights <= high), :2]]
    one, two = corners[edges[:, 0]], corners[edges[:, 1]]
    for height in (low, high):
        cut = (one[:, 2] - height) * (two[:, 2] - height) < 0.0
        share = (height - one[cut, 2]) / (two[cut, 2] - one[cut, 2])
        parts.append(one[cut, :2] + share[:, None] * (two[cut, :2] - one[cut, :2]))
    return convex_hull(np.concatenate(parts))


def sphere_outline(radius: float, centre: ArrayLike, low: float = FLOOR, high: float = ROBOT_HEIGHT,
                   name: str = "") -> Optional[Outline]:
    """Return the outline of the part of a sphere between two heights, or None if there is none.

    Parameters
    ----------
    radius : float
        [m].
    centre : (3,) floats
        In world [m].
    low, high : float
        Heights of the slice [m].
    name : str
        Of the model.
    """
    centre = np.asarray(centre, float)
    away = max(low - centre[2], centre[2] - high, 0.0)      # from the centre to the slice
    if away >= radius:
        return None
    return Outline(centre[None, :2], math.sqrt(radius ** 2 - away ** 2), name)


def box_outline(size: ArrayLike, centre: ArrayLike, rotation: ArrayLike, low: float = FLOOR, high: float = ROBOT_HEIGHT,
                name: str = "") -> Optional[Outline]:
    """Return the outline of the part of a box between two heights, or None if there is none.

    Parameters
    ----------
    size : (3,) floats
        Along its axes [m].
    centre : (3,) floats
        In world [m].
    rotation : (3, 3) floats
        From its axes to world.
    low, high : float
        Heights of the slice [m].
    name : str
        Of the model.
    """
    vertices = slice_from_above((_CORNERS * size).dot(np.asarray(rotation).T) + centre, _BOX_EDGES, low, high)
    return None if vertices is None else Outline(vertices, 0.0, name)


def cylinder_outline(radius: float, length: float, centre: ArrayLike, rotation: ArrayLike, low: float = FLOOR,
                     high: float = ROBOT_HEIGHT, name: str = "") -> Optional[Outline]:
    """Return the outline of the part of a cylinder between two heights, or None; an upright cylinder gives a disc.

    Parameters
    ----------
    radius : float
        [m].
    length : float
        Along its z axis [m].
    centre : (3,) floats
        In world [m].
    rotation : (3, 3) floats
        From its axes to world.
    low, high : float
        Heights of the slice [m].
    name : str
        Of the model.
    """
    centre, rotation = np.asarray(centre, float), np.asarray(rotation)
    if abs(rotation[2, 2]) > 1.0 - 1e-12:
        inside = centre[2] - 0.5 * length < high and centre[2] + 0.5 * length > low
        return Outline(centre[None, :2], radius, name) if inside else None
    corners, edges = _cylinder_corners(radius, length)
    vertices = slice_from_above(corners.dot(rotation.T) + centre, edges, low, high)
    return None if vertices is None else Outline(vertices, 0.0, name)


def triangle_outlines(corners: FloatArray, low: float = FLOOR, high: float = ROBOT_HEIGHT,
                      name: str = "") -> List[Outline]:
    """Return the outlines of the parts of triangles between two heights, one for each triangle that has one.

    Parameters
    ----------
    corners : (n, 3, 3) float64
        In world [m].
    low, high : float
        Heights of the slice [m].
    name : str
        Of the model.
    """
    found = []
    for triangle in corners[(corners[..., 2].max(axis=1) > low) & (corners[..., 2].min(axis=1) < high)]:
        vertices = slice_from_above(triangle, _TRIANGLE_EDGES, low, high)
        if vertices is not None and len(vertices):
            found.append(Outline(vertices, 0.0, name))
    return found


def _cylinder_corners(radius: float, length: float) -> Tuple[FloatArray, IndexArray]:
    angles = 2.0 * math.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    corners = np.concatenate([np.column_stack((rim, np.full(RIM_POINTS, half)))
                              for half in (-0.5 * length, 0.5 * length)])
    here = np.arange(RIM_POINTS)
    after = (here + 1) % RIM_POINTS
    edges = np.concatenate((np.column_stack((here, after)), np.column_stack((here, after)) + RIM_POINTS,
                            np.column_stack((here, here + RIM_POINTS))))
    return corners, edges


# ---- clearance ---------------------------------------------------------------------------------------------------

def _edges(polygons: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Return x and y (..., m) of the edges of closed polygons (..., m, 2)."""
    along = np.concatenate((polygons[..., 1:, :], polygons[..., :1, :]), axis=-2) - polygons
    return along[..., 0], along[..., 1]


def _to_segments(points: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the least distance (...) of points (..., p, 2) from the edges of closed polygons (..., m, 2)."""
    x, y = (values[..., None, :] for values in _edges(ends))            # as x and y, much faster than sums of two
    offset_x = points[..., :, None, 0] - ends[..., None, :, 0]
    offset_y = points[..., :, None, 1] - ends[..., None, :, 1]
    share = (offset_x * x + offset_y * y) / np.maximum(x * x + y * y, 1e-300)
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    offset_x -= share * x
    offset_y -= share * y
    return np.sqrt((offset_x * offset_x + offset_y * offset_y).min(axis=(-2, -1)))


def _separation(polygons: FloatArray, points: FloatArray) -> FloatArray:
    """Return how far (...) points (..., p, 2) stay outside of polygons (..., m, 2), by the best of their edges."""
    if polygons.shape[-2] == 1:     # no edge, nothing to show
        return np.full(polygons.shape[:-2], -np.inf)
    x, y = _edges(polygons)
    length = np.sqrt(x * x + y * y)
    gaps = (y / length)[..., :, None] * (points[..., None, :, 0] - polygons[..., :, None, 0])
    gaps -= (x / length)[..., :, None] * (points[..., None, :, 1] - polygons[..., :, None, 1])
    return gaps.min(axis=-1).max(axis=-1)


def _polygon_distances(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return distances (n,) of convex polygons (m, 2) and (n, k, 2), 0 where they overlap."""
    one = np.broadcast_to(one, two.shape[:1] + one.shape)
    distances = np.minimum(_to_segments(one, two), _to_segments(two, one))
    # corners alone miss two bars that cross; convex bodies are apart only if an edge of one of them shows it
    apart = np.maximum(_separation(one, two), _separation(two, one))
    overlap = (apart < -1e-12) & (apart > -np.inf)
    return np.where(overlap, 0.0, distances)


def footprint_distances(poses: FloatArray, obstacle: Outline,
                        footprint: Sequence[Outline] = M2WR_FOOTPRINT) -> FloatArray:
    """Return the distance of the robot from one obstacle at many poses.

    Parameters
    ----------
    poses : (n, 3) float64
        x, y [m] and yaw [rad] of the robot.
    obstacle : Outline
        In world.
    footprint : sequence of Outline
        In the robot's frame.

    Returns
    -------
    (n,) float64
        Distances [m]; 0 where they overlap.
    """
    cosine, sine = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    offset = obstacle.vertices[None] - poses[:, None, :2]
    local = np.stack((cosine * offset[..., 0] + sine * offset[..., 1],
                      cosine * offset[..., 1] - sine * offset[..., 0]), axis=-1)
    least = np.full(len(poses), np.inf)
    for part in footprint:
        least = np.minimum(least, _polygon_distances(part.vertices, local) - part.radius - obstacle.radius)
    return np.maximum(least, 0.0)


def point_distances(points: FloatArray, obstacle: Outline) -> FloatArray:
    """Return the distances (n,) [m] of points from an outline, 0 inside.

    Parameters
    ----------
    points : (n, 2) float64
        In world [m].
    obstacle : Outline
        In world.
    """
    points, vertices = points[:, None, :], obstacle.vertices[None]
    outside = _separation(vertices, points) > 0.0 if len(obstacle.vertices) > 2 else True
    return np.where(outside, np.maximum(_to_segments(points, vertices) - obstacle.radius, 0.0), 0.0)


def least_clearance(poses: FloatArray, obstacles: Sequence[Outline],
                    footprint: Sequence[Outline] = M2WR_FOOTPRINT) -> Clearance:
    """Return the closest approach of a robot to any obstacle.

    Parameters
    ----------
    poses : (n, 3) float64
        x, y [m] and yaw [rad]; nothing is assumed in between.
    obstacles : sequence of Outline
        In world.
    footprint : sequence of Outline
        In the robot's frame.

    Returns
    -------
    Clearance
        With an infinite distance if there are no obstacles or poses.
    """
    best = Clearance(math.inf)
    if not len(poses) or not obstacles:
        return best
    reach = max(float(np.max(np.hypot(*part.vertices.T))) + part.radius for part in footprint)
    # the robot's origin cannot be closer than its footprint, nor farther than that by more than the footprint's reach
    origin = [point_distances(poses[:, :2], obstacle) for obstacle in obstacles]
    for number in sorted(range(len(obstacles)), key=lambda index: float(np.min(origin[index]))):
        obstacle, order = obstacles[number], np.argsort(origin[number], kind="stable")
        for begin in range(0, len(order), _POSES_AT_ONCE):
            chosen = order[begin:begin + _POSES_AT_ONCE]
            chosen = chosen[origin[number][chosen] - reach < best.distance]
            if not len(chosen):
                break
            distances = footprint_distances(poses[chosen], obstacle, footprint)
            nearest = int(np.argmin(distances))
            if distances[nearest] < best.distance:
                best = Clearance(float(distances[nearest]), int(chosen[nearest]), obstacle.name)
    return best
