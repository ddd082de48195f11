# SPDX-License-Identifier: BSD-3-Clause
"""Dubins paths end at their goals and are the shortest, also by the reference OMPL where it is installed."""
import math

import numpy as np
import pytest

from m2wr_navigation.planners.hybrid_kernels import arc, dubins, shot, shot_poses

RADIUS = 1.5


def pairs(count):
    random = np.random.default_rng(0)
    ends = random.uniform((-5.0, -5.0, -math.pi), (5.0, 5.0, math.pi), (count, 2, 3))
    return [tuple(map(tuple, pair)) for pair in ends.tolist()]


def test_a_path_ends_at_its_goal_and_has_the_length_that_is_told():
    words = set()
    for start, goal in pairs(3000):
        length, word, *_ = dubins(start, goal, RADIUS)
        parts = np.empty((5, 2))
        assert shot(start, goal, RADIUS, 0.0, 0.0, 1.0, parts) == length
        poses = shot_poses(start, parts)
        assert poses[-1, :2] == pytest.approx(goal[:2], abs=1e-6)
        assert math.cos(poses[-1, 2] - goal[2]) == pytest.approx(1.0)
        assert np.hypot(*np.diff(np.vstack([start, poses])[:, :2], axis=0).T).sum() == pytest.approx(length, rel=0.01)
        words.add(word)
    assert words == set(range(6))


@pytest.mark.parametrize("goal, length", [((4.0, 0.0, 0.0), 4.0), ((0.0, 2.0 * RADIUS, math.pi), math.pi * RADIUS),
                                          ((RADIUS, RADIUS, 0.5 * math.pi), 0.5 * math.pi * RADIUS)])
def test_known_paths_have_their_lengths(goal, length):
    assert dubins((0.0, 0.0, 0.0), goal, RADIUS)[0] == pytest.approx(length)


def test_a_full_circle_of_arcs_leads_back():
    pose = (1.0, 2.0, 0.3)
    for _ in range(8):
        pose = arc(pose, 0.25 * math.pi * RADIUS, 1.0 / RADIUS)
    assert pose == pytest.approx((1.0, 2.0, 0.3 + 2.0 * math.pi))
    assert arc(arc(pose, 1.0, -0.5), -1.0, -0.5) == pytest.approx(pose)


def test_no_path_is_shorter_by_the_reference():
    base = pytest.importorskip("ompl.base", reason="the reference OMPL is not installed; pip install --no-deps ompl")
    space = base.DubinsStateSpace(RADIUS)
    bounds = base.RealVectorBounds(2)
    bounds.setLow(-10.0)
    bounds.setHigh(10.0)
    space.setBounds(bounds)
    one, two = space.allocState(), space.allocState()
    for start, goal in pairs(2000):
        for state, (x, y, yaw) in ((one, start), (two, goal)):
            state.setXY(x, y)
            state.setYaw(yaw)
        assert dubins(start, goal, RADIUS)[0] == pytest.approx(space.distance(one, two), abs=1e-6)
