# SPDX-License-Identifier: BSD-3-Clause
"""Reeds-Shepp paths end at their goals and are the shortest, also by the reference OMPL where it is installed."""
import math

import numpy as np
import pytest

from m2wr_navigation.planners.hybrid_kernels import arc, dubins, shot
from m2wr_navigation.planners.reeds_shepp_kernels import reeds_shepp

RADIUS = 1.5


def pairs(count):
    random = np.random.default_rng(0)
    ends = random.uniform((-5.0, -5.0, -math.pi), (5.0, 5.0, math.pi), (count, 2, 3))
    return [tuple(map(tuple, pair)) for pair in ends.tolist()]


def path(start, goal, backwards=1.0, change=0.0, before=0.0):
    """Return cost and parts (5, 2) of a path, after a look at its end and its curvature."""
    parts = np.full((5, 2), np.nan)
    cost = reeds_shepp(start, goal, RADIUS, backwards, change, before, parts)
    pose = start
    for length, bend in parts.tolist():
        pose = arc(pose, length, bend)
    assert pose[:2] == pytest.approx(goal[:2], abs=1e-9) and math.cos(pose[2] - goal[2]) == pytest.approx(1.0)
    assert set(np.round(np.abs(parts[:, 1]) * RADIUS, 9)) <= {0.0, 1.0}
    return cost, parts


def test_a_path_is_no_longer_than_without_backing():
    forms = set()
    for start, goal in pairs(3000):
        length, parts = path(start, goal)
        assert np.abs(parts[:, 0]).sum() == pytest.approx(length) and length <= dubins(start, goal, RADIUS)[0] + 1e-9
        forms.add(tuple(np.sign(parts[np.abs(parts[:, 0]) > 1e-9, 1]).astype(int)))
    assert len(forms) > 12 and max(map(len, forms)) == 5


@pytest.mark.parametrize("goal, length", [
    ((-4.0, 0.0, 0.0), 4.0), ((4.0, 0.0, 0.0), 4.0), ((0.0, 0.0, math.pi), math.pi * RADIUS),
    ((RADIUS, RADIUS, 0.5 * math.pi), 0.5 * math.pi * RADIUS),
    ((-RADIUS, RADIUS, -0.5 * math.pi), 0.5 * math.pi * RADIUS)])
def test_known_paths_have_their_lengths(goal, length):
    assert path((0.0, 0.0, 0.0), goal)[0] == pytest.approx(length)


def test_the_way_back_is_as_long():
    for start, goal in pairs(300):
        assert path(start, goal)[0] == pytest.approx(path(goal, start)[0])


def test_backing_and_changes_have_their_cost():
    start, goal = (0.0, 0.0, 0.0), (-4.0, 0.0, 0.0)
    assert path(start, goal, backwards=1.5)[0] == pytest.approx(6.0)
    assert path(start, goal, backwards=1.5, change=0.7, before=-1.0)[0] == pytest.approx(6.0)
    assert path(start, goal, backwards=1.5, change=0.7, before=1.0)[0] == pytest.approx(6.7)
    parts = np.empty((5, 2))
    assert shot(start, goal, RADIUS, 100.0, 0.7, 1.0, parts) == dubins(start, goal, RADIUS)[0]
    assert (parts[:, 0] >= 0.0).all()
    for first, last in pairs(300):
        cost, parts = path(first, last, backwards=2.0, change=1.0)
        lengths = parts[np.abs(parts[:, 0]) > 1e-9, 0]
        assert cost == pytest.approx(np.where(lengths > 0.0, lengths, -2.0 * lengths).sum()
                                     + np.count_nonzero(np.diff(np.sign(lengths))))


def test_no_path_is_shorter_by_the_reference():
    base = pytest.importorskip("ompl.base", reason="the reference OMPL is not installed; pip install --no-deps ompl")
    space = base.ReedsSheppStateSpace(RADIUS)
    bounds = base.RealVectorBounds(2)
    bounds.setLow(-10.0)
    bounds.setHigh(10.0)
    space.setBounds(bounds)
    one, two = space.allocState(), space.allocState()
    for start, goal in pairs(2000):
        for state, (x, y, yaw) in ((one, start), (two, goal)):
            state.setXY(x, y)
            state.setYaw(yaw)
        assert path(start, goal)[0] == pytest.approx(space.distance(one, two), abs=1e-6)
