# SPDX-License-Identifier: BSD-3-Clause
"""The compiled clearance is that of the plain search over all poses."""
import math

import numpy as np
import pytest

from m2wr_navigation.compare.clearance import Clearances
from m2wr_view.outlines import M2WR_FOOTPRINT, Outline, convex_hull, footprint_distances, least_clearance


def outlines_of(random, count):
    """Return discs, rounded lines and polygons about the origin."""
    made = []
    for number in range(count):
        corners = random.uniform(-1.0, 1.0, (1 + number % 6, 2)) + random.uniform(-8.0, 8.0, 2)
        made.append(Outline(convex_hull(corners) if len(corners) > 2 else corners, random.choice([0.0, 0.1, 0.4])))
    return made


def drive_of(random, count):
    """Return poses that follow one another, with a jump between two of them."""
    turns = np.cumsum(random.uniform(-0.1, 0.1, count))
    places = np.cumsum(0.03 * np.column_stack((np.cos(turns), np.sin(turns))), axis=0) + random.uniform(-6.0, 6.0, 2)
    places[count // 2:] += random.uniform(-5.0, 5.0, 2)
    return np.column_stack((places, turns))


def test_the_least_distance_is_that_of_all_poses():
    random, found = np.random.default_rng(4), []
    for count in (1, 2, 6, 40):
        for _ in range(12):
            obstacles, poses = outlines_of(random, count), drive_of(random, 300)
            expected = least_clearance(poses, obstacles).distance
            found.append(Clearances(obstacles, M2WR_FOOTPRINT).least(poses))
            assert found[-1] == pytest.approx(expected, abs=1e-9)
    assert 5 < np.count_nonzero(found) < 48          # some are in contact, some are not


def test_a_bar_through_the_robot_is_in_contact():
    bar = Outline(np.array([(0.0, -3.0), (0.02, -3.0), (0.02, 3.0), (0.0, 3.0)]))
    pose = np.array([(0.0, 0.0, 0.3)])
    assert footprint_distances(pose, bar)[0] == Clearances([bar], M2WR_FOOTPRINT).least(pose) == 0.0


def test_nothing_there_is_infinitely_far():
    disc = Outline(np.array([(2.0, 0.0)]), 0.3)
    assert Clearances([], M2WR_FOOTPRINT).least(np.zeros((3, 3))) == math.inf
    assert Clearances([disc], M2WR_FOOTPRINT).least(np.zeros((0, 3))) == math.inf
    assert Clearances([disc], M2WR_FOOTPRINT).least(np.zeros((1, 3))) == pytest.approx(2.0 - 0.3 - 0.4)
