# SPDX-License-Identifier: BSD-3-Clause
"""A model that leaves the world is removed and logged, and the simulation continues."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist

from conftest import at
from m2wr_sim.errors import LostError, ModelError
from m2wr_sim.physics.engine import TOO_FAR, TOO_FAST
from m2wr_sim.runtime.forces import Forces


def throw(rig, name, linear=(0.0, 0.0, 2.0 * TOO_FAST)):
    rig.engine.set_link_velocity(rig.simulator.models[name].root, linear, (0.0, 0.0, 0.0))


@pytest.fixture
def rig(m2wr_rig, build):
    return m2wr_rig(build.box("crate", 3.0, 0.0, 0.25, static=False), build.box("other", 0.0, 4.0, 0.25, static=False),
                    build.box("wall", -2.0, 0.0, 0.25))


def test_the_model_is_removed_and_the_others_continue(rig, caplog):
    rig.send(0.3, 0.0).run(0.5)
    throw(rig, "crate")
    rig.run(0.5)
    assert rig.simulator.now_ns == 10 ** 9
    assert list(rig.simulator.models) == ["ground_plane", "other", "wall", "m2wr"]
    assert not rig.simulator.scene.rows_of("crate")
    lines = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert len(lines) == 1 and "step 501 (1 ms each): the simulation diverged: crate::link is at" in lines[0]
    assert "Removed: model \"crate\"" in lines[0] and "loss_ends" in lines[0]
    assert 0.15 < rig.pose()[0][0] < 0.35
    rig.simulator.spawn(rig.simulator.models["other"].record, at(3.0, 0.0, 0.25), "crate")
    rig.run(0.1)
    assert rig.pose("crate")[0] == pytest.approx((3.0, 0.0, 0.25), abs=1e-3)


def test_several_at_once_are_all_removed_and_no_step_is_lost(rig, caplog):
    rig.run(0.1)
    rig.engine.set_joint_motor(rig.simulator.models["m2wr"].handle.joints["joint_left_wheel"], 5.0, 5.0)
    for name in ("crate", "other", "m2wr"):
        throw(rig, name)
    rig.run(0.1)
    assert list(rig.simulator.models) == ["ground_plane", "wall"] and rig.simulator.steps == 200
    assert "crate::link" in caplog.text and "m2wr::" in caplog.text


def test_a_robot_that_is_lost_ends_its_plugins(rig):
    rig.send(0.3, 0.0).run(0.2)
    throw(rig, "m2wr")
    told = len(rig.run(0.2).messages("/odom"))
    rig.send(0.3, 0.0).run(0.2)
    assert len(rig.messages("/odom")) == told and not rig.simulator.switched_off()
    assert all(abs(value) < 1e3 for message in rig.messages("/odom")
               for value in (message.pose.pose.position.x, message.pose.pose.position.z))


def test_those_who_ask_in_the_same_moment_get_an_answer(rig):
    """What knows a lost model may ask for it until it is deleted between two stretches of steps."""
    model = rig.simulator.models["m2wr"]
    joint = model.handle.joints["joint_left_wheel"]
    rig.engine.feel_joint(joint)
    poses = np.zeros((1, 7))
    look = rig.engine.pose_reader([(model.root, at())], poses)     # as a laser does
    throw(rig, "m2wr")
    with pytest.raises(LostError) as caught:
        rig.engine.step(7)
    assert caught.value.models == ("m2wr",) and caught.value.left == 6
    rig.engine.abandon_model(model.handle)
    rig.engine.set_joint_motor(joint, 1.0, 5.0)
    rig.engine.add_joint_force(joint, 1.0)
    rig.engine.add_link_force(model.root, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    rig.engine.step(6)
    look()
    assert np.isfinite(poses).all()
    state = rig.engine.link_state(model.root)
    assert state.position == pytest.approx((0.0, 0.0, 0.1)) and state.linear_velocity == (0.0, 0.0, 0.0)
    assert (rig.engine.joint_angle(joint), rig.engine.joint_rate(joint)) == (0.0, 0.0)
    assert rig.engine.joint_wrench(joint) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    rig.engine.remove_model(model.handle)
    rig.engine.step(1)
    del rig.simulator.models["m2wr"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_velocity_that_is_not_finite_is_refused(rig, value):
    for linear, angular in (((0.0, value, 0.0), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (value, 0.0, 0.0))):
        with pytest.raises(ModelError, match="crate::link; expected finite numbers"):
            rig.engine.set_link_velocity(rig.simulator.models["crate"].root, linear, angular)
    rig.run(0.01)


def test_a_push_on_what_is_lost_ends_with_it(rig):
    forces = Forces(rig.simulator)
    rig.simulator.add_observer(forces, "forces")
    forces.push_link(rig.simulator.models["crate"], "link", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0, -1)
    rig.run(0.1)
    throw(rig, "crate")
    rig.run(0.1)
    assert "crate" not in rig.simulator.models and rig.simulator.observers


def test_who_wants_it_gets_an_error_instead(m2wr_rig, build):
    rig = m2wr_rig(build.box("crate", 3.0, 0.0, 0.25, static=False), loss_ends=True).run(0.1)
    throw(rig, "crate")
    with pytest.raises(LostError, match="the simulation diverged: crate::link is at"):
        rig.run(0.1)


def test_fallen_models_are_removed_before_the_grid_ends(make_rig, build, caplog):
    """At 2^31 cells ODE ends the process: an hour or two after a thing has been dropped beside the ground."""
    rig = make_rig(build.box("thing", 0.0, 0.0, 0.25, size=(0.1, 0.1, 0.1), static=False))
    link = rig.simulator.models["thing"].root
    rig.engine.set_link_pose(link, at(0.999 * TOO_FAR))
    rig.engine.set_link_velocity(link, (0.9 * TOO_FAST, 0.0, 0.0), (0.0, 0.0, 0.0))
    rig.run(0.5)
    assert list(rig.simulator.models) == ["ground_plane"] and "thing::link" in caplog.text


# ---- what ODE would end the process for -------------------------------------------------------------------------

def body(mass=1.0, inertia=(0.1, 0.0, 0.0, 0.1, 0.0, 0.1), centre=(0.0, 0.0, 0.0)):
    from m2wr_sim.model.types import Inertial
    return Inertial(mass, (centre, (0.0, 0.0, 0.0, 1.0)), inertia)


@pytest.mark.parametrize("inertial, words", [
    (body(mass=1e18, inertia=(1.0, 0.0, 0.0, 1.0, 0.0, 1.0)), "mass 1e\\+18 .* at most 1e\\+09 kg"),
    (body(inertia=(1e10, 0.0, 0.0, 1e10, 0.0, 1e10)), "at most 1e\\+09 kg and 1e\\+09"),
    (body(inertia=(1e8, 0.0, 0.0, 1e8, 0.0, 1e-9)), "within a factor"),
    (body(inertia=(1.0, 0.99999999999, 0.0, 1.0, 0.0, 1.0)), "within a factor"),
    (body(centre=(1e12, 0.0, 0.0)), "centre of mass at .* at most 100 m"),
    (body(centre=(math.nan, 0.0, 0.0)), "centre of mass at .* at most 100 m"),
    (body(mass=1.0, inertia=(1e-12, 0.0, 0.0, 1e-12, 0.0, 1e-12), centre=(50.0, 0.0, 0.0)), "50.* m from its centre"),
    (body(mass=1e-9), "at least 1e-06 kg"), (body(mass=math.inf), "physical body")])
def test_bodies_that_ode_cannot_move_are_refused(make_rig, build, inertial, words):
    from dataclasses import replace
    rig = make_rig(build.box("crate", 3.0, 0.0, 0.25, static=False))
    record = rig.simulator.models["crate"].record
    bad = replace(record, links=(replace(record.links[0], inertial=inertial),))
    with pytest.raises(ModelError, match="bad::link.*" + words):
        rig.simulator.spawn(bad, at(0.0, 0.0, 1.0), "bad")
    if "from its centre" not in words:
        with pytest.raises(ModelError, match="crate::link.*" + words):
            rig.engine.set_link_inertial(rig.simulator.models["crate"].root, inertial)
    rig.run(0.05)
    assert rig.pose("crate")[0] == pytest.approx((3.0, 0.0, 0.25), abs=1e-3)
    still = replace(bad, static=True)               # nothing has to move it
    rig.simulator.spawn(still, at(0.0, 0.0, 1.0), "still")


@pytest.mark.parametrize("axis, place, words", [
    (dict(xyz=(0.0, 0.0, 1e-200)), (0.0, 0.0, 0.0), "axis"), (dict(xyz=(0.0, 1e200, 0.0)), (0.0, 0.0, 0.0), "axis"),
    (dict(xyz=(0.0, 0.0, math.nan)), (0.0, 0.0, 0.0), "axis"), (dict(), (1e12, 0.0, 0.0), "anchor"),
    (dict(damping=math.nan), (0.0, 0.0, 0.0), "damping"), (dict(damping=1e301), (0.0, 0.0, 0.0), "damping"),
    (dict(stop_cfm=math.inf), (0.0, 0.0, 0.0), "stop_cfm"), (dict(lower=math.nan), (0.0, 0.0, 0.0), "limits")])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_joints_that_ode_cannot_solve_are_refused(make_rig, kind, axis, place, words):
    from m2wr_sim.model.types import Axis, Joint, Link, Model
    links = (Link("one", inertial=body()), Link("two", inertial=body()))
    joint = Joint("joint", kind, "one", "two", (place, (0.0, 0.0, 0.0, 1.0)), Axis(**axis))
    rig = make_rig()
    with pytest.raises(ModelError, match="pair::joint.*" + words):
        rig.simulator.spawn(Model("pair", links, (joint,)), at(0.0, 0.0, 1.0))
    assert list(rig.simulator.models) == ["ground_plane"]


def test_a_universal_joint_whose_axes_are_parallel_is_refused(make_rig):
    from m2wr_sim.model.types import Axis, Joint, Link, Model
    links = (Link("one", inertial=body()), Link("two", inertial=body()))
    joint = Joint("joint", "universal", "one", "two", axis=Axis(), axis2=Axis(xyz=(0.0, 0.0, -2.0)))
    with pytest.raises(ModelError, match="pair::joint.* not parallel"):
        make_rig().simulator.spawn(Model("pair", links, (joint,)), at(0.0, 0.0, 1.0))


def test_commands_for_a_robot_that_is_lost_do_no_harm(rig):
    throw(rig, "m2wr")
    command = Twist()
    command.linear.x = 1.0
    rig.ports.send("/cmd_vel", command)
    rig.run(0.1)
    assert "m2wr" not in rig.simulator.models
