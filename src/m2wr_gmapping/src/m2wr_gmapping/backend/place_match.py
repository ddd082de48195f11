# SPDX-License-Identifier: BSD-3-Clause
"""Fine match of the newest scans at the result of a search, and the information that the match supports."""
from __future__ import annotations

import math
from typing import Optional, Tuple

import numpy as np

from m2wr_gmapping.backend.place_query import placed, spread_first, thinned
from m2wr_gmapping.backend.place_search import Scene
from m2wr_gmapping.filter.tile_maps import NEVER, TileMaps
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.matcher import NARROW, FastMatcher
from m2wr_gmapping.tuning import LINKS, MATCHING, SEARCH
from m2wr_maps.se2 import between, compose
from m2wr_node.array_types import FloatArray, IndexArray

PROBE_STEP = math.sqrt(NARROW)          # shift by which a match is tested for observability [m]
RISE = 0.25 * NARROW * (1.0 - LINKS.weight)     # expected rise of the cost there per unit of information, times 1/2
PINNED = 1e12               # information that fixes a pose


#: Nearest old node, result row (13,), old nodes (A,) of the map, supported information (6,).
FineMatch = Tuple[int, FloatArray, IndexArray, FloatArray]


def merged_beams(scene: Scene, reach: float) -> FloatArray:
    """Return the beams of the scans of the last ``reach`` metres of path, seen from the newest node.

    Parameters
    ----------
    scene : Scene
        The path and its drift.
    reach : float
        Length of the path whose scans are used [m].

    Returns
    -------
    (7, M) float64
        In the layout of ``match_kernels``.
    """
    path, along, parts = scene.path, scene.along, []
    for node in range(len(path) - 1, -1, -1):
        if along[-1] - along[node] > reach:
            break
        beams, pose = scene.readings[node].beams.copy(), between(path[-1], path[node])
        beams[[mk.QX, mk.QY]] = placed(pose, beams[[mk.QX, mk.QY]])
        beams[[mk.NX, mk.NY]] = placed([0.0, 0.0, pose[2]], beams[[mk.NX, mk.NY]])
        parts.append(beams[:, np.square(beams[[mk.QX, mk.QY]]).sum(axis=0) < SEARCH.reach**2])
    beams = np.concatenate(parts, axis=1)
    beams = thinned(beams[:, spread_first(beams[[mk.QX, mk.QY]], SEARCH.cells[0])], SEARCH.points)
    qx, qy, nx, ny = beams[[mk.QX, mk.QY, mk.NX, mk.NY]]
    beams[mk.ARM_N], beams[mk.ARM_T] = ny * qx - nx * qy, nx * qx + ny * qy
    return beams


def fine_match(matcher: FastMatcher, resolution: float, scene: Scene, old: IndexArray, pose: FloatArray,
               reach: float = 0.0) -> Optional[FineMatch]:
    """Match the newest scan, or those of a segment, near ``pose`` in a map of the old nodes around it.

    Parameters
    ----------
    matcher : FastMatcher
        The scan matcher.
    resolution : float
        Cell size of the map [m].
    scene : Scene
        The path and its drift.
    old : (C,) int64
        Old nodes.
    pose : (3,) float64
        Start pose in ``map``.
    reach : float
        Length of the path whose scans are matched together [m]; 0: the newest scan only.

    Returns
    -------
    FineMatch or None
        None if the scans do not fit.
    """
    path, readings = scene.path, scene.readings
    distance = np.hypot(path[old, 0] - pose[0], path[old, 1] - pose[1])
    order = np.argsort(distance, kind="stable")
    further = min(reach, SEARCH.reach)
    around = old[order][distance[order] < LINKS.reach + further][:SEARCH.nodes[0] + int(LINKS.nodes * further)]
    beams = merged_beams(scene, reach) if reach else readings[-1].beams
    count = beams.shape[1]
    if not len(around) or not count:
        return None
    maps = TileMaps(1, resolution, NEVER)
    maps.register_path(path[around], [readings[node] for node in around])
    row = matcher.match_one(maps, 0, beams, pose, pose, 1.0 / np.square(LINKS.prior))
    if row[mk.SCORE] < MATCHING.score * count or row[mk.FOUND] < SEARCH.least_score * count:
        return None
    return int(around[0]), row, around, _supported_information(matcher, maps, beams, row)


def _supported_information(matcher: FastMatcher, maps: TileMaps, beams: FloatArray,
                           row: FloatArray) -> FloatArray:
    """Return the information (6,) of a match that its cost supports along the weakest direction.

    Normals of noisy end points are inclined, so a plain wall seems to give information along itself. Real information
    makes the cost rise on both sides of the match.
    """
    xx, xy, xt, yy, yt, tt = row[mk.INFORMATION:].tolist()
    size, axes = np.linalg.eigh([[xx, xy], [xy, yy]])
    step, pinned = np.append(PROBE_STEP * axes[:, 0], 0.0), np.full(3, PINNED)
    rise = math.inf
    for move in (step, -step):
        beside = compose(row[:3], move)
        rise = min(rise, matcher.match_one(maps, 0, beams, beside, beside, pinned)[mk.COST] - row[mk.COST])
    whole = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
    part = 1.0 - min(1.0, max(0.0, rise) / max(RISE * size[0], 1e-9))
    along = whole[:, :2] @ axes[:, 0]
    whole -= (part / max(size[0], 1e-9)) * np.outer(along, along)
    return whole[np.triu_indices(3)]
