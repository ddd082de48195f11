# SPDX-License-Identifier: BSD-3-Clause
"""Check of a place by occlusion: rays of new and old scans must not end behind surfaces that the others have seen."""
from __future__ import annotations

from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_gmapping.backend.place_query import placed
from m2wr_gmapping.backend.place_search import WIDE_PATH
from m2wr_gmapping.se2 import between, compose

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray, IndexArray
    from m2wr_gmapping.backend.place_search import Scene

OCCLUSION_MARGIN = 0.4        # a ray conflicts with a surface if it ends this much behind it [m]
LOOKS = 3                   # scans of the query that are compared; of the old ones four times as many


def occlusion_conflict(scene: Scene, pose: FloatArray, around: IndexArray) -> float:
    """Return the share of end points that conflict with rays, of new and old scans, among those in view.

    A ray conflicts with an end point if it ends behind it.

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
    wanted = scene.along[-1] - np.linspace(0.0, WIDE_PATH, LOOKS)
    nodes = np.unique(np.clip(np.searchsorted(scene.along, wanted), 0, len(path) - 1))
    through = total = 0
    for moved, node in zip(compose(pose, between(path[-1], path[nodes])), nodes):
        for other in around[:4 * LOOKS:4]:
            for eye, seen, reading, others in ((moved, path[other], readings[node], readings[other]),
                                               (path[other], moved, readings[other], readings[node])):
                a, b = _through(reading.rays, between(eye, seen), others.points)
                through, total = through + a, total + b
    return through / max(1, total)


def _through(rays: FloatArray, seen: FloatArray, points: FloatArray) -> Tuple[int, int]:
    """Count the points (2, B) of a scan at pose ``seen`` that the rays (2, S) pass through, and the points in view."""
    if rays.shape[1] < 2:
        return 0, 0
    angle, reach = np.arctan2(rays[1], rays[0]), np.hypot(rays[0], rays[1])
    order = np.argsort(angle, kind="stable")
    angle, reach = angle[order], reach[order]
    x, y = placed(seen, points)
    at, far = np.arctan2(y, x), np.hypot(x, y)
    after = np.searchsorted(angle, at)
    inside = (after > 0) & (after < len(angle))
    at, far, after = at[inside], far[inside], after[inside]
    gap = angle[after] - angle[after - 1]
    least = np.minimum(reach[after], reach[after - 1])
    beside = gap < 2.5 * np.median(np.diff(angle))
    through, in_view = far + OCCLUSION_MARGIN < least, far < least + OCCLUSION_MARGIN
    return int((beside & through).sum()), int((beside & in_view).sum())
