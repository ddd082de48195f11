# SPDX-License-Identifier: BSD-3-Clause
"""Generated buildings: repeatable, with places that can be visited."""
import numpy as np
import pytest

from m2wr_tools.buildings.free_path import FreeSpace, NoPathError
from m2wr_tools.buildings.generators import KINDS, LANE, ROOM, generate

kinds = pytest.mark.parametrize("kind", sorted(KINDS))


@kinds
def test_a_seed_repeats_a_building(kind):
    one, other, another = (generate(kind, np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert one.sdf() == other.sdf() != another.sdf()


@pytest.mark.parametrize("kind, seed", [(kind, seed) for kind in sorted(KINDS)
                                        for seed in range(1 if kind == "large" else 3)])
def test_places_are_free_and_nearly_all_connected(kind, seed):
    plan = generate(kind, np.random.default_rng(seed))
    assert len(plan.places) >= 2 and (plan.clearance(plan.places) >= ROOM - 1e-9).all()
    space, closed = FreeSpace(plan), 0
    for place in plan.places[1:]:
        try:
            space.path(place, plan.places[0])
        except NoPathError:
            closed += 1                 # furniture may stand in front of a door
    assert closed <= 0.1 * len(plan.places)


def test_a_large_building_has_its_extent_and_long_loops():
    for seed in range(3):
        plan = generate("large", np.random.default_rng(seed))
        x0, y0, x1, y1 = plan.bounds
        assert 85.0 < x1 - x0 < 115.0 and 50.0 < y1 - y0 < 72.0
        far = np.hypot(*(plan.places[:, None] - plan.places[None]).transpose(2, 0, 1))
        again = np.argwhere(np.triu(far < 1.5, 4))              # back at a place after four others or more
        assert plan.in_order and len(again) > 5


def test_aisles_are_equal():
    """A scan in the middle of each aisle is the same, but for how far the store extends at its ends."""
    plan = generate("aisles", np.random.default_rng(1))
    xs = np.unique(plan.walls[plan.walls[:, 0] == plan.walls[:, 2], 0])
    gaps = np.diff(xs)
    assert len(gaps) >= 9
    assert np.ptp(gaps[::2]) < 1e-9 and np.ptp(gaps[1::2]) < 1e-9 and gaps[0] > gaps[1] + 0.3


def test_free_space_in_parts_is_that_of_the_whole_plan():
    plan = generate("hall", np.random.default_rng(1))
    space = FreeSpace(plan, 0.5)
    assert (space.free == (plan.clearance(space.centres) >= 0.5)).all()
    assert 0.2 < space.free.mean() < 1.0


def test_furniture_leaves_a_lane():
    plan = generate("hall", np.random.default_rng(2))
    others = np.array([[x, y] for x, y, *_ in plan.boxes])
    bare = type(plan)(plan.name, plan.walls, plan.glass, np.empty((0, 5)), np.empty((0, 3)), plan.places)
    reach = 0.5 * np.hypot(plan.boxes[:, 2], plan.boxes[:, 3])
    assert (bare.clearance(others) - reach >= LANE - 1e-9).all()


@pytest.mark.parametrize("share, least, most", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.3, 0.1, 0.5)])
def test_the_share_of_glass_is_as_requested(share, least, most):
    glass = np.concatenate([generate("office", np.random.default_rng(seed), share).glass for seed in range(3)])
    assert least <= glass.mean() <= most


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="no kind of building 'castle'; expected one of aisles, corridors"):
        generate("castle", np.random.default_rng(1))
