# SPDX-License-Identifier: BSD-3-Clause
"""Where m2wr starts in worlds of others."""
import numpy as np
import pytest

from m2wr_exploration.study.scenes import ROOM, named
from m2wr_navigation.costmap.cost_layout import INSCRIBED
from m2wr_navigation.optimum.shortest_path import MOST_CORNERS

BOX = """<collision name="{0}"><pose>{1} {2} 0.5 0 0 0</pose>
  <geometry><box><size>{3} {4} 1</size></box></geometry></collision>"""
WORLD = """<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include>
<model name="m"><static>1</static><link name="l">{}</link></model></world></sdf>"""


def world(folder, *boxes):
    path = folder / "drawn.world"
    path.write_text(WORLD.format("".join(BOX.format(number, *box) for number, box in enumerate(boxes))))
    return str(path)


def room(x, y, side):
    half = 0.5 * side
    return [(x, y + half, side, 0.1), (x, y - half, side, 0.1), (x + half, y, 0.1, side), (x - half, y, 0.1, side)]


def test_of_a_world_with_many_corners_the_largest_room_is_used(tmp_path):
    posts = [(x, y, 0.05, 0.05) for x in np.linspace(-9.5, 3.5, 17) for y in (-4.3, -3.9, 3.9, 4.3)] * 4
    path = world(tmp_path, *room(-3.0, 0.0, 14.0), *room(6.0, 0.0, 3.0), *posts)
    assert 4 * len(posts) > MOST_CORNERS
    found = [named(path, seed).start for seed in range(5)]
    assert len(set(found)) == 5
    for x, y, _ in found:
        assert -10.0 + ROOM <= x <= 4.0 - ROOM and abs(y) <= 7.0 - ROOM
    place = named(path, 1)
    assert place.truth.costs[place.truth.cell(*place.start[:2])] < INSCRIBED and place.wanted.any()


def test_without_obstacles_it_starts_in_the_middle(tmp_path):
    path = tmp_path / "plain.world"
    path.write_text('<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include></world>'
                    "</sdf>")
    assert named(str(path), 1).start == (0.0, 0.0, 0.0)


def test_a_world_without_room_is_told(tmp_path):
    with pytest.raises(ValueError, match="no place where a disc of 0.50 m is free between obstacles"):
        named(world(tmp_path, *room(0.0, 0.0, 0.8)), 1)
