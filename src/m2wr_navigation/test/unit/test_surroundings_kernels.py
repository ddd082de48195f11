# SPDX-License-Identifier: BSD-3-Clause
"""Compiled surroundings beside those of motion_plan, on random drives."""
import math

import numpy as np
import pytest

from m2wr_navigation.methods.compiled_surroundings import CompiledSurroundings
from motion_plan.surroundings import Surroundings

PARTS = ((-0.1, 0.1, 0.15, 0.25), (-0.3, -0.25, 0.0, 0.05))


def readings_of(random, beams):
    """A wall, with posts, gaps and readings of all kinds."""
    ranges = random.uniform(0.3, 4.0) + 0.3 * np.sin(np.arange(beams) / random.uniform(3.0, 60.0))
    ranges[random.random(beams) < 0.05] = random.uniform(0.05, 3.0)
    for value in (np.nan, np.inf, -np.inf):
        ranges[random.random(beams) < 0.02] = value
    return ranges.astype(random.choice(["f4", "f8"]))


@pytest.mark.parametrize("beams, first, increment", [
    (720, -math.pi / 2, math.pi / 719), (360, 0.0, math.radians(1.0)), (181, 1.5, -math.radians(1.0)),
    (1, 0.0, 0.01), (2, -0.1, 0.2), (3, -1.0, 1.0)])
def test_points_and_travels_are_those_of_motion_plan(beams, first, increment):
    random = np.random.default_rng(beams)
    one, two = (kind((0.2, 0.05), PARTS, 2.5) for kind in (Surroundings, CompiledSurroundings))
    pose = np.zeros(3)
    for _ in range(60):
        pose += random.uniform((-0.05, -0.05, -0.4), (0.15, 0.1, 0.5))
        if random.random() < 0.03:
            pose[:2] += 1.0                     # a teleport
        ranges = readings_of(random, beams)
        for around in (one, two):
            around.update(ranges, first, increment, tuple(pose.tolist()))
        assert np.array_equal(one.points, two.points)
        x, y, radius = pose[0] + random.normal(), pose[1] + random.normal(), random.uniform(0.1, 0.8)
        directions = random.uniform(0.0, 6.0) + np.arange(random.integers(1, 121)) * 0.05
        for ways in (directions, directions[:1]):
            for got, expected in zip(two.free_travel(x, y, ways, radius), one.free_travel(x, y, ways, radius)):
                assert np.array_equal(got, expected)
        distance = random.uniform(0.1, 2.0)
        assert two.first_free(x, y, directions, radius, distance) == one.first_free(x, y, directions, radius, distance)


def test_compiled_surroundings_without_points():
    around = CompiledSurroundings((0.2, 0.0), (), 2.5)
    assert around.first_free(0.0, 0.0, np.zeros(3), 0.3, 1.0) == (0, -1)
    travel, blockers = around.free_travel(0.0, 0.0, [0.0, 1.0], 0.3)
    assert np.isinf(travel).all() and (blockers == -1).all()
    around.update([], 0.0, 0.1, (0.0, 0.0, 0.0))
    assert around.points.shape == (0, 2)
