# SPDX-License-Identifier: BSD-3-Clause
"""Slip is measured from wheels and map, passed on to cells near by and steeper, and makes ways lead round it."""
import math

import numpy as np
import pytest

from m2wr_elevation.elevation_map import ElevationMap, MapSettings
from m2wr_elevation.planning import BackOff, cost_of, route
from m2wr_elevation.slip import LEAD, MOST_KEPT, MOST_SLIP, MOST_TOLD, SlipMap
from m2wr_elevation.study.drive import to_goal
from m2wr_elevation.study.mapping import cell_of

AHEAD = np.array((1.0, 0.0, 0.0))
SETTINGS = MapSettings(size=10.0, cell=0.1)
HARD = {"fractal": 0.05, "craters": 0.5, "rubble": 0.06}


def plain(tangent=0.2):
    """Return a map of ground that rises along x everywhere, and its layers."""
    found = ElevationMap(SETTINGS, follow=False)
    found.height[:] = tangent * (np.arange(100) + 0.5) * SETTINGS.cell
    return found, found.layers()


def driven(slip, distance=1.5, start=(0.0, 0.0), sense=1.0):
    """Return what a robot learns that drives along x with a constant slip."""
    found, step = SlipMap(), 0.03
    for number in range(int(distance / step) + 1):
        along = sense * (1.0 - slip) * step * number
        found.travel(sense * step if number else 0.0, np.array((start[0] + along, start[1], 0.0)), AHEAD)
    return found


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("slip", [0.0, 0.3, 0.8, 1.0])
def test_slip_is_what_the_wheels_turn_in_vain(slip, sense):
    found = driven(slip, sense=sense)
    assert len(found.measured) == 10
    assert [each[2] for each in found.measured] == pytest.approx([slip] * 10)
    assert found.spins == (slip > 0.7)
    assert found.measured[-1][0] == pytest.approx(sense * ((1.0 - slip) * 1.5 + LEAD * slip), abs=0.05)


def test_a_robot_that_slides_downhill_has_no_slip():
    assert {each[2] for each in driven(-0.4).measured} == {0.0}


def test_ground_near_by_is_as_slippery_and_steeper_ground_more():
    elevation, layers = plain(0.2)
    found = driven(0.3, 3.0)
    row, column = cell_of(elevation, 1.05, 0.25)
    layers["slope"][row, column] = math.atan(0.4)
    slip = found.layer(elevation, layers["slope"])
    assert slip[row, column - 3] == pytest.approx(0.3, abs=0.03)
    assert slip[row, column] == pytest.approx(0.6, abs=0.06)
    assert slip[cell_of(elevation, 1.0, 3.0)] < 0.01 and slip.max() <= MOST_SLIP


def test_without_slip_costs_are_those_of_the_ground():
    elevation, layers = plain()
    cost = cost_of(layers, SETTINGS)
    layers["slip"] = driven(0.0).layer(elevation, layers["slope"])
    assert np.array_equal(cost_of(layers, SETTINGS), cost)


def way_round(found):
    elevation, layers = plain(0.15)
    layers["slip"] = found.layer(elevation, layers["slope"])
    way = route(cost_of(layers, SETTINGS), cell_of(elevation, -3.0, 0.05), cell_of(elevation, 3.0, 0.05))
    return max(abs(row - 50) * SETTINGS.cell for row, _ in way)


def test_the_way_leads_round_ice_that_was_told():
    found = SlipMap()
    assert way_round(found) < 0.2
    found.tell(0.0, 0.0, 1.0, 1.0)          # climbed easily
    assert way_round(found) < 0.2
    found.tell(0.0, 0.0, 1.0, 0.16)         # hardly
    assert way_round(found) > 0.9


def test_the_way_leads_round_a_place_where_it_slipped():
    assert way_round(driven(0.2)) < 0.2
    assert way_round(driven(1.0, start=(-LEAD, 0.0))) > 0.4


def test_where_the_robot_slips_it_turns_round_and_arrives():
    ice = dict(patches=("ice", "mud", "sand"), share=0.3)
    assert to_goal("elevation", HARD, 1, **ice)["outcome"] == "slipped"
    assert to_goal("slip", HARD, 1, **ice)["outcome"] == "reached"


def test_measurements_and_patches_are_bounded():
    found = driven(0.5, 100.0)
    assert len(found.measured) == MOST_KEPT
    for _ in range(MOST_TOLD):
        found.tell(0.0, 0.0, 1.0, 0.5)
    with pytest.raises(ValueError, match="more than"):
        found.tell(0.0, 0.0, 1.0, 0.5)


@pytest.mark.parametrize("patch", [(math.nan, 0.0, 1.0, 0.5), (0.0, 0.0, 0.0, 0.5), (0.0, 0.0, 1.0, 0.0)])
def test_a_patch_that_is_none_is_refused(patch):
    with pytest.raises(ValueError, match="a patch at"):
        SlipMap().tell(*patch)


def test_a_place_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="finite"):
        SlipMap().travel(0.1, np.array((0.0, math.inf, 0.0)), AHEAD)


def test_places_outside_the_map_are_left_out():
    elevation, layers = plain()
    found = driven(1.0, start=(400.0, -1e9))
    assert not found.layer(elevation, layers["slope"]).any()


def test_a_robot_backs_off_once_when_its_wheels_spin():
    backing = BackOff()
    drives = [backing.due(0.1 * step, 0.03 * step, 0.0, 0.0, step >= 10) for step in range(60)]
    assert not any(drives[:10]) and all(drives[10:35]) and not any(drives[35:])


def test_a_robot_that_stands_backs_off_after_a_while():
    backing = BackOff()
    drives = [backing.due(0.1 * step, 1.0, 2.0, 0.0, False) for step in range(40)]
    assert not any(drives[:20]) and all(drives[21:40])
    turning = BackOff()
    assert not any(turning.due(0.1 * step, 1.0, 2.0, 0.1 * step, False) for step in range(100))
