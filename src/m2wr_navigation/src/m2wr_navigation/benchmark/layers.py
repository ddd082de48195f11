# SPDX-License-Identifier: BSD-3-Clause
"""CPU time of the costmap layers that hold obstacles."""
from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Dict

import numpy as np

from m2wr_navigation import registry
from m2wr_navigation.benchmark import grids
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.observation import SOURCE_PARAMETERS, Observation, Source
from m2wr_navigation.parameters import read

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

SIDE = 6.0                  # m: 120 x 120 cells
UPDATES = 60
#: Points of one observation: beams of a scan at one height, or points of a cloud at all heights.
POINTS: Dict[str, int] = {"scan": 640, "cloud": 20000}


def points_of(sight: str, random: np.random.Generator) -> FloatArray:
    """Return what a sensor in the middle of the costmap sees (N, 3), in the costmap's frame [m].

    Parameters
    ----------
    sight : str
        A key of :data:`POINTS`.
    random : numpy.random.Generator
    """
    count = POINTS[sight]
    angles, distances = np.linspace(-math.pi, math.pi, count, False), random.uniform(0.5, 2.9, count)
    heights = np.full(count, 0.3) if sight == "scan" else random.uniform(0.0, 2.0, count)
    return np.stack([0.5 * SIDE + distances * np.cos(angles), 0.5 * SIDE + distances * np.sin(angles), heights], -1)


def layer_time(name: str, sight: str, seed: int) -> float:
    """Return the CPU time of an update in which everything that is seen has changed, mean of many [ms].

    Parameters
    ----------
    name : str
        Of the layer.
    sight : str
        A key of :data:`POINTS`.
    seed : int
        Of the points.

    Raises
    ------
    RuntimeError
        If the layer marks nothing.
    """
    costmap = LayeredCostmap("odom", (SIDE, SIDE), grids.RESOLUTION, (0.0, 0.0), False, False)
    kind = registry.find(registry.LAYERS, name)
    costmap.add(kind(name, read(kind.PARAMETERS, {}, name)[0]))
    source = Source(sight, read(SOURCE_PARAMETERS, {"clearing": True}, sight)[0])
    costmap.obstacle_layers()[0].sources[sight] = source
    random, sensor, spent = np.random.default_rng(seed), np.array([0.5 * SIDE, 0.5 * SIDE, 0.3]), 0.0
    for step in range(UPDATES):
        source.add(Observation(float(step), sensor, points_of(sight, random), np.zeros((0, 3))), float(step))
        begun = time.process_time()
        costmap.update(np.array([0.5 * SIDE, 0.5 * SIDE, 0.0]), float(step))
        spent += 1e3 * (time.process_time() - begun)
    if not (costmap.snapshot().costs == 254).any():
        raise RuntimeError("the points of the benchmark mark nothing")
    return spent / UPDATES
