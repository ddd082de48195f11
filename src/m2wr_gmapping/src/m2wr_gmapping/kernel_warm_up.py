# SPDX-License-Identifier: BSD-3-Clause
"""Compile every kernel or load it from its cache: ``python3 -m m2wr_gmapping.kernel_warm_up``."""
from __future__ import annotations

import math

import numpy as np

from m2wr_gmapping.backend import drift_kernels, place_search
from m2wr_gmapping.backend.route import distances_along
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend.information_kernels import unfold, weak_axis
from m2wr_gmapping.frontend.match_kernels import RESULT_SIZE
from m2wr_gmapping.frontend.matcher import NO_PRIOR, FastMatcher
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.frontend.view_memory import ViewMemory
from m2wr_gmapping.mapper import Mapper
from m2wr_maps.se2 import compose
from m2wr_node.kernel_library import prepare
from m2wr_node.thread_team import ThreadTeam


def tour(mapper: Mapper, steps: int = 40) -> None:
    """Drive through a square room of 6 m, so that a mapper calls most kernels.

    Parameters
    ----------
    mapper : Mapper
    steps : int
        Number of scans.
    """
    laser = mapper.laser
    pose = np.array([1.0, 0.0, 0.0])
    for k in range(steps):
        angles = pose[2] + laser.angles
        with np.errstate(divide="ignore"):
            walls = [np.where(side * part > 0.0, (3.0 - side * at) / (side * part), np.inf)
                     for part, at in ((np.cos(angles), pose[0]), (np.sin(angles), pose[1])) for side in (1.0, -1.0)]
        mapper.process(mapper.reading(np.minimum.reduce(walls)), pose, float(k))
        pose = compose(pose, [0.5 if k % 2 else 0.2, 0.0, 0.2])
    mapper.occupancy()


def rare_work(mapper: Mapper) -> None:
    """Call the kernels that the tour may not reach: a robot at rest, corridors, window search, drift, loop search."""
    particles = mapper.particles
    grid, reading = particles.maps, mapper.readings[-1]
    ViewMemory().has_changed(reading)
    matcher = FastMatcher(mapper.config, ThreadTeam(1))
    matcher.search(grid, 0, reading, particles.poses[0], np.array([0.1, 0.1]), NO_PRIOR)
    weak_axis(np.ones(RESULT_SIZE))
    unfold(np.ones(RESULT_SIZE))
    path = particles.tree.path(particles.best)
    turned, nodes = np.zeros(len(path)), np.arange(len(path))
    drift_kernels.drift(path, turned, 0.0, np.zeros((1, 2), np.int64), 0, np.empty((len(path), 3)))
    scene = place_search.Scene(path, distances_along(path), mapper.readings, len(path), turned + 3.0, turned + 0.1)
    place_search.near_search(scene, nodes)
    place_search.wide_search(scene, nodes)
    particles.replace_past(path, mapper.readings)


def compile_kernels() -> None:
    """Run both matchers, the loop closing and the map once in a small room."""
    laser = LaserModel.from_message(-math.pi / 2, math.pi / 2, math.pi / 60, 61, 0.1, 10.0)
    for compatible in (False, True):
        mapper = Mapper(GmappingConfig.from_mapping(dict(
            particles=2, compatible=compatible, linearUpdate=0.3, threads=1, xmin=-5.0, ymin=-5.0, xmax=5.0,
            ymax=5.0, resampleThreshold=1.0)), laser)
        try:
            tour(mapper)
            mapper.finish()
            rare_work(mapper)
        finally:
            mapper.close()


if __name__ == "__main__":
    prepare("m2wr_gmapping", compile_kernels)
