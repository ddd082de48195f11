# SPDX-License-Identifier: BSD-3-Clause
"""The surface a pair of collisions makes, and the choice among its contacts."""
import math
from dataclasses import replace

import pytest

from m2wr_sim.model.types import Box, Collision, Cylinder, Plane, Sphere, Surface
from m2wr_sim.physics import contacts
from m2wr_sim.physics.contacts import merge, pair_surface, spread
from m2wr_sim.physics.engine import EngineSettings

SETTINGS = EngineSettings(step_ns=1000000)
UP = (0.0, 0.0, 1.0)


def collision(geometry=Sphere(0.1), max_contacts=10, **surface):
    return Collision("c", geometry, surface=Surface(**surface), max_contacts=max_contacts)


def pair(one, two, wheel=False, both_move=False, settings=SETTINGS):
    """Return the surface of a pair, having checked that the order of the two does not matter."""
    surface = pair_surface(one, two, wheel, False, both_move, settings)
    assert surface == pair_surface(two, one, False, wheel, both_move, settings)
    return surface


# -- friction -----------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("one, two, mu", [
    (1.0, 100.0, 1.0), (0.0, 100.0, 0.0), (0.0, 0.0, 0.0), (0.3, 0.2, 0.2), (-1.0, 0.7, 0.7), (-1.0, -1.0, math.inf)])
def test_the_smaller_friction_holds_and_negative_means_endless(one, two, mu):
    surface = pair(collision(mu=one, mu2=one), collision(mu=two, mu2=two))
    assert surface.mu == surface.mu2 == mu
    assert surface.mode == contacts.MODE_APPROX1


def test_a_different_second_friction_is_asked_for():
    surface = pair(collision(mu=1.0, mu2=0.4), collision(mu=2.0, mu2=2.0))
    assert (surface.mu, surface.mu2) == (1.0, 0.4) and surface.mode & contacts.MODE_MU2


@pytest.mark.parametrize("mu", [1.0, 0.1, 0.0])
def test_a_wheel_has_the_friction_of_everything_else(mu):
    floor = collision(mu=100.0, mu2=100.0)
    assert pair(collision(mu=mu, mu2=mu), floor, wheel=True).mu == pair(collision(mu=mu, mu2=mu), floor).mu == mu


def test_slip_adds_up_where_there_is_friction():
    surface = pair(collision(slip1=0.3, slip2=0.1), collision(slip1=0.2))
    assert (surface.slip1, surface.slip2) == pytest.approx((0.5, 0.1))
    assert surface.mode & contacts.MODE_SLIP1 and surface.mode & contacts.MODE_SLIP2
    smooth = pair(collision(mu=0.0, mu2=0.0, slip1=1.0, slip2=1.0), collision())
    assert not smooth.mode & (contacts.MODE_SLIP1 | contacts.MODE_SLIP2)
    assert not pair(collision(), collision()).mode & (contacts.MODE_SLIP1 | contacts.MODE_SLIP2)


# -- stiffness and bounce -----------------------------------------------------------------------------------------

def test_gazebos_default_stiffness_means_a_rigid_contact():
    surface = pair(collision(), collision())
    assert (surface.soft_erp, surface.soft_cfm) == (0.0, 0.0)
    assert not surface.mode & (contacts.MODE_SOFT_ERP | contacts.MODE_SOFT_CFM)


@pytest.mark.parametrize("step_ms", [1, 5])
def test_stiffness_combines_as_springs_in_series(step_ms):
    settings = replace(SETTINGS, step_ns=step_ms * 1000000)
    surface = pair(collision(kp=3000.0, kd=10.0), collision(kp=6000.0, kd=20.0), settings=settings)
    step, stiffness, damping = step_ms * 1e-3, 2000.0, 30.0
    assert surface.soft_erp == pytest.approx(step * stiffness / (step * stiffness + damping))
    assert surface.soft_cfm == pytest.approx(1.0 / (step * stiffness + damping))
    assert surface.mode & contacts.MODE_SOFT_ERP and surface.mode & contacts.MODE_SOFT_CFM


def test_a_soft_body_on_a_rigid_one_is_as_soft_as_itself():
    surface = pair(collision(kp=1e5, kd=0.0), collision(kd=0.0))
    assert surface.soft_cfm == pytest.approx(1.0 / (1e-3 * 1e5), rel=1e-6) and surface.soft_erp == pytest.approx(1.0)


@pytest.mark.parametrize("kp, kd", [(1e11, 1.0), (9.9e11, 1e9), (1e6, 1e12)])
def test_contacts_stay_soft_enough_for_the_solver(kp, kd):
    assert pair(collision(kp=kp, kd=kd), collision()).soft_cfm == contacts.MIN_SOFT_CFM


@pytest.mark.parametrize("kp, kd", [(0.0, 0.0), (0.0, 1.0), (100.0, -5.0)])
def test_senseless_stiffness_gives_finite_numbers(kp, kd):
    surface = pair(collision(kp=kp, kd=kd), collision())
    assert 0.0 <= surface.soft_erp <= 1.0 and contacts.MIN_SOFT_CFM <= surface.soft_cfm < math.inf


def test_the_smaller_bounce_holds():
    assert not pair(collision(restitution=0.8), collision()).mode & contacts.MODE_BOUNCE
    surface = pair(collision(restitution=0.8, restitution_threshold=0.5), collision(restitution=0.3))
    assert surface.mode & contacts.MODE_BOUNCE and (surface.bounce, surface.bounce_velocity) == (0.3, 0.5)


# -- whether and how many -----------------------------------------------------------------------------------------

@pytest.mark.parametrize("one, two, meet", [
    (0xffff, 0xffff, True), (0x01, 0x02, False), (0x03, 0x02, True), (0x00, 0xffff, False)])
def test_bitmasks_decide_who_meets(one, two, meet):
    assert (pair(collision(collide_bitmask=one), collision(collide_bitmask=two)) is not None) is meet


def test_collide_without_contact_makes_no_contacts():
    assert pair(collision(collide_without_contact=True), collision()) is None


@pytest.mark.parametrize("one, two, limit", [
    (collision(), collision(), 10), (collision(max_contacts=3), collision(), 3),
    (collision(max_contacts=0), collision(), 1),
    (collision(max_contacts=99), collision(max_contacts=99), 20), (collision(Box((1, 1, 1))), collision(), 4),
    (collision(Box((1, 1, 1)), max_contacts=2), collision(), 2)])
def test_the_smallest_limit_on_contacts_holds(one, two, limit):
    assert pair(one, two).max_contacts == limit


def test_only_a_plane_under_a_body_is_ground():
    plane, wheel = collision(Plane()), collision(Cylinder(0.1, 0.04))
    assert pair(wheel, plane, wheel=True).ground and pair(wheel, plane, wheel=True).merge
    assert not pair(wheel, collision(Box((1, 1, 1))), wheel=True).ground
    assert not pair(wheel, plane, both_move=True).ground and not pair(wheel, plane).merge


# -- merging ------------------------------------------------------------------------------------------------------

def test_rim_contacts_merge_at_the_greatest_depth():
    position, normal, depth = merge([((1.0, 0.02, 0.0), UP, 1e-4), ((1.0, -0.02, 0.0), UP, 3e-4)])
    assert position == pytest.approx((1.0, 0.0, 0.0)) and normal == pytest.approx(UP) and depth == 3e-4


def test_the_merged_normal_has_unit_length():
    tilt = math.radians(20.0)
    _, normal, _ = merge([((0, 0, 0), (math.sin(tilt), 0.0, math.cos(tilt)), 1e-4),
                          ((0, 0, 0), (-math.sin(tilt), 0.0, math.cos(tilt)), 1e-4)])
    assert normal == pytest.approx(UP)


def test_a_single_contact_stays_what_it_is():
    position, normal, depth = merge([((1.0, 2.0, 3.0), (0.6, 0.0, 0.8), 0.01)])
    assert (position, depth) == ((1.0, 2.0, 3.0), 0.01) and normal == pytest.approx((0.6, 0.0, 0.8))


@pytest.mark.parametrize("deepest", [0, 1])
def test_normals_that_cancel_leave_the_deepest(deepest):
    found = [((0.1, 0, 0), (-1.0, 0, 0), 1e-3), ((-0.1, 0, 0), (1.0, 0, 0), 1e-3)]
    found[deepest] = found[deepest][:2] + (2e-3,)
    assert merge(found) == found[deepest]


def test_opposite_contacts_without_depth_leave_the_first():
    found = [((0.1, 0, 0), (-1.0, 0, 0), 0.0), ((-0.1, 0, 0), (1.0, 0, 0), 0.0)]
    assert merge(found) == found[0]


# -- spreading ----------------------------------------------------------------------------------------------------

CORNERS = [((x, y, 0.0), UP, 1e-4) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
MIDDLES = [((0.0, 0.9, 0.0), UP, 1e-4), ((0.9, 0.0, 0.0), UP, 1e-4), ((0.0, 0.0, 0.0), UP, 1e-4)]


def test_four_of_many_are_the_corners():
    assert spread(MIDDLES[:2] + CORNERS[:3] + MIDDLES[2:] + CORNERS[3:], 4)[0] in (MIDDLES[0], CORNERS[0])
    deep = [contact[:2] + (2e-4,) for contact in CORNERS[:1]]
    assert spread(MIDDLES + deep + CORNERS[1:], 4) == deep + CORNERS[1:]


def test_the_deepest_is_always_kept():
    for index, contact in enumerate(CORNERS + MIDDLES):
        found = CORNERS + MIDDLES
        found[index] = contact[:2] + (5e-3,)
        assert found[index] in spread(found, 2)


def test_those_chosen_keep_their_order_and_are_different():
    found = CORNERS + MIDDLES + [contact[:2] + (1.0,) for contact in CORNERS]
    for limit in range(1, len(found) + 1):
        chosen = spread(found, limit)
        places = [found.index(contact) for contact in chosen]
        assert len(chosen) == limit and places == sorted(places)


def test_contacts_in_one_place_can_still_be_chosen_from():
    found = [((0.0, 0.0, 0.0), UP, 1e-4)] * 6
    assert len(spread(found, 4)) == 4


# -- the direction of friction --------------------------------------------------------------------------------------

def test_friction_direction_of_the_first_shape_has_priority():
    plain, east, up = collision(), collision(fdir1=(2.0, 0.0, 0.0)), collision(fdir1=(0.0, 0.0, 1.0))
    for one, two, along, second in ((plain, plain, (0.0, 0.0, 0.0), False), (east, up, (1.0, 0.0, 0.0), False),
                                    (up, east, (0.0, 0.0, 1.0), False), (plain, east, (1.0, 0.0, 0.0), True)):
        surface = pair_surface(one, two, False, False, False, SETTINGS)
        assert (surface.along, surface.along_second) == (along, second)
        assert bool(surface.mode & contacts.MODE_FDIR1) is any(along)


def test_a_direction_of_friction_lies_in_the_surface_or_is_none():
    assert contacts.along_surface((0.6, 0.0, 0.8), UP) == pytest.approx((1.0, 0.0, 0.0))
    assert contacts.along_surface((-0.03, 0.0, -1.0), UP) == pytest.approx((-1.0, 0.0, 0.0))
    assert contacts.along_surface((0.01, 0.0, 1.0), UP) is None
