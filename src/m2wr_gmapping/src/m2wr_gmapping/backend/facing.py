# SPDX-License-Identifier: BSD-3-Clause
"""Check of a place by the sides of surfaces: a wall seen from one side is not the wall seen from the other.

Where a robot comes round a wall, its new face fits the old one best if the robot is shifted by the wall's thickness. No
ray passes through anything then, so occlusion tells nothing.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_gmapping.backend.place_query import placed
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.tuning import SEARCH

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray, IndexArray
    from m2wr_gmapping.backend.place_search import Scene
    from m2wr_gmapping.frontend.scan import ScanReading


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
    cell = SEARCH.cells[0]
    corner = np.minimum(points.min(axis=1), old_points.min(axis=1)) - 2.0 * cell
    size = ((np.maximum(points.max(axis=1), old_points.max(axis=1)) - corner) / cell).astype(np.int64) + 3
    column, row = ((old_points - corner[:, None]) / cell).astype(np.int64)
    sums = (np.bincount(row * size[0] + column, weights, size[0] * size[1]).astype(np.float64)
            for weights in (old_normals[0], old_normals[1], np.ones(len(row))))
    x, y, count = (_with_neighbours(cells.reshape(size[::-1])) for cells in sums)
    column, row = ((points - corner[:, None]) / cell).astype(np.int64)
    x, y, count = x[row, column], y[row, column], count[row, column]
    seen = (count > 0.0) & (np.hypot(x, y) > 0.5 * count)
    opposite = seen & (normals[0] * x + normals[1] * y < 0.0)
    return float(np.count_nonzero(opposite)) / max(1, int(np.count_nonzero(seen)))


def _surface(reading: ScanReading, pose: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Return end points (2, M) [m] and normals (2, M) towards the laser, of a scan at a pose."""
    beams = reading.beams
    points, normals = beams[[mk.QX, mk.QY]], beams[[mk.NX, mk.NY]]
    normals = np.where((points * normals).sum(axis=0) > 0.0, -normals, normals)
    return np.array(placed(pose, points)), np.array(placed([0.0, 0.0, pose[2]], normals))


def _with_neighbours(cells: FloatArray) -> FloatArray:
    """Return the sums (H, W) of each cell and the eight around it."""
    sums = cells.copy()
    sums[1:] += cells[:-1]
    sums[:-1] += cells[1:]
    found = sums.copy()
    found[:, 1:] += sums[:, :-1]
    found[:, :-1] += sums[:, 1:]
    return found
