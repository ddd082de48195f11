# SPDX-License-Identifier: BSD-3-Clause
"""The query of a place search: end points of the newest scans, placed in one frame and thinned."""
from __future__ import annotations

from typing import Tuple

import numpy as np

from m2wr_gmapping.backend.route import Route
from m2wr_gmapping.frontend import correlative_kernels as ck
from m2wr_gmapping.tuning import SEARCH
from m2wr_node.array_types import FloatArray, IndexArray, Vector


def query_points(route: Route, reach: float) -> FloatArray:
    """Return end points of the scans on the last ``reach`` metres of the path, in the newest node's frame.

    Points far beyond the path are left out, which limits the raster of a search.

    Parameters
    ----------
    route : Route
    reach : float
        Length of the path whose scans are used [m].

    Returns
    -------
    (2, Q) float64
    """
    path, along, readings = route.path, route.along, route.readings
    first = int(np.searchsorted(along, along[-1] - reach))
    points = np.empty((2, sum(readings[node].points.shape[1] for node in range(first, len(path)))))
    away, count = max(reach, SEARCH.reach), 0
    for node in range(len(path) - 1, first - 1, -1):
        count = ck.add_points(path[-1], path[node], readings[node].points, away, points, count)
    return points[:, :count]


def few_points(points: FloatArray) -> FloatArray:
    """Return few of the points for a wide search, evenly distributed over the area that was seen.

    Parameters
    ----------
    points : (2, Q) float64
        Points [m].

    Returns
    -------
    (2, M) float64
    """
    return thinned(points[:, spread_first(points, SEARCH.spacing)], SEARCH.points)


def evenly(nodes: IndexArray, most: int) -> IndexArray:
    """Return at most ``most`` of the nodes, evenly distributed.

    Parameters
    ----------
    nodes : (C,) int64
    most : int
    """
    return nodes[::max(1, -(-len(nodes) // most))]


def placed(pose: Vector, points: FloatArray) -> Tuple[FloatArray, FloatArray]:
    """Transform points from the frame ``pose`` into its parent frame.

    Parameters
    ----------
    pose : (3,) array_like
        Pose of the frame [m, m, rad].
    points : (2, Q) float64
        Points in the frame [m].

    Returns
    -------
    x, y : (Q,) float64
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return pose[0] + c * points[0] - s * points[1], pose[1] + s * points[0] + c * points[1]


def thinned(points: FloatArray, count: int) -> FloatArray:
    """Return about ``count`` of the points, evenly distributed.

    Parameters
    ----------
    points : (R, Q) float64
        Points in columns.
    count : int
        Wanted number.

    Returns
    -------
    (R, M) float64
    """
    return np.ascontiguousarray(points[:, ::max(1, points.shape[1] // count)])


def spread_first(points: FloatArray, spacing: float) -> IndexArray:
    """Return the index of one point in each cell, so that areas that were seen often count once.

    Parameters
    ----------
    points : (2, Q) float64
        Points [m].
    spacing : float
        Cell size [m].

    Returns
    -------
    (M,) int64
    """
    cells = np.floor(points / spacing).astype(np.int64)
    _, first = np.unique(cells[0] * 100003 + cells[1], return_index=True)
    return np.sort(first)
