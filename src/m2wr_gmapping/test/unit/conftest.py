# SPDX-License-Identifier: BSD-3-Clause
"""Rooms and drives that the tests share."""
import math
import os
import sys

import numpy as np
import pytest

sys.path[:0] = [os.path.join(os.path.dirname(__file__), "..", "..", "src"), os.path.dirname(__file__)]

from m2wr_gmapping.config import GmappingConfig  # noqa: E402
from m2wr_gmapping.frontend.scan import LaserModel  # noqa: E402
from m2wr_gmapping.mapper import Mapper  # noqa: E402
from m2wr_maps.se2 import between, compose  # noqa: E402
from wall_ranges import ranges  # noqa: E402


class Corridor:
    """A square ring of corridors round a block, with pillars that make its sides differ: walls as segments."""

    def __init__(self, outer=8.0, inner=5.0):
        segments = []
        for half in (outer, inner):
            corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
            segments += [a + b for a, b in zip(corners, corners[1:] + corners[:1])]
        for x, y in ((-7.8, 3.0), (7.7, -2.0), (2.5, 7.7), (-1.0, -7.8), (4.0, -5.2), (5.2, 3.0), (-5.2, -1.5)):
            segments += [(x - .2, y, x + .2, y), (x, y - .2, x, y + .2)]
        self.walls = np.array(segments)

    def ranges(self, pose, angles):
        """Distances (B,) to the nearest wall."""
        return ranges(self.walls, pose, angles)


def drive(laps=1.3, step=0.25, half=6.5):
    """True poses (K, 3) of a drive round the ring in the middle of the corridor, turning on the spot at the corners."""
    side = int(2 * half / step)
    steps = ([[step, 0.0, 0.0]] * side + [[0.0, 0.0, math.pi / 8]] * 4) * (4 * int(laps + 1))
    poses = [np.array([-half, half, -math.pi / 2])]
    for move in steps[:int(laps * 4 * (side + 4))]:
        poses.append(compose(poses[-1], move))
    return np.array(poses)


def odometry(truth, rng, noise=0.02, slip=0.01):
    """Odometry (K, 3) of true poses: each step with noise and a turn that it does not know of."""
    poses = [np.zeros(3)]
    for a, b in zip(truth[:-1], truth[1:]):
        step = between(a, b)
        size = np.hypot(step[0], step[1]) + abs(step[2])
        poses.append(compose(poses[-1], step + rng.normal(0.0, noise, 3) * size + [0.0, 0.0, slip * size]))
    return np.array(poses)


@pytest.fixture(scope="session")
def ring():
    return Corridor()


@pytest.fixture(scope="session")
def laser():
    return LaserModel.from_message(-math.pi / 2, math.pi / 2, math.pi / 180, 181, 0.05, 20.0)


@pytest.fixture(scope="session")
def mapped(ring, laser):
    """Function: run a mapper over a drive; returns it, the truth and the odometry."""
    def run(laps=1.3, noise=0.02, slip=0.01, data_seed=5, **parameters):
        truth = drive(laps)
        rng = np.random.default_rng(data_seed)
        odom = odometry(truth, rng, noise, slip)
        values = dict(particles=8, linearUpdate=0.5, angularUpdate=0.3, threads=1, xmin=-10.0, ymin=-10.0, xmax=10.0,
                      ymax=10.0)
        values.update(parameters)
        mapper = Mapper(GmappingConfig.from_mapping(values), laser)
        for k, (pose, at) in enumerate(zip(truth, odom)):
            seen = ring.ranges(pose, laser.angles) + rng.normal(0.0, 0.01, len(laser.angles))
            mapper.process(mapper.reading(seen), at, 0.1 * k)
        return mapper, truth, odom
    return run


@pytest.fixture()
def no_master(monkeypatch):
    """A master that happens to be there is left alone."""
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
