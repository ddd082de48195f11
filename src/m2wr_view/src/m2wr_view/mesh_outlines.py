# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of meshes from above: what of their surface stands in the way of a robot.

A mesh collides by its surface, as in the engine: nothing is known of its inside. A part (triangles that share corners)
whose surface is convex gives one outline. Of any other part each triangle gives one, and walls in one line become one
line. Ground is no obstacle, as planes and heightmaps are none: triangles of a surface that faces up everywhere, up to a
slope of :data:`STEEPEST`.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, List, Optional, Tuple

import numpy as np

from m2wr_view.outlines import FLOOR, ROBOT_HEIGHT, Outline, slice_from_above, triangle_outlines

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray

#: Slope of ground [rad]: on a steeper one a wheel with the usual friction coefficient of 1 slides (Coulomb).
STEEPEST = math.radians(45.0)
MERGE = 1e-5            # m: corners of triangles nearer than this are one; files keep coordinates in single precision
FLAT = 1e-4             # m by which a corner may stand out of a face of a convex part
_SAME_ANGLE = 1e-4      # rad between lines that are one: FLAT over 1 m
MOST_TESTS = 20_000_000     # of corners against faces, 160 MB: a part with more is not tested, and taken as not convex


def mesh_outlines(vertices: FloatArray, triangles: IndexArray, low: float = FLOOR, high: float = ROBOT_HEIGHT,
                  name: str = "") -> List[Outline]:
    """Return the outlines of the parts of a mesh between two heights, without ground.

    Parameters
    ----------
    vertices : (n, 3) float64
        In world [m].
    triangles : (m, 3) int
        Indices of corners, counter-clockwise seen from outside.
    low, high : float
        Heights of the slice [m].
    name : str
        Of the model.
    """
    found: List[Outline] = []
    if not len(triangles):
        return found
    keys, which = np.unique(np.round(vertices / MERGE), axis=0, return_inverse=True)
    points, triangles = keys * MERGE, which.reshape(-1)[triangles]
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    whole = areas > MERGE ** 2
    triangles, corners, normals = triangles[whole], corners[whole], normals[whole] / areas[whole, None]
    part_of = _parts(triangles, len(points))[triangles[:, 0]] if len(triangles) else np.zeros(0, int)
    order = np.argsort(part_of, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(part_of[order])) + 1):
        found += _part_outlines(corners[part], normals[part], low, high, name)
    return found


def hull_outline(vertices: FloatArray, triangles: IndexArray, low: float = FLOOR, high: float = ROBOT_HEIGHT,
                 name: str = "") -> Optional[Outline]:
    """Return the convex hull of the part of a mesh between two heights, or None if there is none.

    Parameters
    ----------
    vertices : (n, 3) float64
        In world [m].
    triangles : (m, 3) int
        Indices of corners.
    low, high : float
        Heights of the slice [m].
    name : str
        Of the model.
    """
    if not len(triangles):
        return None
    edges = np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    corners = slice_from_above(vertices, edges, low, high)
    return None if corners is None else Outline(corners, 0.0, name)


def _parts(triangles: IndexArray, count: int) -> IndexArray:
    """Return a label for each of `count` corners: the least corner that triangles connect with it."""
    label = np.arange(count)
    while True:
        least = label[triangles].min(axis=1)
        lower = label.copy()
        for corner in range(3):
            np.minimum.at(lower, label[triangles[:, corner]], least)    # the root of the corner's tree joins, too
            np.minimum.at(lower, triangles[:, corner], least)
        lower = lower[lower]
        if np.array_equal(lower, label):
            return label
        label = lower


def _part_outlines(corners: FloatArray, normals: FloatArray, low: float, high: float, name: str) -> List[Outline]:
    """Return the outlines of a connected part: its triangles (k, 3, 3) and their unit normals (k, 3)."""
    heights = corners[..., 2]
    if not len(corners) or heights.max() <= low or heights.min() >= high:
        return []
    ground = np.abs(normals[:, 2]) > math.cos(STEEPEST)
    sheet = bool(normals[:, 2].min() >= -FLAT or normals[:, 2].max() <= FLAT)      # seen from one side only
    if sheet and ground.all():
        return []
    if _is_convex(corners, normals):
        hull = hull_outline(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), low, high, name)
        return [] if hull is None else [hull]
    return _joined(triangle_outlines(corners[~ground] if sheet else corners, low, high, name), name)


def _is_convex(corners: FloatArray, normals: FloatArray) -> bool:
    """Return whether all corners are behind all faces; they are not if the surface faces inwards, as of a room."""
    points = np.unique(corners.reshape(-1, 3), axis=0)
    if len(points) * len(corners) > MOST_TESTS:
        return False
    out = normals.dot(points.T) - np.sum(normals * corners[:, 0], axis=1)[:, None]
    return bool(out.max() < FLAT)


def _joined(outlines: List[Outline], name: str) -> List[Outline]:
    """Return outlines with those among them that lie on each other, or end to end, in one line as one."""
    areas: List[Outline] = []
    lines: Dict[Tuple[int, int], List[Tuple[float, float, float, float]]] = {}
    for outline in outlines:
        # along the longest side from the first corner; a wall from above has no width
        offsets = outline.vertices - outline.vertices[0]
        along = offsets[np.argmax(np.sum(offsets * offsets, axis=1))]
        length = math.hypot(*along)
        if length < MERGE:
            continue                        # a corner of a triangle that only reaches the border of the slice
        along = along / length * (1.0 if (along[0], along[1]) > (0.0, 0.0) else -1.0)
        across = np.array((-along[1], along[0]))
        if np.ptp(offsets.dot(across)) > MERGE:
            areas.append(outline)
            continue
        at, reach = float(outline.vertices[0].dot(across)), outline.vertices.dot(along)
        key = (round(math.atan2(along[1], along[0]) / _SAME_ANGLE), round(at / FLAT))
        lines.setdefault(key, []).append((float(reach.min()), float(reach.max()), math.atan2(along[1], along[0]), at))
    return areas + [line for parts in lines.values() for line in _merged(parts, name)]


def _merged(parts: List[Tuple[float, float, float, float]], name: str) -> List[Outline]:
    """Return the lines that parts (begin, end [m], angle [rad], distance [m]) of one straight line make."""
    spans: List[List[float]] = []
    for begin, end, _, _ in sorted(parts):
        if spans and begin <= spans[-1][1] + FLAT:
            spans[-1][1] = max(spans[-1][1], end)
        else:
            spans.append([begin, end])
    angle, at = parts[0][2:]
    along, across = np.array((math.cos(angle), math.sin(angle))), np.array((-math.sin(angle), math.cos(angle)))
    return [Outline(np.array([begin * along + at * across, end * along + at * across]), 0.0, name)
            for begin, end in spans]
