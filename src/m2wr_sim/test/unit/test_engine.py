# SPDX-License-Identifier: BSD-3-Clause
"""Bodies in the engine, against closed forms; frames, contacts, and models that are refused."""
import math
from dataclasses import replace

import pytest

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import compose, quaternion_from_rpy, rotate
from m2wr_sim.model.types import Box, Collision, Cylinder, Inertial, Joint, Link, Model, Physics, Plane, Sphere, Surface
from m2wr_sim.physics.engine import ContactEvent, settings_from_physics

GRAVITY = 9.8
SMALL = Inertial(1.0, inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01))


def root_of(engine, index):
    """Return the number of the first link of the model added as number ``index``."""
    return next(iter(engine.handles[index].links.values()))


def state_of(engine, index=-1):
    return engine.link_state(root_of(engine, index))


# -- falling and resting ------------------------------------------------------------------------------------------

@pytest.mark.parametrize("step_ms", [1, 5])
def test_free_fall_is_the_integrators_closed_form(make_engine, build, step_ms):
    engine = make_engine(step_ms, [build.ground(), build.box("box", 0, 0, 50.0, static=False)])
    count, step = 400 // step_ms, step_ms * 1e-3
    engine.step(count)
    state = state_of(engine)
    assert state.linear_velocity[2] == pytest.approx(-GRAVITY * count * step)
    assert state.position[2] == pytest.approx(50.0 - GRAVITY * step * step * count * (count + 1) / 2)


@pytest.mark.parametrize("step_ms", [1, 2, 5, 10])
@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder"])
def test_a_dropped_body_comes_to_rest_on_the_ground(make_engine, build, kind, step_ms):
    body, height = {"box": (build.box("b", 0, 0, 0.6, static=False), 0.25),
                    "sphere": (build.sphere("b", 0, 0, 0.6, static=False), 0.25),
                    "cylinder": (build.cylinder("b", 0, 0, 0.9, static=False), 0.5)}[kind]
    engine = make_engine(step_ms, [build.ground(), body])
    engine.step(2000 // step_ms)
    before = state_of(engine).position
    engine.step(3000 // step_ms)
    position, orientation, linear, angular = state_of(engine)
    assert position == pytest.approx((0.0, 0.0, height), abs=1e-3)
    assert position == pytest.approx(before, abs=1e-5)
    assert max(map(abs, linear + angular)) < 1e-4 and abs(orientation[3]) > 0.99999
    assert engine.drain_contact_events() == []   # standing is no contact event


@pytest.mark.parametrize("step_ms", [1, 5])
@pytest.mark.parametrize("kind", ["box", "sphere"])
def test_a_dropped_body_never_gains_energy(make_engine, build, kind, step_ms):
    tilted = ((0.0, 0.0, 1.0), quaternion_from_rpy(0.4, 0.7, 0.2))
    geometry = Box((0.5, 0.4, 0.3)) if kind == "box" else Sphere(0.25)
    engine = make_engine(step_ms, [build.ground(mu=0.5), build.one_link("b", geometry, tilted, static=False)])
    engine.set_link_velocity(root_of(engine, 1), (0.8, 0.3, 0.0), (1.0, 2.0, 0.5))
    ixx, _, _, iyy, _, izz = build.one_link("b", geometry, tilted).links[0].inertial.inertia

    def energy():
        position, orientation, linear, angular = state_of(engine)
        own = rotate((-orientation[0], -orientation[1], -orientation[2], orientation[3]), angular)
        turning = ixx * own[0] ** 2 + iyy * own[1] ** 2 + izz * own[2] ** 2
        return GRAVITY * position[2] + 0.5 * sum(v * v for v in linear) + 0.5 * turning

    energies = [energy()]
    for _ in range(3000 // step_ms):
        engine.step(1)
        energies.append(energy())
    # what sank in by up to one step of its fall is lifted out again, at 0.1 m/s: that much, and no more, comes back
    lift = GRAVITY * step_ms * 1e-3 * math.sqrt(2.0 * energies[0]) + 0.5 * 0.1 ** 2
    lowest = energies[0]
    for value in energies:
        assert value < lowest + lift
        lowest = min(lowest, value)
    assert energies[-1] < 0.5 * energies[0]


def test_boxes_stack(make_engine, build):
    boxes = [build.box("b%d" % level, 0.01 * level, 0, 0.3 + 0.52 * level, static=False) for level in range(3)]
    engine = make_engine(2, [build.ground()] + boxes)
    engine.step(2000)
    heights = [state_of(engine, 1 + level).position[2] for level in range(3)]
    assert heights == pytest.approx([0.25, 0.75, 1.25], abs=2e-3)


def test_a_plane_keeps_its_normal_whatever_its_pose(make_engine, build):
    lying = build.one_link("ground", Plane(), ((3.0, 4.0, 0.7), quaternion_from_rpy(0.3, 0.4, 0.0)))
    engine = make_engine(2, [lying, build.sphere("ball", 5.0, 5.0, 1.0, static=False)])
    engine.step(1000)
    assert state_of(engine).position == pytest.approx((5.0, 5.0, 0.95), abs=1e-3)


@pytest.mark.parametrize("mu, slides", [(1.0, False), (0.5, True), (0.0, True)])
def test_friction_on_a_slope(make_engine, build, mu, slides):
    angle = math.radians(35.0)
    engine = make_engine(1, [build.ground(), build.box("b", 0, 0, 0.1, size=(0.4, 0.4, 0.2), static=False,
                                                       surface=Surface(mu=mu, mu2=mu))])
    engine.step(200)
    engine.set_gravity((GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle)))
    engine.step(500)
    expected = GRAVITY * (math.sin(angle) - mu * math.cos(angle)) * 0.5 if slides else 0.0
    assert state_of(engine).linear_velocity[0] == pytest.approx(expected, rel=0.03, abs=2e-3)


@pytest.mark.parametrize("surface", [Surface(collide_bitmask=0x02), Surface(collide_without_contact=True)])
def test_what_makes_no_contacts_falls_through(make_engine, build, surface):
    floor = build.one_link("ground", Plane(), build.at(), surface=Surface(collide_bitmask=0x01))
    engine = make_engine(2, [floor, build.box("b", 0, 0, 0.3, static=False, surface=surface)])
    engine.step(500)
    assert state_of(engine).position[2] < -3.0


def test_bouncing_follows_restitution(make_engine, build):
    bouncy = Surface(restitution=0.5, restitution_threshold=0.01)
    engine = make_engine(1, [build.one_link("g", Plane(), build.at(), surface=bouncy),
                             build.sphere("ball", 0, 0, 1.25, static=False, surface=bouncy)])
    fastest = 0.0
    for _ in range(900):
        engine.step(1)
        fastest = max(fastest, state_of(engine).linear_velocity[2])
    assert fastest == pytest.approx(0.5 * math.sqrt(2 * GRAVITY * 1.0), rel=0.03)


@pytest.mark.parametrize("values, height", [({"gravity": False}, 3.0), ({"kinematic": True}, 3.0),
                                            ({"static": True}, 3.0)])
def test_what_does_not_fall_stays(make_engine, build, values, height):
    engine = make_engine(2, [build.ground(), build.box("b", 0, 0, height, **dict({"static": False}, **values))])
    engine.step(500)
    assert state_of(engine).position[2] == pytest.approx(height, abs=1e-12)


def test_velocity_decay_slows_by_its_share_each_step(make_engine, build):
    body = build.box("b", 0, 0, 9, static=False, gravity=False, linear_damping=0.01, angular_damping=0.02)
    engine = make_engine(1, [body])
    engine.set_link_velocity(root_of(engine, 0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    engine.step(100)
    state = state_of(engine)
    assert state.linear_velocity[0] == pytest.approx(0.99 ** 100)
    assert state.angular_velocity[2] == pytest.approx(0.98 ** 100)


def test_a_sleeping_body_wakes_when_what_it_rests_on_goes(make_engine, build):
    engine = make_engine(2, [build.ground(), build.box("table", 0, 0, 0.5, size=(1, 1, 1)),
                             build.box("b", 0, 0, 1.26, static=False)])
    engine.step(3000)
    assert state_of(engine).position[2] == pytest.approx(1.25, abs=1e-3)
    engine.remove_model(engine.handles[1])
    engine.step(500)
    assert state_of(engine).position[2] == pytest.approx(0.25, abs=1e-2)


def test_a_sleeping_body_wakes_when_what_it_rests_on_is_moved(make_engine, build):
    engine = make_engine(2, [build.ground(), build.box("table", 0, 0, 0.5, size=(1, 1, 1)),
                             build.box("b", 0, 0, 1.26, static=False)])
    engine.step(3000)
    engine.set_link_pose(root_of(engine, 1), build.at(x=5.0, z=0.5))
    engine.step(500)
    assert state_of(engine).position[2] == pytest.approx(0.25, abs=1e-2)


def test_a_sleeping_body_feels_new_gravity(make_engine, build):
    engine = make_engine(2, [build.ground(), build.box("b", 0, 0, 0.26, static=False)])
    engine.step(3000)
    engine.set_gravity((0.0, 0.0, 1.0))
    engine.step(500)
    assert state_of(engine).position[2] > 0.5


# -- contacts -----------------------------------------------------------------------------------------------------

def test_a_contact_is_reported_once_until_it_ends(make_engine, build):
    engine = make_engine(1, [build.ground(), build.box("wall", 1.0, 0, 0.5, size=(0.2, 2, 1)),
                             build.sphere("ball", 0, 0, 0.25, static=False)])
    ball = root_of(engine, 2)

    def roll_against_the_wall():
        engine.set_link_pose(ball, build.at(x=0.5, z=0.25))
        engine.set_link_velocity(ball, (1.0, 0.0, 0.0), (0.0, 4.0, 0.0))
        engine.step(400)
        return engine.drain_contact_events()

    first = roll_against_the_wall()
    assert [type(contact) for contact in first] == [ContactEvent]
    assert {first[0].first, first[0].second} == {"ball::link::collision", "wall::link::collision"}
    assert 140 <= first[0].step <= 170 and 0.0 <= first[0].depth < 2e-3
    assert first[0].position == pytest.approx((0.9, 0.0, 0.25), abs=5e-3)
    assert engine.drain_contact_events() == []
    again = roll_against_the_wall()
    assert len(again) == 1 and 540 <= again[0].step <= 570


# -- frames -------------------------------------------------------------------------------------------------------

def test_a_links_velocity_is_that_of_its_frame_not_of_its_mass(make_engine):
    offset = (0.3, -0.2, 0.1)
    link = Link("link", inertial=replace(SMALL, pose=(offset, (0.0, 0.0, 0.0, 1.0))), gravity=False)
    engine = make_engine(1, [Model("m", (link,), pose=((1.0, 2.0, 3.0), quaternion_from_rpy(0.1, 0.2, 0.3)))])
    number = root_of(engine, 0)
    engine.set_link_velocity(number, (0.4, 0.5, 0.6), (0.3, -0.2, 0.9))
    before, step = state_of(engine), 1e-3
    assert before.position == pytest.approx((1.0, 2.0, 3.0))
    engine.step(1)
    moved = tuple((b - a) / step for a, b in zip(before.position, engine.link_pose(number)[0]))
    assert moved == pytest.approx(before.linear_velocity, abs=2e-3)
    arm = rotate(before.orientation, offset)
    mass_velocity = tuple(v + c for v, c in zip(before.linear_velocity, (
        before.angular_velocity[1] * arm[2] - before.angular_velocity[2] * arm[1],
        before.angular_velocity[2] * arm[0] - before.angular_velocity[0] * arm[2],
        before.angular_velocity[0] * arm[1] - before.angular_velocity[1] * arm[0])))
    assert mass_velocity == pytest.approx((0.4, 0.5, 0.6))


def test_links_start_at_model_pose_times_link_pose(make_engine):
    inner = ((0.1, 0.2, 0.3), quaternion_from_rpy(0.0, 0.3, 0.0))
    outer = ((4.0, 5.0, 6.0), quaternion_from_rpy(0.2, 0, 1.0))
    link = Link("link", inner, replace(SMALL, pose=((0.05, 0.0, 0.02), (0, 0, 0, 1))), gravity=False)
    engine = make_engine(1, [Model("m", (link,), pose=outer)])
    for wanted in (compose(outer, inner), ((-1.0, 0.0, 2.0), quaternion_from_rpy(0.5, -0.5, 2.0))):
        engine.set_link_pose(root_of(engine, 0), wanted)
        position, orientation = engine.link_pose(root_of(engine, 0))
        assert position == pytest.approx(wanted[0]) and orientation == pytest.approx(wanted[1])


def test_moving_a_static_model_moves_what_is_felt(make_engine, build):
    engine = make_engine(2, [build.ground(), build.box("step", 0, 0, 0.25),
                             build.sphere("ball", 0, 0, 0.76, static=False)])
    engine.step(300)
    assert state_of(engine).position[2] == pytest.approx(0.75, abs=1e-3)
    engine.set_link_pose(root_of(engine, 1), build.at(x=3.0, z=0.25))
    engine.step(500)
    assert state_of(engine).position[2] == pytest.approx(0.25, abs=1e-2)
    assert engine.link_pose(root_of(engine, 1))[0] == (3.0, 0.0, 0.25)


def test_collisions_are_listed_in_load_order(make_engine, m2wr, build):
    engine = make_engine(1, [build.ground(), m2wr])
    (number, _, moves), = engine.collisions(engine.handles[0])
    assert number == root_of(engine, 0) and moves is False
    rows = engine.collisions(engine.handles[1])
    assert [type(collision.geometry) for _, collision, _ in rows] == [Box, Sphere, Cylinder, Cylinder, Cylinder]
    assert all(moves for _, _, moves in rows)


# -- refused models -----------------------------------------------------------------------------------------------

BROKEN = {
    "no such shape": (Link("l", inertial=SMALL, collisions=(Collision("c", "mesh"),)),
                      "a box, sphere, cylinder, plane, mesh or heightmap"),
    "empty box": (Link("l", inertial=SMALL, collisions=(Collision("c", Box((1.0, 0.0, 1.0))),)),
                  "expected 1e-07 to 1e"),
    "thin box": (Link("l", inertial=SMALL, collisions=(Collision("c", Box((1.0, 1e-320, 1.0))),)),
                 "expected 1e-07 to 1e"),
    "not a number": (Link("l", inertial=SMALL, collisions=(Collision("c", Sphere(float("nan"))),)),
                     "expected 1e-07 to 1e"),
    "negative mass": (Link("l", inertial=replace(SMALL, mass=-1.0)), "expected a positive mass"),
    "flat inertia": (Link("l", inertial=replace(SMALL, inertia=(1, 0, 0, 0, 0, 1))), "positive definite inertia"),
    "flat plane": (Link("l", inertial=SMALL, collisions=(Collision("c", Plane((0.0, 0.0, 0.0))),)), "no direction"),
}


@pytest.mark.parametrize("case", sorted(BROKEN))
def test_a_broken_model_is_refused_and_leaves_nothing_behind(make_engine, build, case):
    engine = make_engine(1, [build.ground()])
    link, words = BROKEN[case]
    good = Link("good", inertial=SMALL, collisions=(Collision("c", Sphere(0.1)),))
    with pytest.raises(ModelError) as caught:
        engine.add_model(Model("broken", (good, link)), build.at())
    assert words in str(caught.value) and "broken::l" in str(caught.value) or case == "flat plane"
    engine.add_model(Model("broken", (good,)), build.at(z=1.0))     # the name is free, and stepping goes well
    engine.step(10)


@pytest.mark.parametrize("joint, words", [
    (Joint("j", "revolute", "good", "missing"), "connects link missing, which m does not have (it has good, other)"),
    (Joint("j", "gearbox", "good", "other"), "type gearbox")])
def test_a_broken_joint_is_refused(make_engine, build, joint, words):
    engine = make_engine(1)
    with pytest.raises(ModelError) as caught:
        engine.add_model(Model("m", (Link("good", inertial=SMALL), Link("other", inertial=SMALL)), (joint,)),
                         build.at())
    assert words in str(caught.value) and "m::j" in str(caught.value)


def test_only_the_worlds_sound_settings_are_taken():
    settings = settings_from_physics(Physics(erp=0.95, cfm=0.3, contact_surface_layer=0.01, iters=0,
                                             gravity=(0, 0, -3.7), max_contacts=0), 2000000, "quick")
    assert (settings.step_ns, settings.solver, settings.gravity) == (2000000, "quick", (0, 0, -3.7))
    assert (settings.erp, settings.cfm, settings.surface_layer) == (0.8, 1e-5, 1e-4)
    assert (settings.iterations, settings.max_contacts) == (1, 1)
