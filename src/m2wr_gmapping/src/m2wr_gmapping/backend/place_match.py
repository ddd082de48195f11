# SPDX-License-Identifier: BSD-3-Clause
"""Matching the newest scans closely where a search has found them, and how much that tells."""
import math
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.backend.place_search import QUERY_REACH, REFERENCE_NODES, placed, spread_first, thinned
from m2wr_gmapping.filter.tile_maps import NEVER, TileMaps
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.matcher import NARROW
from m2wr_gmapping.se2 import between, compose

FINE_REACH = 5.0            # old nodes that near to the found pose make the map of the fine match [m]
JOINED_NODES = 4.0          # and more of them for each metre of a stretch that is matched together [1/m]
FINE_SHARE, FINE_FOUND = 0.5, 0.6       # least score and partners of the fine match, as shares of the beams
FINE_PRIOR = np.array([0.3, 0.3, 0.15])  # how far the fine match may be from the coarse one [m, m, rad]
HEARD_STEP = math.sqrt(NARROW)          # so far beside its place a match is rated to see what holds it [m]
WEIGHT_THERE = 0.375        # robust weight of an end point that lies so far off
RISE = 0.25 * NARROW * (1.0 - WEIGHT_THERE)     # of the cost there, for each unit of information: half of it will do
PINNED = 1e12               # information that holds a match where it is
JOINED_SPACING, JOINED_BEAMS = 0.1, 400     # cell that gives one beam to a match of several scans [m]; about so many


@dataclass(frozen=True)
class Joined:
    """Beams (7, M) of several scans, for the matcher."""

    beams: np.ndarray


def joined(scene, reach):
    """Return the scans (Joined) of the last ``reach`` metres, as if the newest node had seen what they have."""
    path, along, parts = scene.path, scene.along, []
    for node in range(len(path) - 1, -1, -1):
        if along[-1] - along[node] > reach:
            break
        beams, pose = scene.readings[node].beams.copy(), between(path[-1], path[node])
        beams[[mk.QX, mk.QY]] = placed(pose, beams[[mk.QX, mk.QY]])
        beams[[mk.NX, mk.NY]] = placed([0.0, 0.0, pose[2]], beams[[mk.NX, mk.NY]])
        parts.append(beams[:, np.square(beams[[mk.QX, mk.QY]]).sum(axis=0) < QUERY_REACH**2])
    beams = np.concatenate(parts, axis=1)
    beams = thinned(beams[:, spread_first(beams[[mk.QX, mk.QY]], JOINED_SPACING)], JOINED_BEAMS)
    qx, qy, nx, ny = beams[[mk.QX, mk.QY, mk.NX, mk.NY]]
    beams[mk.ARM_N], beams[mk.ARM_T] = ny * qx - nx * qy, nx * qx + ny * qy
    return Joined(beams)


def fine_match(matcher, resolution, scene, old, pose, reach=0.0):
    """Match the newest scan, or those of a stretch, near ``pose`` in a map of the old nodes around it.

    Parameters
    ----------
    matcher : FastMatcher
    resolution : float
        Cell size of that map [m].
    scene : Scene
    old : (C,) int
        Nodes to take.
    pose : (3,) float64
    reach : float
        Path whose scans are matched together [m]; 0: the newest one alone.

    Returns
    -------
    node : int
        The nearest of the old nodes.
    row : (13,) float64
        Result row of ``match_kernels``.
    around : (A,) int
        The old nodes.
    heard : (6,) float64
        The row's information as far as it is borne out. None in place of all four where the scans do not fit.
    """
    path, readings = scene.path, scene.readings
    distance = np.hypot(path[old, 0] - pose[0], path[old, 1] - pose[1])
    order = np.argsort(distance, kind="stable")
    further = min(reach, QUERY_REACH)
    around = old[order][distance[order] < FINE_REACH + further][:REFERENCE_NODES + int(JOINED_NODES * further)]
    reading = joined(scene, reach) if reach else readings[-1]
    beams = reading.beams.shape[1]
    if not len(around) or not beams:
        return None
    maps = TileMaps(1, resolution, NEVER)
    maps.register_path(0, path[around], [readings[node] for node in around])
    row = matcher.match_one(maps, 0, reading, pose, pose, 1.0 / np.square(FINE_PRIOR))
    if row[mk.SCORE] < FINE_SHARE * beams or row[mk.FOUND] < FINE_FOUND * beams:
        return None
    return int(around[0]), row, around, _heard(matcher, maps, reading, row)


def _heard(matcher, maps, reading, row):
    """Return a result row's information (6,) as far as the match bears it out along the direction where it is weakest.

    Normals of noisy end points lean, so that a plain wall seems to hold a scan along itself too. What holds it makes it
    fit worse a little further on, both ways.
    """
    xx, xy, xt, yy, yt, tt = row[mk.INFORMATION:].tolist()
    size, axes = np.linalg.eigh([[xx, xy], [xy, yy]])
    step, pinned = np.append(HEARD_STEP * axes[:, 0], 0.0), np.full(3, PINNED)
    rise = math.inf
    for move in (step, -step):
        beside = compose(row[:3], move)
        rise = min(rise, matcher.match_one(maps, 0, reading, beside, beside, pinned)[mk.COST] - row[mk.COST])
    whole = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
    part = 1.0 - min(1.0, max(0.0, rise) / max(RISE * size[0], 1e-9))
    along = whole[:, :2] @ axes[:, 0]
    whole -= (part / max(size[0], 1e-9)) * np.outer(along, along)
    return whole[np.triu_indices(3)]
