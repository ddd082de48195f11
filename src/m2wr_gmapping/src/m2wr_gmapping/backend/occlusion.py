# SPDX-License-Identifier: BSD-3-Clause
"""Check of a place by occlusion, with some of the newest scans and of the old ones around it."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping.backend.facing import opposite_share
from m2wr_gmapping.frontend.occlusion import conflict_of
from m2wr_gmapping.tuning import LINKS, OCCLUSION, SEARCH
from m2wr_maps.se2 import between, compose

if TYPE_CHECKING:
    from m2wr_gmapping.backend.place_search import Scene
    from m2wr_node.array_types import FloatArray, IndexArray


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


def is_contradicted(scene: Scene, pose: FloatArray, around: IndexArray) -> bool:
    """Return whether scans look through walls of one another at a place, or see walls from both sides as one.

    Parameters
    ----------
    scene, pose, around
        As for :func:`occlusion_conflict`.
    """
    return (occlusion_conflict(scene, pose, around) > OCCLUSION.most_conflict
            or opposite_share(scene, pose, around) > OCCLUSION.most_conflict)
