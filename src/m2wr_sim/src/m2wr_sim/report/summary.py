"""A run in numbers: how far, how long, how close to the obstacles.

Robot and obstacles are outlines in the plane: what of their collision shapes lies between the floor and the top of
the robot, seen from above.  An outline is a convex polygon rounded by a radius, so that discs are exact.
"""
import math
from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np

from m2wr_sim.geometry import compose, matrix_from_quaternion
from m2wr_sim.model.types import Box, Cylinder, Sphere

FLOOR = 0.001           # m; a slab whose top is the floor is no obstacle
ROBOT_HEIGHT = 0.2      # m; what hangs higher does not stop m2wr
RIM_POINTS = 120        # of a lying or tilted cylinder; its outline is too small by less than 4e-4 of the radius
_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_BOX_EDGES = np.array([(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1])
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

    vertices: np.ndarray
    radius: float = 0.0
    name: str = ""


def _rectangle(x, y, length, width):
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


@dataclass(frozen=True)
class Summary:
    """A run in numbers; lengths in metres, times in simulated seconds, None for what was not recorded.

    ``duration`` lasts until the final state, ``least_clearance`` is infinite in a world without obstacles, and
    ``state_changes`` does not count the state that the run began with.
    """

    path_length: Optional[float]
    straight_distance: Optional[float]
    end_distance: Optional[float]
    duration: Optional[float]
    least_clearance: Optional[float]
    clearance_time: Optional[float]
    clearance_position: Optional[Tuple[float, float]]
    clearance_name: str
    state_changes: Optional[int]
    final_state: Optional[str]
    touches: Optional[int]
    mean_factor: Optional[float]


# ---- outlines ----------------------------------------------------------------------------------------------------

def convex_hull(points):
    """Return the corners of the convex hull of points (n, 2), counter-clockwise, without those on a straight edge."""
    ordered = sorted(set(map(tuple, np.asarray(points, float).tolist())))
    if len(ordered) < 3:
        return np.array(ordered)
    hull = []
    for chain in (ordered, ordered[::-1]):          # monotone chain: lower side, then upper side
        side = []
        for x, y in chain:
            while len(side) > 1 and ((side[-1][0] - side[-2][0]) * (y - side[-2][1])
                                     - (side[-1][1] - side[-2][1]) * (x - side[-2][0])) <= 0.0:
                side.pop()
            side.append((x, y))
        hull += side[:-1]
    return np.array(hull)


def _slice_from_above(corners, edges, low, high):
    """Return the hull (m, 2) of what of a convex body lies between two heights, or None if nothing does."""
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


def outline_of(geometry, pose, low=FLOOR, high=ROBOT_HEIGHT, name=""):
    """Return what of a shape lies between two heights, seen from above.

    Parameters
    ----------
    geometry : Box, Cylinder, Sphere or Plane
        See :mod:`m2wr_sim.model.types`.
    pose : ((x, y, z), (x, y, z, w))
        Of the shape in world.
    low, high : float
        Heights [m].
    name : str
        For :attr:`Outline.name`.

    Returns
    -------
    Outline or None
        None for a plane and where nothing lies between the heights.
    """
    centre, rotation = np.asarray(pose[0], float), matrix_from_quaternion(pose[1])
    if isinstance(geometry, Sphere):
        away = max(low - centre[2], centre[2] - high, 0.0)      # from the centre to the slice
        if away >= geometry.radius:
            return None
        return Outline(centre[None, :2], math.sqrt(geometry.radius ** 2 - away ** 2), name)
    if isinstance(geometry, Box):
        corners, edges = _CORNERS * geometry.size, _BOX_EDGES
    elif isinstance(geometry, Cylinder):
        if abs(rotation[2, 2]) > 1.0 - 1e-12:
            inside = centre[2] - 0.5 * geometry.length < high and centre[2] + 0.5 * geometry.length > low
            return Outline(centre[None, :2], geometry.radius, name) if inside else None
        corners, edges = _cylinder_corners(geometry)
    else:
        return None
    vertices = _slice_from_above(corners.dot(rotation.T) + centre, edges, low, high)
    return None if vertices is None else Outline(vertices, 0.0, name)


def _cylinder_corners(cylinder):
    angles = 2.0 * math.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = cylinder.radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    corners = np.concatenate([np.column_stack((rim, np.full(RIM_POINTS, half)))
                              for half in (-0.5 * cylinder.length, 0.5 * cylinder.length)])
    here = np.arange(RIM_POINTS)
    after = (here + 1) % RIM_POINTS
    edges = np.concatenate((np.column_stack((here, after)), np.column_stack((here, after)) + RIM_POINTS,
                            np.column_stack((here, here + RIM_POINTS))))
    return corners, edges


def obstacle_outlines(world, low=FLOOR, high=ROBOT_HEIGHT):
    """Return the outlines of all that a robot can bump into in a world, planes apart, where the world file puts it."""
    stored = {entry.name: entry for entry in world.state.models} if world.state is not None else {}
    outlines = []
    for model in world.models:
        entry = stored.get(model.name)
        placed = {name: pose for name, pose, _ in entry.links if pose is not None} if entry is not None else {}
        model_pose = entry.pose if entry is not None and entry.pose is not None else model.pose
        for link in model.links:
            link_pose = placed.get(link.name) or compose(model_pose, link.pose)
            for collision in link.collisions:
                if not collision.surface.collide_bitmask or collision.surface.collide_without_contact:
                    continue
                outlines.append(outline_of(collision.geometry, compose(link_pose, collision.pose), low, high,
                                           model.name))
    return [outline for outline in outlines if outline is not None]


# ---- clearance ---------------------------------------------------------------------------------------------------

def _to_segments(points, ends):
    """Return the least distance (...) of points (..., p, 2) from the edges of closed polygons (..., m, 2)."""
    begins, along = ends[..., None, :, :], (np.roll(ends, -1, axis=-2) - ends)[..., None, :, :]
    offset = points[..., :, None, :] - begins
    share = np.sum(offset * along, axis=-1) / np.maximum(np.sum(along * along, axis=-1), 1e-300)
    nearest = offset - np.clip(share, 0.0, 1.0)[..., None] * along
    return np.sqrt(np.min(np.sum(nearest * nearest, axis=-1), axis=(-2, -1)))


def _separation(polygons, points):
    """Return how far (...) points (..., p, 2) stay outside of polygons (..., m, 2), by the best of their edges."""
    if polygons.shape[-2] == 1:     # no edge, nothing to show
        return np.full(polygons.shape[:-2], -np.inf)
    along = np.roll(polygons, -1, axis=-2) - polygons
    normals = np.stack((along[..., 1], -along[..., 0]), axis=-1)
    normals = normals / np.sqrt(np.sum(normals * normals, axis=-1, keepdims=True))
    gaps = np.sum(normals[..., :, None, :] * (points[..., None, :, :] - polygons[..., :, None, :]), axis=-1)
    return np.max(np.min(gaps, axis=-1), axis=-1)


def _polygon_distances(one, two):
    """Return distances (n,) of convex polygons (m, 2) and (n, k, 2), 0 where they overlap."""
    one = np.broadcast_to(one, two.shape[:1] + one.shape)
    distances = np.minimum(_to_segments(one, two), _to_segments(two, one))
    # corners alone miss two bars that cross; convex bodies are apart only if an edge of one of them shows it
    apart = np.maximum(_separation(one, two), _separation(two, one))
    overlap = (apart < -1e-12) & (apart > -np.inf)
    return np.where(overlap, 0.0, distances)


def footprint_distances(poses, obstacle, footprint=M2WR_FOOTPRINT):
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


def _point_distances(points, obstacle):
    """Return distances (n,) of points (n, 2) from an outline, 0 inside."""
    points, vertices = points[:, None, :], obstacle.vertices[None]
    outside = _separation(vertices, points) > 0.0 if len(obstacle.vertices) > 2 else True
    return np.where(outside, np.maximum(_to_segments(points, vertices) - obstacle.radius, 0.0), 0.0)


def least_clearance(poses, obstacles, footprint=M2WR_FOOTPRINT):
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
    origin = [_point_distances(poses[:, :2], obstacle) for obstacle in obstacles]
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


# ---- summary -----------------------------------------------------------------------------------------------------

def summarise(log, world, footprint=M2WR_FOOTPRINT):
    """Return the :class:`Summary` of a run in a world; obstacles stand where the world file puts them.

    Parameters
    ----------
    log : m2wr_sim.report.run_log.RunLog
        The run.
    world : m2wr_sim.model.types.World
        The world it took place in.
    footprint : sequence of Outline
        The robot from above, in the frame of link_chassis.
    """
    path_length = end_distance = duration = clearance = time = position = straight = None
    name, start = "", log.start
    final_state = log.states[-1][1] if log.states else None
    if log.times is not None and len(log.times):
        start = start or (log.x[0], log.y[0])
        path_length = float(np.sum(np.hypot(np.diff(log.x), np.diff(log.y))))
        end = log.states[-1][0] if final_state in ("goal_reached", "goal_unreachable") else log.times[-1]
        duration = max(0.0, float(end - log.times[0]))
        closest = least_clearance(np.column_stack((log.x, log.y, log.yaw)), obstacle_outlines(world), footprint)
        clearance, name = closest.distance, closest.name
        if closest.index is not None:
            time = float(log.times[closest.index] - log.times[0])
            position = (float(log.x[closest.index]), float(log.y[closest.index]))
        if log.goal is not None:
            end_distance = math.hypot(log.goal[0] - log.x[-1], log.goal[1] - log.y[-1])
    if start is not None and log.goal is not None:
        straight = math.hypot(log.goal[0] - start[0], log.goal[1] - start[1])
    return Summary(path_length, straight, end_distance, duration, clearance, time, position, name,
                   len(log.states) - 1 if log.states else None, final_state, log.touches, log.mean_factor)


def format_table(summary):
    """Return the summary as text: one line for each value, what was not recorded named as such."""
    length, clearance = _text("%.2f m", summary.path_length), _text("%.3f m", summary.least_clearance)
    if summary.path_length is not None and summary.straight_distance:
        length += " (%.2f times the straight line)" % (summary.path_length / summary.straight_distance)
    if summary.clearance_position is not None:
        clearance += " to %s, at (%.2f, %.2f) after %.1f s" % (
            (summary.clearance_name or "an obstacle",) + summary.clearance_position + (summary.clearance_time,))
    elif summary.least_clearance == math.inf:
        clearance = "no obstacles in the world"
    rows = (("outcome", (summary.final_state or "not recorded").replace("_", " ")),
            ("simulated time", _text("%.1f s", summary.duration)),
            ("path length", length),
            ("start to goal, straight", _text("%.2f m", summary.straight_distance)),
            ("distance to goal at the end", _text("%.2f m", summary.end_distance)),
            ("least clearance", clearance),
            ("state changes", _text("%d", summary.state_changes)),
            ("touches", _text("%d", summary.touches)),
            ("mean real-time factor", _text("%.2f", summary.mean_factor)))
    width = max(len(name) for name, _ in rows)
    return "\n".join("%-*s  %s" % (width, name, value) for name, value in rows)


def _text(form, value):
    return "not recorded" if value is None else form % value
