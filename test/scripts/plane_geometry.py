# SPDX-License-Identifier: BSD-3-Clause
"""Expected laser ranges among upright boxes, from plane geometry; shares no code with the simulator.

Boxes stand on the floor and are taller than the laser's height, so the world is a plane of rectangles.
"""
import math
import xml.etree.ElementTree as ElementTree
from collections import namedtuple

import numpy as np

Rectangle = namedtuple("Rectangle", "x y yaw length width")
"""Centre [m], heading [rad], size along and across the heading [m]."""

#: The laser, and the axle of the wheels, in the frame of link_chassis [m].
LASER_X = 0.15
AXLE_X = -0.05
#: The robot seen from above, in the frame of link_chassis: rectangles (x, y, length, width), discs (x, y, radius) [m].
BODY_RECTANGLES = ((0.0, 0.0, 0.5, 0.3), (-0.05, 0.2, 0.2, 0.04), (-0.05, -0.2, 0.2, 0.04))
BODY_DISCS = ((0.35, 0.0, 0.05),)


def read_boxes(path):
    """Return the rectangles of a world file whose models are single boxes.

    Raises
    ------
    ValueError
        If the file holds no box, so that no test compares with an empty plane by mistake.
    """
    found = []
    for model in ElementTree.parse(path).getroot().iter("model"):
        pose = [float(word) for word in model.find("pose").text.split()]
        size = [float(word) for word in model.find("link/collision/geometry/box/size").text.split()]
        found.append(Rectangle(pose[0], pose[1], pose[5], size[0], size[1]))
    if not found:
        raise ValueError("%s: no model with a box; expected at least one" % path)
    return found


def into_frame(points, x, y, yaw):
    """Return points (..., 2) in the frame at ``x``, ``y``, ``yaw``."""
    delta = np.asarray(points, dtype=float) - (x, y)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.stack((cosine * delta[..., 0] + sine * delta[..., 1], cosine * delta[..., 1] - sine * delta[..., 0]), -1)


def ray_distances(origin, directions, rectangles):
    """Return the distance [m] from ``origin`` to the first rectangle in each direction; inf where there is none.

    Parameters
    ----------
    origin : (float, float)
        Outside all rectangles [m].
    directions : (B,) float64
        In the frame of the plane [rad].
    rectangles : list of Rectangle

    Returns
    -------
    (B,) float64

    Notes
    -----
    Clips the ray against the pairs of parallel sides of each rectangle, in the rectangle's own frame.
    """
    nearest = np.full(len(directions), math.inf)
    for rectangle in rectangles:
        start = into_frame(origin, rectangle.x, rectangle.y, rectangle.yaw)
        half = np.array((rectangle.length, rectangle.width)) / 2.0
        turned = directions - rectangle.yaw
        way = np.stack((np.cos(turned), np.sin(turned)), -1)
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (-half - start) / way, (half - start) / way
        enter = np.max(np.minimum(first, second), axis=1)
        leave = np.min(np.maximum(first, second), axis=1)
        hit = (enter <= leave) & (enter > 0.0)
        nearest[hit] = np.minimum(nearest[hit], enter[hit])
    return nearest


def scan(pose, angles, rectangles, range_max=10.0):
    """Return what the laser reads without noise at ``pose`` (x, y, yaw of link_chassis); inf beyond ``range_max``."""
    x, y, yaw = pose
    origin = (x + LASER_X * math.cos(yaw), y + LASER_X * math.sin(yaw))
    ranges = ray_distances(origin, np.asarray(angles) + yaw, rectangles)
    ranges[ranges > range_max] = math.inf
    return ranges


def outline(pose, spacing=0.01):
    """Return points (N, 2) along the border of the robot, seen from above, at ``pose`` (x, y, yaw)."""
    parts = []
    for x, y, length, width in BODY_RECTANGLES:
        corners = np.array([(x + a * length / 2, y + b * width / 2) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
        for corner, following in zip(corners, np.roll(corners, -1, axis=0)):
            count = int(math.ceil(np.hypot(*(following - corner)) / spacing))
            parts.append(corner + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (following - corner))
    for x, y, radius in BODY_DISCS:
        turn = np.linspace(0.0, 2 * math.pi, int(math.ceil(2 * math.pi * radius / spacing)), endpoint=False)
        parts.append(np.stack((x + radius * np.cos(turn), y + radius * np.sin(turn)), -1))
    local = np.concatenate(parts)
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    return np.stack((pose[0] + cosine * local[:, 0] - sine * local[:, 1],
                     pose[1] + sine * local[:, 0] + cosine * local[:, 1]), -1)


def distance(points, rectangles):
    """Return the least distance [m] between points (N, 2) and the rectangles; negative inside one."""
    least = math.inf
    for rectangle in rectangles:
        local = np.abs(into_frame(points, rectangle.x, rectangle.y, rectangle.yaw))
        out = local - np.array((rectangle.length, rectangle.width)) / 2.0
        apart = np.hypot(*np.maximum(out, 0.0).T) + np.minimum(np.max(out, axis=1), 0.0)
        least = min(least, float(np.min(apart)))
    return least


def clearance(pose, rectangles):
    """Return the least distance [m] between the robot's outline at ``pose`` and the rectangles; negative inside one."""
    return distance(outline(pose), rectangles)


def axle(pose):
    """Return the (x, y) [m] of the middle of the wheels' axle, about which the robot rotates."""
    return pose[0] + AXLE_X * math.cos(pose[2]), pose[1] + AXLE_X * math.sin(pose[2])


def drive(pose, linear_x, angular_z, seconds):
    """Return the pose after a command has been held; exact: the axle follows a straight line or an arc."""
    x, y = axle(pose)
    turn = angular_z * seconds
    chord = linear_x * seconds * (math.sin(turn / 2) / (turn / 2) if turn else 1.0)
    x, y = x + chord * math.cos(pose[2] + turn / 2), y + chord * math.sin(pose[2] + turn / 2)
    yaw = pose[2] + turn
    return x - AXLE_X * math.cos(yaw), y - AXLE_X * math.sin(yaw), yaw
