# SPDX-License-Identifier: BSD-3-Clause
"""Where robots were before others knew where they are: there maps may show a robot as a wall.

Beams that end on a teammate are left out of maps only once its place is known. But where the body of a robot has been,
nothing stands, so these cells are free in the maps of the others as soon as these are placed. Until then an obstacle
there may be this robot: it does not contradict a place of the maps.
"""
from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Deque, Dict, Iterable, List, Mapping

import numpy as np

from m2wr_maps.se2 import compose
from m2wr_navigation.costmap.cost_layout import FREE, NO_INFORMATION
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint import placed
from m2wr_navigation.costmap.footprint_kernels import fill_polygon

if TYPE_CHECKING:
    from m2wr_exploration.team.placing import Placing
    from m2wr_node.array_types import FloatArray

MARGIN = 0.1                # m around a body: two cells, for the errors of both maps
STEP, TURN = 0.1, 0.2       # m, rad: between two poses of a trail
MOST = 2000                 # poses of a robot: 200 m


class Trails:
    """Poses of robots, each in the frame of its own map.

    Parameters
    ----------
    count : int
        Of robots.
    outline : (K, 2) float64
        Body of each [m].
    """

    def __init__(self, count: int, outline: FloatArray) -> None:
        away = np.hypot(outline[:, 0], outline[:, 1])[:, None]
        self._outline: FloatArray = outline * (1.0 + math.sqrt(2.0) * MARGIN / np.maximum(away, 1e-3))
        self._poses: List[Deque[FloatArray]] = [deque(maxlen=MOST) for _ in range(count)]

    def add(self, robot: int, pose: FloatArray) -> None:
        """Take where a robot is.

        Parameters
        ----------
        robot : int
        pose : (3,) float64
            In the frame of its map [m, m, rad].
        """
        poses = self._poses[robot]
        if not poses or np.hypot(*(pose[:2] - poses[-1][:2])) >= STEP \
                or abs(math.remainder(pose[2] - poses[-1][2], 2.0 * math.pi)) >= TURN:
            poses.append(np.array(pose, float))

    def cleared(self, maps: Mapping[int, Costmap], placing: Placing) -> Dict[int, Costmap]:
        """Return maps, free where the bodies of the other robots of the group have been.

        Parameters
        ----------
        maps : mapping of int to Costmap
            By robot, each in its own frame; left unchanged.
        placing : Placing
        """
        robots = range(len(self._poses))
        return {robot: self._drawn(robot, costmap, placing, [other for other in robots if other != robot], FREE)
                for robot, costmap in maps.items()}

    def comparable(self, maps: Mapping[int, Costmap], placing: Placing) -> Dict[int, Costmap]:
        """Return maps for comparisons: unknown where the bodies of the group, that of the robot too, have been.

        Parameters
        ----------
        maps : mapping of int to Costmap
            As for :meth:`cleared`.
        placing : Placing
        """
        robots = range(len(self._poses))
        return {robot: self._drawn(robot, costmap, placing, robots, NO_INFORMATION)
                for robot, costmap in maps.items()}

    def _drawn(self, robot: int, costmap: Costmap, placing: Placing, others: Iterable[int], cost: int) -> Costmap:
        costs = costmap.costs.copy()
        for other in others:
            frame = placing.relative(robot, other)
            if frame is None:
                continue
            for pose in list(self._poses[other]):
                body = placed(self._outline, compose(frame, pose))
                fill_polygon(costs, costmap.resolution, costmap.origin, body, cost)
        return Costmap(costs, costmap.resolution, costmap.origin, costmap.frame)
