# SPDX-License-Identifier: BSD-3-Clause
"""One map of the maps of several robots, whose poses on each other are known."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence

import numpy as np

from m2wr_exploration.team.merge_kernels import paint
from m2wr_navigation.costmap.cost_layout import NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

MOST_CELLS = 100000000      # of a merged map


def corners(costmap: Costmap, pose: FloatArray) -> FloatArray:
    """Return the corners (4, 2) of a map in the frame in which it has a pose [m].

    Parameters
    ----------
    costmap : Costmap
    pose : (3,) float64
        [m, m, rad]
    """
    size = costmap.resolution * np.array([costmap.columns, costmap.rows])
    points = costmap.origin + size * np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    placed: FloatArray = points @ np.array([(cosine, sine), (-sine, cosine)]) + pose[:2]
    return placed


def merge(maps: Sequence[Costmap], poses: Sequence[FloatArray], frame: str = "world") -> Costmap:
    """Merge maps: a cell is known where one of them knows it; an obstacle in one is an obstacle.

    Parameters
    ----------
    maps : sequence of Costmap
        At least one.
    poses : sequence of (3,) float64
        Of the frames of the maps in the common one [m, m, rad].
    frame : str
        Name of the common frame.

    Returns
    -------
    Costmap
        With the resolution of the finest map, just large enough for all.

    Raises
    ------
    ValueError
        If there is no map, a pose is not finite, or the merged map would be too large.
    """
    if not maps or len(maps) != len(poses):
        raise ValueError("{} maps and {} poses; expected at least one map, and a pose for each".format(
            len(maps), len(poses)))
    if not all(np.isfinite(pose).all() for pose in poses):
        raise ValueError("a pose of a map is not finite")
    resolution = min(costmap.resolution for costmap in maps)
    points = np.concatenate([corners(costmap, pose) for costmap, pose in zip(maps, poses)])
    low = np.floor(points.min(axis=0) / resolution + 1e-6)
    columns, rows = (int(count) for count in np.ceil(points.max(axis=0) / resolution - 1e-6) - low)
    if rows * columns > MOST_CELLS:
        raise ValueError("the merged map would have {} x {} cells; expected at most {} cells".format(
            columns, rows, MOST_CELLS))
    merged = Costmap.filled((rows, columns), resolution, low * resolution, NO_INFORMATION, frame)
    for costmap, pose in zip(maps, poses):
        paint(merged.costs, resolution, merged.origin, costmap.costs, costmap.resolution, costmap.origin,
              np.asarray(pose, float))
    return merged
