# SPDX-License-Identifier: BSD-3-Clause
"""Places for many robots: free of the world, apart, within reach, the same for the same seed."""
import math
from dataclasses import replace

import pytest

from builders import at, box, cylinder, ground, one_link, sphere
from m2wr_sim.api import Sim
from m2wr_sim.api.loading import read_world
from m2wr_sim.errors import WorldError
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Box, ModelStateEntry, World, WorldState
from m2wr_tools.robots.free_places import LAYOUTS, find_places

WORLDS = ("empty", "world01", "world02", "world03", "shapes", "unreachable")


def world(*models, **values):
    return World(models=(ground(),) + models, **values)


def walls(side):
    """A closed room."""
    return [box("wall%d" % k, x, y, 0.5, size=size) for k, (x, y, size) in enumerate((
        (side, 0.0, (0.2, 2 * side + 0.2, 1.0)), (-side, 0.0, (0.2, 2 * side + 0.2, 1.0)),
        (0.0, side, (2 * side + 0.2, 0.2, 1.0)), (0.0, -side, (2 * side + 0.2, 0.2, 1.0))))]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", WORLDS)
def test_twenty_robots_are_apart_without_contacts(name, layout, m2wr):
    places = find_places(read_world(name), 20, layout)
    assert len(places) == 20
    assert min(math.dist(one[:2], two[:2]) for k, one in enumerate(places) for two in places[:k]) >= 1.2 - 1e-9
    with Sim(name, sensing="off") as sim:
        for k, place in enumerate(places):
            sim.spawn(m2wr, place, "r%d" % k)
        now = sim.step(None, 0.3)
        assert all(now["r%d" % k].contacts == () for k in range(20))
        for k, place in enumerate(places):
            assert math.dist(now["r%d" % k].pose[:2], place[:2]) < 2e-3


def test_a_single_robot_stands_in_the_middle():
    assert find_places(world(), 1, centre=(2.0, -3.0), yaw=1.5) == [(2.0, -3.0, 1.5)]


def test_a_circle_looks_outwards():
    places = find_places(world(), 8, "circle", centre=(1.0, 2.0))
    for x, y, yaw in places:
        assert math.remainder(math.atan2(y - 2.0, x - 1.0) - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert len({round(math.hypot(x - 1.0, y - 2.0), 9) for x, y, _ in places}) == 1


def test_places_depend_on_the_seed_alone():
    one, two, three = (find_places(world(), 10, "random", seed=seed) for seed in (3, 3, 4))
    assert one == two != three


@pytest.mark.parametrize("layout", LAYOUTS)
def test_robots_that_start_inside_walls_stay_inside(layout):
    places = find_places(world(*walls(3.0)), 9, layout)
    assert all(max(abs(x), abs(y)) <= 3.0 - 0.1 - 0.45 + 1e-9 for x, y, _ in places)


def test_too_many_for_the_room_is_an_error_with_the_numbers():
    with pytest.raises(WorldError, match=r"only \d+ of 40 places found around \(0, 0\): 1.2 m apart"):
        find_places(world(*walls(2.0)), 40)


@pytest.mark.parametrize("thing, hindered", [
    (box("curb", 0.0, 0.0, 0.01, size=(0.1, 0.1, 0.02)), True),
    (box("bridge", 0.0, 0.0, 0.8, size=(3.0, 3.0, 0.1)), False),
    (sphere("ball", 0.0, 0.0, 0.3, radius=0.3), True),
    (sphere("buried", 0.0, 0.0, -0.3, radius=0.3), False),
    (cylinder("post", 0.4, 0.0, 0.5, radius=0.05), True),
    (cylinder("post", 0.6, 0.0, 0.5, radius=0.05), False),
    (one_link("beam", Box((2.0, 0.1, 0.1)), ((0.9, 0.9, 0.3), quaternion_from_rpy(0.0, 0.0, math.pi / 4))), True),
    (one_link("beam", Box((2.0, 0.1, 0.1)), ((0.9, 0.9, 0.3), quaternion_from_rpy(0.0, 0.0, -math.pi / 4))), False),
    (box("crate", 0.0, 0.0, 0.2, size=(0.2, 0.2, 0.2), static=False), True),
])
def test_what_stands_in_the_way(thing, hindered):
    assert (find_places(world(thing), 1) != [(0.0, 0.0, 0.0)]) is hindered


def test_a_stored_state_counts_for_where_things_are():
    crate = box("crate", 0.0, 0.0, 0.2)
    moved = replace(world(crate), state=WorldState(models=(ModelStateEntry("crate", at(5.0, 0.0, 0.2)),)))
    assert find_places(world(crate), 1) != [(0.0, 0.0, 0.0)] == find_places(moved, 1)


@pytest.mark.parametrize("count, options, words", [
    (0, {}, "at least 1"), (2, {"layout": "heap"}, "grid, circle, random"), (2, {"spacing": 0.5}, "two positive radii"),
    (2, {"radius": 0.0}, "two positive radii"), (2, {"spacing": math.nan}, "two positive radii"),
    (2, {"centre": (math.inf, 0.0)}, "finite"), (2, {"yaw": math.nan}, "finite")])
def test_senseless_wishes_are_refused(count, options, words):
    with pytest.raises(ValueError, match=words):
        find_places(world(), count, **options)
