# SPDX-License-Identifier: BSD-3-Clause
"""Floors that lie in one plane are one floor: their number changes no motion."""
import math

import pytest

from m2wr_sim.model.types import Axis, Box, Collision, Inertial, Joint, Link, Model, Plane, Sphere, Surface
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.contacts import is_repeated
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.pyode_engine import PyodeEngine
from m2wr_sim.physics.step_layout import SAME_DEPTH, SAME_PLACE

pytest.importorskip("numba", reason="the compiled loop needs numba")
native_ode.publish_symbols()
native = pytest.importorskip("m2wr_sim.physics.native_engine")
ENGINES = [PyodeEngine, native.NativeEngine]
NO_TURN = (0.0, 0.0, 0.0, 1.0)
GRIP, SLIPPERY = Surface(mu=100.0, mu2=100.0), Surface(mu=0.5, mu2=0.2, fdir1=(0.5, 0.0, 0.0))
SLAB = Box((20.0, 20.0, 0.2))       # its top is at 0 if it is at -0.1


def cart():
    """A body of 36 kg on four balls that do not rotate, between two driven ones: six contacts."""
    balls = [Collision("ball%d" % number, Sphere(0.038), ((x, y, -0.038), NO_TURN), SLIPPERY)
             for number, (x, y) in enumerate([(0.165, 0.155), (0.165, -0.155), (-0.22, 0.155), (-0.22, -0.155)])]
    body = Link("body", inertial=Inertial(36.0, inertia=(1.7, 0.0, 0.0, 0.9, 0.0, 2.6)), collisions=tuple(balls))
    wheels = [Link(name, ((0.0, y, 0.0), NO_TURN), Inertial(1.8, inertia=(0.004, 0.0, 0.0, 0.004, 0.0, 0.0074)),
                   (Collision(name, Sphere(0.0765), ((0.0, 0.0, 0.0), NO_TURN), GRIP),))
              for name, y in (("left", 0.26), ("right", -0.26))]
    return Model("cart", (body, *wheels), tuple(
        Joint(name, "revolute", "body", name, axis=Axis((0.0, 1.0, 0.0))) for name in ("left", "right")))


def ground(geometry=Plane()):
    return Model("floor", (Link("link", collisions=(Collision("shape", geometry, surface=Surface(100.0, 50.0)),)),),
                 static=True)


def drive(engine_class, floors, steps=200):
    """Drive straight on among static shapes with steps of 10 ms; return the states of the body, and contact events.

    Of each shape there are the geometry, the height and, if it is not 0, its x.
    """
    engine = engine_class(EngineSettings(step_ns=10000000, max_correcting_velocity=100.0))
    engine.reseed(7)
    for number, (geometry, height, *x) in enumerate(floors):
        engine.add_model(ground(geometry), ((x[0] if x else 0.0, 0.0, height), NO_TURN), "floor%d" % number)
    handle = engine.add_model(cart(), ((0.0, 0.0, 0.076), NO_TURN), "cart")
    states = []
    for step in range(steps):
        for name in ("left", "right"):
            engine.set_joint_motor(handle.joints[name], 0.0 if step < 50 else 5.0, 20.0)
        engine.step(1)
        states.append(engine.link_state(handle.links["body"]))
    events = engine.drain_contact_events()
    engine.close()
    return states, events


ONE = [(Plane(), 0.0)]


@pytest.mark.parametrize("floors", [ONE * 2, ONE * 17, [(SLAB, -0.1)] * 3], ids=["2 planes", "17 planes", "3 slabs"])
def test_floors_in_one_plane_are_one_floor(floors):
    alone, slow, fast = (drive(engine_class, there)[0] for engine_class, there in (
        (PyodeEngine, floors[:1]), (PyodeEngine, floors), (native.NativeEngine, floors)))
    assert fast == slow
    assert [state.position for state in slow] == [pytest.approx(state.position, abs=1e-6) for state in alone]
    assert alone[-1].position[0] > 0.5 and abs(slow[-1].position[1]) < 1e-6


def test_a_plane_and_a_slab_are_the_same_for_both_engines():
    slow, fast = (drive(engine_class, ONE + [(SLAB, -0.1)])[0] for engine_class in ENGINES)
    assert fast == slow


@pytest.mark.parametrize("engine_class", ENGINES)
def test_a_body_on_two_tiles_stands_on_both(engine_class):
    tile = Box((1.0, 2.0, 0.2))
    engine = engine_class(EngineSettings(step_ns=5000000))
    for number, x in enumerate((-0.5, 0.5)):
        engine.add_model(ground(tile), ((x, 0.0, -0.1), NO_TURN), "tile%d" % number)
    body = Link("link", collisions=(Collision("shape", Box((1.0, 0.4, 0.2))),))
    handle = engine.add_model(Model("body", (body,)), ((0.1, 0.0, 0.1), NO_TURN), "body")
    engine.step(200)
    position, orientation = engine.link_pose(handle.links["link"])
    assert position == pytest.approx((0.1, 0.0, 0.1), abs=2e-3) and abs(orientation[1]) < 1e-3
    engine.close()


def test_contacts_with_two_walls_at_one_place_are_both_told():
    wall = Box((0.2, 4.0, 1.0))
    results = [drive(engine_class, ONE + [(wall, 0.5, 0.4)] * 2)[1] for engine_class in ENGINES]
    names = [{(event.first, event.second) for event in found} for found in results]
    assert names[0] == names[1]
    assert {first.split("::")[0] for pair in names[0] for first in pair} == {"cart", "floor1", "floor2"}


def test_contacts_are_one_at_one_place_in_one_direction_as_deep():
    up, tilted = (0.0, 0.0, 1.0), (math.sin(0.01), 0.0, math.cos(0.01))
    here = ((1.0, 2.0, 0.0), up, 0.001)
    assert is_repeated(here, ((1.0, 2.0, 0.1), up, 0.001))          # along the normal places differ by shape
    for other in (((1.0 + 2.0 * SAME_PLACE, 2.0, 0.0), up, 0.001), ((1.0, 2.0, 0.0), tilted, 0.001),
                  ((1.0, 2.0, 0.0), up, 0.001 + 2.0 * SAME_DEPTH), ((1.0, 2.0, 0.0), (0.0, 0.0, -1.0), 0.001)):
        assert not is_repeated(here, other)
