# SPDX-License-Identifier: BSD-3-Clause
"""Fields from a seed: repeatable, with room about their places, and told whether they can be solved."""
import math

import numpy as np
import pytest

from m2wr_delivery.scenario import BASE_PAD, CLEAR, NEAREST, Settings, make_scenario

FIELDS = {seed: make_scenario(seed) for seed in (1, 2)}


def test_a_seed_gives_the_same_field():
    again = make_scenario(1)
    assert np.array_equal(again.heights, FIELDS[1].heights)
    assert (again.walls, again.places, again.parcels) == (FIELDS[1].walls, FIELDS[1].places, FIELDS[1].parcels)
    assert FIELDS[1].places != FIELDS[2].places


@pytest.mark.parametrize("seed", sorted(FIELDS))
def test_places_have_level_ground_and_no_wall_but_their_own(seed):
    field = FIELDS[seed]
    for name, (x, y) in field.places.items():
        near = field.heights[np.hypot(field.grid.places[0] - x, field.grid.places[1] - y) < 0.8]
        assert np.ptp(near) < 0.01 and math.hypot(x, y) >= NEAREST
        others = field.walls[4 * field.settings.blocked:]
        assert all(wall.distance((x, y)) > CLEAR for wall in others)
    assert all(wall.distance((0.0, 0.0)) > BASE_PAD for wall in field.walls)


@pytest.mark.parametrize("seed", sorted(FIELDS))
def test_a_walled_place_cannot_be_reached_and_the_rest_can(seed):
    field = FIELDS[seed]
    assert list(field.solvable.values()) == [True] * 5 + [False]


def test_robots_stand_about_the_base():
    starts = make_scenario(0, Settings(robots=4, blocked=0, parcels=1)).starts
    assert len(starts) == 4 and all(math.hypot(x, y) == pytest.approx(1.1) for x, y, _ in starts.values())


@pytest.mark.parametrize("wrong", [{"robots": 0}, {"robots": 9}, {"parcels": 0}, {"size": 5.0}, {"radio": math.nan},
                                   {"capacity": -1.0}, {"blocked": 2, "parcels": 1}, {"limit": math.inf}])
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ValueError, match="expected"):
        Settings(**wrong)


def test_a_seed_below_0_is_refused():
    with pytest.raises(ValueError, match="seed"):
        make_scenario(-1)
