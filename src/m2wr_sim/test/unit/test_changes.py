# SPDX-License-Identifier: BSD-3-Clause
"""Changes to a running world: link states, masses, joints, wrenches in frames, and the physics itself."""
import math
from dataclasses import replace

import pytest

from conftest import UPRIGHT, at
from m2wr_sim.errors import ModelError, ParameterError
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Axis, Inertial, Joint, Link, Model
from m2wr_sim.runtime import changes

QUARTER = quaternion_from_rpy(0.0, 0.0, math.pi / 2)
REST = (0.0, 0.0, 0.0)


def rotor(**axis):
    """Return a rotor of 0.5 kg m^2 on a hinge along z that the world holds."""
    link = Link("link", inertial=Inertial(1.0, inertia=(0.5, 0.0, 0.0, 0.5, 0.0, 0.5)), gravity=False)
    return Model("rotor", (link,), (Joint("turn", "revolute", "world", "link", axis=Axis(**axis)),))


def joint_of(rig):
    return rig.simulator.models["rotor"].handle.joints["turn"]


# ---- links ---------------------------------------------------------------------------------------------------------

def test_a_link_goes_where_it_is_put(make_rig, build):
    rig = make_rig(build.box("a", 0.0, 0.0, 5.0, static=False))
    model = rig.simulator.models["a"]
    changes.set_link_state(rig.simulator, model, "link", ((1.0, 2.0, 3.0), (0.0, 0.0, 2.0, 2.0)), (1.0, 0.0, 0.0), REST)
    state = rig.engine.link_state(model.handle.links["link"])
    assert state.position == pytest.approx((1.0, 2.0, 3.0)) and state.orientation == pytest.approx(QUARTER)
    assert state.linear_velocity == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("pose, linear", [(at(2e6), REST), (at(), (2e4, 0.0, 0.0))])
def test_a_link_is_not_put_out_of_reach(make_rig, build, pose, linear):
    rig = make_rig(build.box("a", 0.0, 0.0, 5.0, static=False))
    with pytest.raises(ModelError, match="a::link"):
        changes.set_link_state(rig.simulator, rig.simulator.models["a"], "link", pose, linear, REST)


def test_a_static_link_takes_its_shape_along_for_rays(make_rig, build):
    rig = make_rig(build.box("wall", 2.0, 0.0, 0.25))
    model = rig.simulator.models["wall"]
    changes.set_link_state(rig.simulator, model, "link", at(7.0), REST, REST)
    rig.simulator.refresh_scene()
    assert rig.engine.link_pose(model.handle.links["link"])[0] == (7.0, 0.0, 0.0)
    scene = rig.simulator.scene
    assert scene.spheres[:3, scene.rows_of("wall")[0]] == pytest.approx((7.0, 0.0, 0.0))


def test_gravity_is_switched_for_one_link(make_rig, build):
    rig = make_rig(build.box("a", 0.0, 0.0, 50.0, static=False), build.box("b", 5.0, 0.0, 50.0, static=False))
    model = rig.simulator.models["a"]
    inertial = model.record.links[0].inertial
    changes.set_link_properties(rig.simulator, model, "link", False, inertial, solve=False)
    rig.run(1.0)
    assert rig.pose("a")[0][2] == 50.0 and rig.pose("b")[0][2] == pytest.approx(45.1, abs=0.01)
    assert not model.record.links[0].gravity


@pytest.mark.parametrize("solve, expected", [(False, 1.0), (True, 0.25)])
def test_a_stored_mass_acts_where_it_is_asked_to(make_rig, build, solve, expected):
    rig = make_rig(build.box("a", 0.0, 0.0, 50.0, static=False, mass=1.0, gravity=False))
    model = rig.simulator.models["a"]
    heavy = Inertial(4.0, inertia=(1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    changes.set_link_properties(rig.simulator, model, "link", False, heavy, solve)
    assert model.record.links[0].inertial == heavy
    for _ in range(1000):
        rig.engine.add_link_force(model.handle.links["link"], (1.0, 0.0, 0.0), REST)
        rig.engine.step(1)
    assert model.state(rig.engine).linear_velocity[0] == pytest.approx(expected)


def test_a_mass_that_is_none_is_refused_and_nothing_is_stored(make_rig, build):
    rig = make_rig(build.box("a", 0.0, 0.0, 50.0, static=False))
    model = rig.simulator.models["a"]
    before = model.record
    with pytest.raises(ModelError, match="a::link: mass -1"):
        changes.set_link_properties(rig.simulator, model, "link", True, replace(before.links[0].inertial, mass=-1.0),
                                    solve=True)
    assert model.record is before


# ---- joints --------------------------------------------------------------------------------------------------------

def test_damping_given_later_slows_the_joint(make_rig):
    rig = make_rig(rotor())
    model = rig.simulator.models["rotor"]
    changes.set_joint_properties(rig.simulator, model, "turn", {0: ({"damping": 0.5}, {})})
    rig.engine.set_link_velocity(model.handle.links["link"], REST, (0.0, 0.0, 1.0))
    rig.run(1.0)
    assert rig.engine.joint_rate(joint_of(rig)) == pytest.approx(math.exp(-1.0), rel=2e-3)    # rate d / I = 1 per s


def test_stops_given_later_hold_and_bound_the_configuration(make_rig):
    rig = make_rig(rotor())
    model = rig.simulator.models["rotor"]
    changes.set_joint_properties(rig.simulator, model, "turn",
                                 {0: ({"lower": -0.5, "upper": 0.5}, {"lower": -0.5, "upper": 0.5})})
    rig.engine.set_link_velocity(model.handle.links["link"], REST, (0.0, 0.0, 1.0))
    rig.run(2.0)
    assert -0.51 < rig.engine.joint_angle(joint_of(rig)) < 0.51
    rig.simulator.set_joint_positions("rotor", {"turn": 2.0})
    assert rig.engine.joint_angle(joint_of(rig)) == pytest.approx(0.5)


def test_a_motor_given_later_turns_the_joint(make_rig):
    rig = make_rig(rotor())
    changes.set_joint_properties(rig.simulator, rig.simulator.models["rotor"], "turn",
                                 {0: ({}, {"rate": 2.0, "max_force": 10.0})})
    rig.run(1.0)
    assert rig.engine.joint_rate(joint_of(rig)) == pytest.approx(2.0)
    assert rig.engine.joint_angle(joint_of(rig)) == pytest.approx(1.9, rel=1e-2)     # 0.1 s to get there


def test_a_number_that_is_none_is_refused_by_name(make_rig):
    rig = make_rig(rotor())
    with pytest.raises(ModelError, match="rotor::turn: rate is nan"):
        changes.set_joint_properties(rig.simulator, rig.simulator.models["rotor"], "turn",
                                     {0: ({}, {"rate": math.nan})})


def test_values_for_a_missing_axis_are_reported(make_rig, caplog):
    rig = make_rig(rotor())
    model = rig.simulator.models["rotor"]
    changes.set_joint_properties(rig.simulator, model, "turn", {0: ({}, {"rate": 2.0, "max_force": 10.0}),
                                                                1: ({"damping": 3.0}, {"rate": -9.0})})
    rig.run(1.0)
    assert rig.engine.joint_rate(joint_of(rig)) == pytest.approx(2.0)
    assert model.joint_record("turn").axis2 is None and "values for axis 1 have no effect" in caplog.text


def test_of_the_axes_none_is_changed_where_one_cannot_be(make_rig):
    rig = make_rig(rotor())
    before = rig.simulator.models["rotor"].record
    with pytest.raises(ModelError, match="damping is inf"):
        changes.set_joint_properties(rig.simulator, rig.simulator.models["rotor"], "turn",
                                     {0: ({}, {"rate": 2.0, "max_force": 10.0}), 1: ({"damping": math.inf}, {})})
    assert rig.simulator.models["rotor"].record is before
    rig.run(0.1)
    assert rig.engine.joint_rate(joint_of(rig)) == 0.0


# ---- wrenches ------------------------------------------------------------------------------------------------------

def test_a_wrench_without_frame_acts_as_in_gazebo():
    force, torque = changes.wrench_as_gazebo(at(5.0, 5.0, 0.0, 1.0), None, (0.0, 1.0, 0.0), (2.0, 0.0, 0.0),
                                             (0.0, 0.0, 1.0))
    assert force == (2.0, 0.0, 0.0) and torque == (0.0, 0.0, -1.0)


def test_gazebo_turns_a_wrench_into_the_axes_of_the_link():
    frame, link = ((1.0, 0.0, 0.0), UPRIGHT), ((1.0, 2.0, 0.0), QUARTER)
    force, torque = changes.wrench_as_gazebo(link, frame, REST, (1.0, 0.0, 0.0), REST)
    assert force == pytest.approx((0.0, -1.0, 0.0))     # x of the frame is -y of the link
    assert torque == pytest.approx((0.0, 0.0, 2.0))     # the frame stands at (-2, 0) of the link


def test_a_wrench_in_the_frame_of_its_link_is_rotated():
    link = ((1.0, 2.0, 0.0), QUARTER)
    assert changes.wrench_as_gazebo(link, link, REST, (1.0, 0.0, 0.0), REST)[0] == pytest.approx((1.0, 0.0, 0.0))
    force, torque = changes.wrench_in_world(link, REST, link, REST, (1.0, 0.0, 0.0), REST)
    assert force == pytest.approx((0.0, 1.0, 0.0)) and torque == pytest.approx(REST)


def test_a_wrench_in_the_world_acts_at_its_point():
    force, torque = changes.wrench_in_world(((1.0, 0.0, 0.0), QUARTER), (0.5, 0.0, 0.0), None, (1.0, 1.5, 0.0),
                                            (2.0, 0.0, 0.0), REST)
    assert force == (2.0, 0.0, 0.0)
    assert torque == pytest.approx((0.0, 0.0, -2.0))    # one metre beyond the centre of mass at (1, 0.5)


# ---- physics -------------------------------------------------------------------------------------------------------

def test_gravity_and_step_change_while_the_world_runs(make_rig, build):
    rig = make_rig(build.box("a", 0.0, 0.0, 90.0, static=False))
    rig.run(0.5)
    height = rig.pose("a")[0][2]
    simulator = rig.simulator
    changes.set_physics(simulator, replace(simulator.physics, gravity=(1.0, 0.0, 0.0), max_step_size=0.002))
    before = simulator.models["a"].state(rig.engine).linear_velocity[2]
    rig.run(1.0)
    assert simulator.steps == 1000 and simulator.step_ns == 2000000 and simulator.now_ns == 1500000000
    state = simulator.models["a"].state(rig.engine)
    assert state.linear_velocity == pytest.approx((1.0, 0.0, before))
    assert state.position[0] == pytest.approx(0.5, abs=2e-3)
    assert state.position[2] == pytest.approx(height + before, abs=1e-6)


def test_a_change_of_step_keeps_speed_and_scan_rate(m2wr_rig):
    rig = m2wr_rig(wheel_convention="kinetic")
    rig.run(1.0).send(0.5, 0.0).run(1.0)
    changes.set_physics(rig.simulator, replace(rig.simulator.physics, max_step_size=0.003))
    start = rig.pose()[0][0]
    rig.run(2.001)
    assert rig.pose()[0][0] - start == pytest.approx(1.0, abs=0.005)
    stamps = rig.stamps_ms("/m2wr/laser/scan")[-20:]
    assert (stamps[-1] - stamps[0]) / 19 == pytest.approx(50.0, abs=0.2)


@pytest.mark.parametrize("name, value", [("max_step_size", 0.2), ("max_step_size", -0.001), ("max_step_size", math.nan),
                                         ("erp", math.inf), ("gravity", (0.0, 0.0, math.nan))])
def test_physics_that_cannot_be_is_refused_and_nothing_changes(make_rig, name, value):
    rig = make_rig()
    before = rig.simulator.physics, rig.engine.settings
    with pytest.raises(ParameterError, match="expected"):
        changes.set_physics(rig.simulator, replace(rig.simulator.physics, **{name: value}))
    assert (rig.simulator.physics, rig.engine.settings) == before


def test_numbers_that_suit_only_gazebo_are_kept_but_not_taken(make_rig):
    rig = make_rig()
    before = rig.engine.settings
    wanted = replace(rig.simulator.physics, cfm=0.5, contact_surface_layer=0.01, contact_max_correcting_vel=2000.0,
                     erp=5.0, max_contacts=7, iters=150)
    changes.set_physics(rig.simulator, wanted)
    assert rig.simulator.physics == wanted
    assert rig.engine.settings == replace(before, erp=0.8, max_contacts=7, iterations=150)


def test_a_motor_takes_the_place_of_a_joints_friction(make_rig):
    rig = make_rig(rotor(friction=50.0))
    rig.engine.set_link_velocity(rig.simulator.models["rotor"].handle.links["link"], REST, (0.0, 0.0, 1.0))
    rig.run(0.1)
    assert rig.engine.joint_rate(joint_of(rig)) == pytest.approx(0.0, abs=1e-6)
    rig.engine.set_joint_motor(joint_of(rig), 2.0, 5.0)
    rig.run(0.5)
    assert rig.engine.joint_rate(joint_of(rig)) == pytest.approx(2.0)
