# SPDX-License-Identifier: BSD-3-Clause
"""Reads the body of a robot from its description: footprint, axle, laser."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, List, Sequence, Tuple

import numpy as np

from m2wr_navigation.methods.body import RobotBody, boxes_of
from m2wr_sim.geometry import compose, matrix_from_quaternion, yaw_of
from m2wr_sim.model.outlines import outlines_of
from m2wr_sim.model.types import Box, Cylinder, Mesh, Sphere
from m2wr_view.mesh_outlines import hull_outline
from m2wr_view.outlines import Outline, convex_hull, point_distances

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.types import Model

    Shape = Tuple[object, Pose]

TALL = 1e3                  # m: higher than any robot
THIN = 1e-3                 # m: half height of the slice that the laser sees
DIGITS = 4                  # of a corner: the rim of a lying wheel becomes a rectangle
_WHEELS = ("leftJoint", "rightJoint", "left_joint", "right_joint", "leftFrontJoint", "rightFrontJoint",
           "leftRearJoint", "rightRearJoint")
_LASERS = ("ray", "gpu_ray")


def body_of(model: Model) -> RobotBody:
    """Return the body of a robot in the frame of its model.

    The axle is the middle of the wheels that a plugin drives, and the model's origin without one. Meshes are not
    part of the footprint.

    Parameters
    ----------
    model : Model

    Raises
    ------
    ValueError
        If the robot has no laser, or no shape that collides.
    """
    shapes = _shapes(model)
    footprint = _slice(shapes, -TALL, TALL)
    if not footprint:
        raise ValueError("robot {} has no shape that collides; expected its body".format(model.name))
    (x, y, height), orientation = _laser_pose(model)
    seen = [part for part in _slice(shapes, height - THIN, height + THIN)
            if point_distances(np.array([(x, y)]), part)[0] > 0.0]         # a laser does not see its own housing
    return RobotBody(tuple(footprint), _axle_x(model), (x, y, yaw_of(orientation)), boxes_of(seen), _height(shapes))


def laser_height(model: Model) -> float:
    """Return the height of a robot's first laser above the lowest point that collides [m].

    Parameters
    ----------
    model : Model

    Raises
    ------
    ValueError
        If the robot has no laser.
    """
    (_, _, height), _ = _laser_pose(model)
    return float(height - _extent(_shapes(model))[0])


def _shapes(model: Model) -> List[Shape]:
    """Return the shapes that collide, and their poses in the frame of the model."""
    return [(collision.geometry, compose(link.pose, collision.pose))
            for link in model.links for collision in link.collisions]


def _height(shapes: Sequence[Shape]) -> float:
    """Return the height of what collides [m], rounded up to a centimetre: from its lowest to its highest point."""
    low, high = _extent(shapes)
    return math.ceil(100.0 * (high - low) - 1e-6) / 100.0


def _extent(shapes: Sequence[Shape]) -> Tuple[float, float]:
    """Return the heights of the lowest and of the highest point of shapes [m]."""
    low, high = math.inf, -math.inf
    for geometry, (centre, orientation) in shapes:
        upwards = matrix_from_quaternion(orientation)[2]
        if isinstance(geometry, Sphere):
            half = geometry.radius
        elif isinstance(geometry, Box):
            half = 0.5 * float(np.abs(upwards) @ geometry.size)
        elif isinstance(geometry, Cylinder):
            half = 0.5 * geometry.length * abs(upwards[2]) + geometry.radius * math.hypot(upwards[0], upwards[1])
        elif isinstance(geometry, Mesh):
            heights = geometry.vertices @ upwards + centre[2]
            low, high = min(low, float(heights.min())), max(high, float(heights.max()))
            continue
        else:
            continue
        low, high = min(low, centre[2] - half), max(high, centre[2] + half)
    return low, high


def _slice(shapes: Sequence[Shape], low: float, high: float) -> List[Outline]:
    """Return the outlines of the parts of shapes between two heights [m]."""
    outlines = [outline for geometry, pose in shapes for outline in _outlines(geometry, pose, low, high)]
    return [Outline(convex_hull(np.round(outline.vertices, DIGITS)), outline.radius) for outline in outlines]


def _outlines(geometry: Any, pose: Pose, low: float, high: float) -> List[Outline]:
    """Return the outlines of a shape; of a mesh its convex hull, as costmaps take of a footprint."""
    if not isinstance(geometry, Mesh):
        return outlines_of(geometry, pose, low, high)
    points = geometry.vertices @ matrix_from_quaternion(pose[1]).T + pose[0]
    hull = hull_outline(points, geometry.triangles.astype(np.int64), low, high)
    return [] if hull is None else [hull]


def _laser_pose(model: Model) -> Pose:
    """Return the pose of the first laser in the model; ValueError if there is none."""
    for link in model.links:
        for sensor in link.sensors:
            if sensor.kind in _LASERS:
                return compose(link.pose, sensor.pose)
    raise ValueError("robot {} has no sensor of type ray; expected a laser".format(model.name))


def _axle_x(model: Model) -> float:
    """Return the mean x of the joints that plugins drive [m]."""
    joints = {joint.name: joint for joint in model.joints}
    poses: Dict[str, Pose] = {link.name: link.pose for link in model.links}
    driven = {text for plugin in model.plugins for tag, text in plugin.parameters if tag in _WHEELS}
    places = [compose(poses[joints[name].child], joints[name].pose)[0][0] for name in sorted(driven) if name in joints]
    return float(np.mean(places)) if places else 0.0
