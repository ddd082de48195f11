# SPDX-License-Identifier: BSD-3-Clause
"""A centre of mass that is moved while the link lives: as if it had been built so, without a jolt."""
import math
from dataclasses import replace

import numpy as np
import pytest

from conftest import ENGINES, at
from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import IDENTITY, quaternion_from_rpy, rotate
from m2wr_sim.model.types import Axis, Box, Collision, Inertial, Joint, Link, Model
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine as engine_of_kind
from m2wr_sim.runtime import changes
from test_mesh_kernels import block

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
LOW = (0.0, 0.1, -0.4)


def inertial(com=(0.0, 0.0, 0.0), mass=2.0, moment=0.05):
    return Inertial(mass, (com, UPRIGHT), (moment, 0.0, 0.0, moment, 0.0, moment))


def pendulum(com=(0.0, 0.0, 0.0), kind="revolute"):
    """Return a base on the ground, an arm on a joint along x, and a tip on the arm."""
    base = Link("base", inertial=inertial(mass=50.0, moment=5.0), collisions=(Collision("c", Box((1.0, 1.0, 0.2))),))
    arm = Link("arm", ((0.0, 0.0, 2.0), quaternion_from_rpy(0.0, 0.0, 0.3)), inertial=inertial(com),
               collisions=(Collision("c", Box((0.1, 0.1, 0.1)), pose=((0.1, 0.2, 0.3), UPRIGHT)),))
    tip = Link("tip", ((0.0, 0.0, 1.5), UPRIGHT), inertial=inertial(mass=0.1, moment=0.001))
    joints = (Joint("swing", kind, "base", "arm", axis=Axis(xyz=(1.0, 0.0, 0.0))),
              Joint("wrist", "revolute", "arm", "tip", axis=Axis(xyz=(1.0, 0.0, 0.0))))
    return Model("pendulum", (base, arm, tip), joints, pose=at(z=0.1))


def numbers(engine, handle):
    """Return all poses, velocities and angles of a model."""
    found = []
    for link in handle.links.values():
        for part in engine.link_state(link):
            found += list(part)
    return found + [engine.joint_angle(joint) for joint in handle.joints.values()] + [
        engine.joint_rate(joint) for joint in handle.joints.values()]


@pytest.fixture
def worlds(make_engine, build):
    """Return a function that makes a pendulum on the ground."""
    def make(com=(0.0, 0.0, 0.0), kind="revolute"):
        engine = make_engine(1.0, [build.ground(), pendulum(com, kind)])
        return engine, engine.handles[1]
    return make


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "fixed", "ball", "universal"])
def test_it_swings_as_one_that_was_built_so(worlds, kind):
    (engine, handle), (other, built) = worlds(kind=kind), worlds(LOW, kind)
    engine.set_link_inertial(handle.links["arm"], inertial(LOW))
    assert numbers(engine, handle) == pytest.approx(numbers(other, built), abs=1e-12)
    for one, its in ((engine, handle), (other, built)):
        one.set_link_velocity(its.links["tip"], (0.0, 0.2, 0.0), (0.3, 0.0, 0.0))
        one.step(500)
    assert numbers(engine, handle) == pytest.approx(numbers(other, built), abs=1e-7)


def test_nothing_jumps_when_it_changes_in_full_swing(worlds):
    engine, handle = worlds()
    engine.set_joint_motor(handle.joints["swing"], 5.0, 40.0)
    engine.set_joint_motor(handle.joints["wrist"], -7.0, 1.0)
    engine.step(2000)
    assert abs(engine.joint_angle(handle.joints["swing"])) > 2.0 * math.pi      # so it has counted turns
    before = numbers(engine, handle)
    engine.set_link_inertial(handle.links["arm"], inertial(LOW))
    assert numbers(engine, handle) == pytest.approx(before, abs=1e-9)
    engine.step(1)
    assert numbers(engine, handle) == pytest.approx(before, abs=0.3)            # joints hold where they held
    engine.set_link_inertial(handle.links["arm"], inertial())
    engine.step(1)
    assert numbers(engine, handle)[:3] == pytest.approx(before[:3], abs=0.01)


def test_shapes_stay_on_the_link(worlds):
    engine, handle = worlds()
    arm = handle.links["arm"]
    poses = np.zeros((1, 7))
    reader = engine.pose_reader([(arm, ((0.1, 0.2, 0.3), UPRIGHT))], poses)
    places = []
    for _ in range(2):
        reader()
        geom = engine._links[arm].geoms[0][0]
        places += [tuple(poses[0, :3]), geom.getPosition()]
        engine.set_link_inertial(arm, inertial(LOW))
    for place in places[1:]:
        assert place == pytest.approx(places[0], abs=1e-12)


def test_meshes_stay_on_the_link(make_engine, build):
    crate = build.one_link("crate", block((0.4, 0.4, 0.4)), build.at(z=0.2), static=False)
    engine = make_engine(1.0, [build.ground(), crate])
    link = engine.handles[1].links["link"]
    engine.step(500)
    before = engine.link_pose(link)
    engine.set_link_inertial(link, inertial((0.05, 0.0, -0.1)))
    engine.step(500)                                                    # a mesh that had moved along would fall or tilt
    for now, then in zip(engine.link_pose(link), before):
        assert now == pytest.approx(then, abs=1e-4)


def test_engines_agree_to_the_bit(build):
    found = []
    for kind in ENGINES:
        engine = engine_of_kind(kind, EngineSettings())
        engine.add_model(build.ground(), IDENTITY)
        handle = engine.add_model(pendulum(), at(0.3, z=0.1))
        engine.set_joint_motor(handle.joints["swing"], 5.0, 40.0)
        engine.step(300)
        engine.set_link_inertial(handle.links["arm"], inertial(LOW))
        engine.step(300)
        found.append(numbers(engine, handle))
        engine.close()
    assert all(entry == found[0] for entry in found)


def test_a_free_body_turns_about_its_new_centre(make_engine):
    box = Model("box", (Link("link", gravity=False, inertial=inertial()),))
    engine = make_engine(1.0, [box])
    link = engine.handles[0].links["link"]
    engine.set_link_velocity(link, (0.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    engine.set_link_inertial(link, inertial((0.5, 0.0, 0.0)))
    state = engine.link_state(link)
    assert state.linear_velocity == pytest.approx((0.0, 0.0, 0.0)) and state.angular_velocity == (0.0, 0.0, 2.0)
    engine.step(500)
    position, turn = engine.link_pose(link)
    centre = tuple(a + b for a, b in zip(position, rotate(turn, (0.5, 0.0, 0.0))))
    assert centre == pytest.approx((0.5, 0.5, 0.0), abs=1e-9)           # it kept its velocity of 1 m/s


@pytest.mark.parametrize("solve, tips", [(True, True), (False, False)])
def test_a_robot_tips_over_where_it_is_asked_to_act(make_rig, build, solve, tips):
    crate = build.box("crate", 0.0, 0.0, 0.5, size=(1.0, 1.0, 1.0), static=False, mass=2.0)
    rig = make_rig(crate)
    model = rig.simulator.models["crate"]
    old = model.record.links[0].inertial
    moved = replace(old, pose=((0.0, 0.8, 0.0), UPRIGHT))
    changes.set_link_properties(rig.simulator, model, "link", True, moved, solve)
    assert model.record.links[0].inertial.pose[0] == (0.0, 0.8, 0.0)
    rig.run(2.0)
    assert (abs(rig.pose("crate")[1][0]) > 0.3) is tips


def test_a_centre_far_away_is_refused_and_nothing_is_stored(make_rig, build):
    rig = make_rig(build.box("a", 0.0, 0.0, 50.0, static=False))
    model = rig.simulator.models["a"]
    before = model.record
    with pytest.raises(ModelError, match="a::link: centre of mass at .* expected at most 100 m"):
        changes.set_link_properties(rig.simulator, model, "link", True, replace(
            before.links[0].inertial, pose=((0.0, 1e300, 0.0), UPRIGHT)), solve=True)
    assert model.record is before
