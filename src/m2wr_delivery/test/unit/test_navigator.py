# SPDX-License-Identifier: BSD-3-Clause
"""Ways over a map: around what is forbidden, other robots and traps; and whether there is one."""
import numpy as np
import pytest

from m2wr_delivery.navigator import ROBOT, Navigator, grown
from m2wr_elevation.elevation_map import MapSettings

SETTINGS = MapSettings(size=10.0, cell=0.1)


def layers(wall=None):
    side = 100
    known = {name: np.zeros((side, side)) for name in ("slope", "step", "roughness")}
    known["traversability"] = np.ones((side, side))
    if wall is not None:
        known["traversability"][wall] = 0.0
    return known


def navigator(wall=None):
    found = Navigator(SETTINGS, 5.0)
    found.see(layers(wall))
    return found


def test_over_level_ground_the_way_is_straight():
    way = navigator().plan((-3.0, 0.05), (3.0, 0.05))
    assert not way.blocked and way.length == pytest.approx(6.0, abs=0.15)
    assert np.allclose(way.points[0], (-3.0, 0.05), atol=0.1) and np.allclose(way.points[-1], (3.0, 0.05), atol=0.1)


def test_it_leads_around_a_wall_and_not_past_its_edge():
    way = navigator((slice(30, 70), slice(48, 52))).plan((-3.0, 0.0), (3.0, 0.0))
    crossing = way.points[np.abs(way.points[:, 0]) < 0.2]
    assert not way.blocked and np.all(np.abs(crossing[:, 1]) > 2.1)


def test_a_wall_across_the_field_blocks_it():
    assert navigator((slice(0, 100), slice(48, 52))).plan((-3.0, 0.0), (3.0, 0.0)).blocked


def test_a_robot_that_stands_on_forbidden_ground_still_leaves_it():
    assert not navigator((slice(48, 52), slice(18, 22))).plan((-3.0, 0.0), (3.0, 0.0)).blocked


def test_other_robots_and_traps_are_led_around():
    plain = navigator()
    way = plain.plan((-3.0, 0.0), (3.0, 0.0), [(0.0, 0.0)])
    assert np.hypot(*way.points.T).min() > ROBOT - 0.1 and not way.blocked
    plain.avoid(0.0, 0.0)
    plain.see(layers())
    assert np.hypot(*plain.plan((-3.0, 0.0), (3.0, 0.0)).points.T).min() > 0.3


def test_the_border_of_the_field_is_not_crossed():
    found = Navigator(SETTINGS, 3.0)
    found.see(layers((slice(20, 95), slice(48, 52))))
    assert found.plan((-2.0, 0.0), (2.0, 0.0)).blocked, "the gap is outside"


def test_grown_cells():
    cells = np.zeros((7, 7), bool)
    cells[3, 3] = True
    assert grown(cells, 1).sum() == 9 and grown(cells, 2)[1:6, 1:6].all() and grown(cells, 2).sum() == 25
    assert (grown(cells, 0) == cells).all()
