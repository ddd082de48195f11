# SPDX-License-Identifier: BSD-3-Clause
"""Checks of a place: no scan may look through a wall that another one saw, nor see its other side.

Rays tell of the former. The latter needs the sides of surfaces: where a robot comes round a wall, its new face fits the
old one best if the robot is shifted by the wall's thickness, and no ray passes through anything then.
"""
from __future__ import annotations

from typing import Tuple

import numpy as np

from m2wr_gmapping.backend.place_query import placed
from m2wr_gmapping.backend.place_search import Scene
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.occlusion import conflict_of
from m2wr_gmapping.frontend.scan import ScanReading
from m2wr_gmapping.tuning import LINKS, OCCLUSION, SEARCH
from m2wr_maps.se2 import between, compose
from m2wr_node.array_types import FloatArray, IndexArray


def is_contradicted(scene: Scene, pose: FloatArray, around: IndexArray) -> bool:
    """Return whether scans look through walls of one another at a place, or see walls from both sides as one.

    Parameters
    ----------
    scene, pose, around
        As for :func:`occlusion_conflict`.
    """
    return (occlusion_conflict(scene, pose, around) > OCCLUSION.most_conflict
            or opposite_share(scene, pose, around) > OCCLUSION.most_conflict)


def occlusion_conflict(scene: Scene, pose: FloatArray, around: IndexArray) -> float:
    """Return the share of end points that conflict with rays, of new and old scans, among those in view.

    Parameters
    ----------
    scene : Scene
        The path and its drift.
    pose : (3,) float64
        Assumed pose of the newest scan; the scans before it move with it.
    around : (A,) int64
        Old nodes.

    Returns
    -------
    float
    """
    path, readings = scene.path, scene.readings
    wanted = scene.along[-1] - np.linspace(0.0, SEARCH.path, LINKS.looks)
    nodes = np.unique(np.clip(np.searchsorted(scene.along, wanted), 0, len(path) - 1))
    moved = compose(pose, between(path[-1], path[nodes]))
    return conflict_of((here, readings[node], path[other], readings[other])
                       for here, node in zip(moved, nodes) for other in around[:4 * LINKS.looks:4]).share


def opposite_share(scene: Scene, pose: FloatArray, around: IndexArray) -> float:
    """Return the share of the newest end points on surfaces that old scans saw from the other side.

    Counted are end points where old scans saw a surface, most of it from one side. At a right place they are those on
    walls thinner than a cell.

    Parameters
    ----------
    scene : Scene
        The path and its scans.
    pose : (3,) float64
        Assumed pose of the newest scan [m, m, rad].
    around : (A,) int64
        Old nodes, at least one.

    Returns
    -------
    float
    """
    points, normals = _surface(scene.readings[-1], pose)
    old = [_surface(scene.readings[node], scene.path[node]) for node in around]
    old_points, old_normals = (np.concatenate(parts, axis=1) for parts in zip(*old))
    if not points.size or not old_points.size:
        return 0.0
    x, y, count = _sums_around(points, old_points, np.vstack([old_normals, np.ones(old_points.shape[1])]))
    seen = (count > 0.0) & (np.hypot(x, y) > 0.5 * count)
    opposite = seen & (normals[0] * x + normals[1] * y < 0.0)
    return float(np.count_nonzero(opposite)) / max(1, int(np.count_nonzero(seen)))


def _surface(reading: ScanReading, pose: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Return end points (2, M) [m] and normals (2, M) towards the laser, of a scan at a pose."""
    beams = reading.beams
    points, normals = beams[[mk.QX, mk.QY]], beams[[mk.NX, mk.NY]]
    normals = np.where((points * normals).sum(axis=0) > 0.0, -normals, normals)
    return np.array(placed(pose, points)), np.array(placed([0.0, 0.0, pose[2]], normals))


def _sums_around(points: FloatArray, old_points: FloatArray, values: FloatArray) -> FloatArray:
    """Return the sums (V, M) of the values (V, B) of old points (2, B) in the cell of each point (2, M) and around it.

    Cells without a point are not stored: the end points of a laser of 80 m are far apart.
    """
    corner = np.minimum(points.min(axis=1), old_points.min(axis=1)) - SEARCH.cells[0]
    (column, row), (old_column, old_row) = (((these - corner[:, None]) / SEARCH.cells[0]).astype(np.int64)
                                            for these in (points, old_points))
    width = int(max(column.max(), old_column.max())) + 2
    cells, index = np.unique(old_row * width + old_column, return_inverse=True)
    sums = np.array([np.bincount(index, row_of) for row_of in values])
    around = (row * width + column)[:, None] + np.add.outer([-width, 0, width], [-1, 0, 1]).ravel()
    found = np.minimum(np.searchsorted(cells, around), len(cells) - 1)
    return (sums[:, found] * (cells[found] == around)).sum(axis=2)
