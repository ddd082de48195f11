# SPDX-License-Identifier: BSD-3-Clause
"""Generated worlds are the same for a seed, and a robot can get through them."""
import numpy as np
import pytest

from m2wr_navigation.compare.scenes import MARGIN, generated, given
from m2wr_navigation.optimum.shortest_path import shortest_path
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines

RADIUS = 0.45


def test_generated_worlds_have_a_way_from_start_to_goal():
    scenes = list(generated(4, 3, RADIUS))
    assert [scene.name for scene in scenes] == ["rooms 0", "pillars 1", "rooms 2", "pillars 3"]
    for scene in scenes:
        obstacles = obstacle_outlines(read_world(scene.world))
        path = shortest_path(obstacles, RADIUS + 0.4 * MARGIN, scene.start[:2], scene.goal)
        assert path.length >= np.hypot(*np.subtract(scene.start[:2], scene.goal)) - 1e-9 > 8.0


def test_a_seed_gives_the_same_worlds_however_many():
    assert list(generated(2, 3, RADIUS)) == list(generated(3, 3, RADIUS))[:2]
    assert next(generated(1, 3, RADIUS)) != next(generated(1, 4, RADIUS))


def test_a_given_world_gets_ends_with_a_way_between_them():
    scene = given("world02", 0, RADIUS)
    assert scene.name == "world02" and scene == given("world02", 0, RADIUS)
    shortest_path(obstacle_outlines(read_world("world02")), RADIUS, scene.start[:2], scene.goal)


def test_a_robot_that_is_too_large_is_told():
    with pytest.raises(ValueError, match="no way for a robot with a radius of 9.00 m"):
        next(generated(1, 0, 9.0))
