# SPDX-License-Identifier: BSD-3-Clause
"""Live models: their pose, moving and bending them, finding links and frames by name."""
import math
from dataclasses import replace

import pytest

from conftest import UPRIGHT, at
from m2wr_sim.errors import NotFoundError
from m2wr_sim.geometry import compose, invert, quaternion_from_rpy, rpy_from_quaternion
from m2wr_sim.model.types import Axis, Box, Collision, Inertial, Joint, Link, Model
from m2wr_sim.runtime.entities import LiveModel, find_frame, find_link

SMALL = Inertial(1.0, inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
CUBE = (Collision("c", Box((0.1, 0.1, 0.1))),)


def crane():
    """Return a model off its own origin: a mast that turns on a base, a boom that slides on it, a hook on the boom."""
    links = (Link("base", ((0.5, 0.0, 0.2), quaternion_from_rpy(0.0, 0.0, 0.3)), SMALL, CUBE, gravity=False),
             Link("mast", ((0.5, 0.0, 1.0), UPRIGHT), SMALL, CUBE, gravity=False),
             Link("boom", ((1.5, 0.0, 1.0), UPRIGHT), SMALL, CUBE, gravity=False),
             Link("hook", ((2.0, 0.0, 1.0), UPRIGHT), SMALL, CUBE, gravity=False))
    joints = (Joint("turn", "revolute", "base", "mast", axis=Axis(xyz=(0.0, 0.0, 2.0), lower=-1.0, upper=2.0)),
              Joint("slide", "prismatic", "mast", "boom", axis=Axis(xyz=(1.0, 0.0, 0.0), lower=0.0, upper=0.4)),
              Joint("hang", "fixed", "boom", "hook"))
    return Model("crane", links, joints)


@pytest.fixture
def live(make_engine):
    """Return an engine with a crane in it, and the LiveModel of that."""
    engine, pose, record = make_engine(), at(3.0, 2.0, 0.5, math.pi / 2), crane()
    return engine, LiveModel(record, engine.add_model(record, pose), pose)


def place_of(engine, model, link):
    return engine.link_pose(model.handle.links[link])[0]


def test_the_pose_of_a_model_is_that_of_its_frame(live):
    engine, model = live
    position, orientation = model.pose(engine)
    assert position == pytest.approx((3.0, 2.0, 0.5))
    assert rpy_from_quaternion(orientation)[2] == pytest.approx(math.pi / 2)
    assert place_of(engine, model, "base") == pytest.approx((3.0, 2.5, 0.7))
    model.set_velocity(engine, (1.0, 2.0, 3.0), (0.0, 0.0, 0.5))
    state = model.state(engine)
    assert state.position == pytest.approx(position)
    assert state.linear_velocity == pytest.approx((1.0, 2.0, 3.0)) and state.angular_velocity == (0.0, 0.0, 0.5)


def test_placing_moves_every_link_rigidly(live):
    engine, model = live
    model.set_joint_position(engine, "turn", 0.5)
    model.set_joint_position(engine, "slide", 0.2)
    before = [compose(invert(model.pose(engine)), engine.link_pose(link)) for link in model.handle.links.values()]
    target = ((-1.0, 0.0, 4.0), quaternion_from_rpy(0.3, -0.2, 1.0))
    model.place(engine, (target[0], tuple(2.0 * value for value in target[1])))     # of any length
    assert model.pose(engine)[0] == pytest.approx(target[0]) and model.pose(engine)[1] == pytest.approx(target[1])
    for (position, orientation), link in zip(before, model.handle.links.values()):
        now = compose(invert(model.pose(engine)), engine.link_pose(link))
        assert now[0] == pytest.approx(position, abs=1e-12)
        assert abs(sum(a * b for a, b in zip(now[1], orientation))) == pytest.approx(1.0)
    assert engine.joint_angle(model.handle.joints["turn"]) == 0.5


def test_restoring_undoes_bending_too(live):
    engine, model = live
    before = [engine.link_pose(link) for link in model.handle.links.values()]
    model.set_joint_position(engine, "turn", 1.5)
    model.set_joint_position(engine, "slide", 0.3)
    model.place(engine, at(9.0, 9.0, 9.0))
    model.restore(engine)
    for (position, orientation), link in zip(before, model.handle.links.values()):
        assert engine.link_pose(link)[0] == pytest.approx(position)
        assert engine.link_pose(link)[1] == pytest.approx(orientation)
    assert [engine.joint_angle(joint) for joint in model.handle.joints.values()] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("asked, angle", [(0.5, 0.5), (2.5, 2.0), (-3.0, -1.0)])
def test_bending_a_hinge_swings_all_beyond_it_within_its_limits(live, asked, angle):
    engine, model = live
    model.set_joint_position(engine, "turn", asked)
    assert engine.joint_angle(model.handle.joints["turn"]) == angle
    heading = math.pi / 2 + angle           # mast at (3, 2.5) in the world, boom 1 m and hook 1.5 m ahead of it
    assert place_of(engine, model, "base") == pytest.approx((3.0, 2.5, 0.7))
    assert place_of(engine, model, "mast") == pytest.approx((3.0, 2.5, 1.5))
    for link, reach in (("boom", 1.0), ("hook", 1.5)):
        assert place_of(engine, model, link) == pytest.approx((3.0 + reach * math.cos(heading),
                                                               2.5 + reach * math.sin(heading), 1.5))
    engine.step(100)
    assert engine.joint_angle(model.handle.joints["turn"]) == pytest.approx(angle, abs=1e-6)
    assert place_of(engine, model, "hook")[0] == pytest.approx(3.0 + 1.5 * math.cos(heading), abs=1e-6)


@pytest.mark.parametrize("asked, position", [(0.25, 0.25), (9.0, 0.4), (-1.0, 0.0)])
def test_bending_a_slider_shifts_all_beyond_it_along_its_axis(live, asked, position):
    engine, model = live
    model.set_joint_position(engine, "turn", 0.0)
    model.set_joint_position(engine, "slide", asked)
    assert engine.joint_angle(model.handle.joints["slide"]) == pytest.approx(position)
    assert place_of(engine, model, "mast") == pytest.approx((3.0, 2.5, 1.5))
    assert place_of(engine, model, "boom") == pytest.approx((3.0, 3.5 + position, 1.5))
    assert place_of(engine, model, "hook") == pytest.approx((3.0, 4.0 + position, 1.5))


def test_bending_twice_counts_from_zero_not_from_the_last(live):
    engine, model = live
    for angle in (0.7, -0.4, 1.1):
        model.set_joint_position(engine, "turn", angle)
    heading = math.pi / 2 + 1.1
    assert place_of(engine, model, "boom") == pytest.approx((3.0 + math.cos(heading), 2.5 + math.sin(heading), 1.5))


# -- finding by name ----------------------------------------------------------------------------------------------

@pytest.fixture
def world(make_rig, m2wr, build):
    nested = build.box("house", 5, 5, 0.5)
    nested = replace(nested, links=(replace(nested.links[0], name="room::floor"),), nested=("room",))
    rig = make_rig(nested)
    for index, name in enumerate(("one", "two")):
        rig.simulator.spawn(m2wr, at(0.0, 2.0 * index, 0.1), name)
    return rig


@pytest.mark.parametrize("name, found", [
    ("one::link_chassis", ("one", "link_chassis")), ("two::link_chassis", ("two", "link_chassis")),
    ("link_chassis", ("one", "link_chassis")), ("house::room::floor", ("house", "room::floor")),
    ("room::floor", ("house", "room::floor")), ("ground_plane::link", ("ground_plane", "link"))])
def test_links_are_found_by_scoped_or_plain_name_in_load_order(world, name, found):
    model, link = find_link(world.simulator.models.values(), name)
    assert (model.name, link) == found


@pytest.mark.parametrize("name", ["", "one", "one::", "sensor_laser", "three::link_chassis", "one::link_chassis::c"])
def test_other_names_are_no_links(world, name):
    assert find_link(world.simulator.models.values(), name) is None


@pytest.mark.parametrize("name, y", [("one", 0.0), ("two", 2.0), ("two::link_left_wheel", 1.8),
                                     ("link_right_wheel", 0.2)])
def test_models_and_links_are_frames(world, name, y):
    state = find_frame(world.simulator.models.values(), world.engine, name)
    assert state.position[1] == pytest.approx(y)


def test_an_unknown_frame_is_named_with_the_models_there_are(world):
    with pytest.raises(NotFoundError) as caught:
        find_frame(world.simulator.models.values(), world.engine, "odom")
    assert "\"odom\"" in str(caught.value) and "ground_plane, house, one, two" in str(caught.value)
    with pytest.raises(NotFoundError) as caught:
        find_frame([], world.engine, "odom")
    assert "\"odom\"" in str(caught.value)
