# SPDX-License-Identifier: BSD-3-Clause
"""Wrenches and efforts in time: when they act, which one counts, what ends them."""
import math

import pytest

from conftest import at
from m2wr_sim.model.types import Axis, Inertial, Joint, Link, Model
from m2wr_sim.runtime.forces import Forces

MS = 1000000
SMALL = Inertial(2.0, inertia=(0.5, 0.0, 0.0, 0.5, 0.0, 0.5))


def weightless(name, *joints, links=("link",), **values):
    """Return a model without collisions that gravity passes over."""
    return Model(name, tuple(Link(link, inertial=SMALL, gravity=False) for link in links), joints, **values)


def spun(lower=-1e16, **axis):
    """Return a model of a rotor of 0.5 kg m^2 on a hinge along z that the world holds."""
    return weightless("rotor", Joint("turn", "revolute", "world", "link", axis=Axis(lower=lower, **axis)))


@pytest.fixture
def pushed(make_rig):
    """Return a function that makes a rig with models and its Forces."""
    def make(*models, **options):
        rig = make_rig(*models, **options)
        forces = Forces(rig.simulator)
        rig.simulator.add_observer(forces, "forces")
        return rig, forces
    return make


def velocity(rig, model="puck"):
    state = rig.simulator.models[model].state(rig.engine)
    return state.linear_velocity, state.angular_velocity


def push(rig, forces, force, seconds, torque=(0.0, 0.0, 0.0), start_s=0.0, model="puck", link="link"):
    forces.push_link(rig.simulator.models[model], link, force, torque, int(start_s * 1e9), int(round(seconds * 1e9)))


def test_a_force_for_half_a_second_gives_its_momentum(pushed):
    rig, forces = pushed(weightless("puck"))
    push(rig, forces, (4.0, 0.0, 0.0), 0.5)
    rig.run(1.0)
    assert velocity(rig)[0] == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)     # 4 N for 0.5 s on 2 kg


def test_a_torque_gives_its_angular_momentum(pushed):
    rig, forces = pushed(weightless("puck"))
    push(rig, forces, (0.0, 0.0, 0.0), 0.25, torque=(0.0, 0.0, 1.0))
    rig.run(1.0)
    assert velocity(rig)[1] == pytest.approx((0.0, 0.0, 0.5), abs=1e-9)     # 1 N m for 0.25 s on 0.5 kg m^2


def test_duration_zero_does_nothing_a_negative_one_never_ends(pushed):
    rig, forces = pushed(weightless("puck"), weightless("other"))
    push(rig, forces, (4.0, 0.0, 0.0), 0.0)
    push(rig, forces, (0.0, 4.0, 0.0), -1.0, model="other")
    rig.run(2.0)
    assert velocity(rig)[0] == (0.0, 0.0, 0.0)
    assert velocity(rig, "other")[0] == pytest.approx((0.0, 4.0, 0.0), abs=1e-9)


def test_a_force_waits_for_its_start_time(pushed):
    rig, forces = pushed(weightless("puck"), weightless("other"))
    rig.run(1.0)
    push(rig, forces, (2.0, 0.0, 0.0), 0.1, start_s=1.2)
    push(rig, forces, (2.0, 0.0, 0.0), 0.1, start_s=0.5, model="other")
    rig.run(0.199)
    assert velocity(rig)[0] == (0.0, 0.0, 0.0)
    assert velocity(rig, "other")[0][0] == pytest.approx(0.1, abs=1e-9)
    rig.run(1.0)
    assert velocity(rig)[0][0] == pytest.approx(0.101, abs=1e-9)        # both ends of the interval count, as in Gazebo


def test_of_two_wrenches_on_a_link_the_newest_counts(pushed):
    rig, forces = pushed(weightless("puck"))
    push(rig, forces, (2.0, 0.0, 0.0), 0.2)
    push(rig, forces, (0.0, 2.0, 0.0), 0.1)
    rig.run(0.3)
    assert velocity(rig)[0] == pytest.approx((0.1, 0.1, 0.0), abs=1e-9)     # the second first, then what is left


def test_only_the_scoped_name_clears_a_wrench(pushed):
    rig, forces = pushed(weightless("puck"))
    push(rig, forces, (2.0, 0.0, 0.0), -1.0)
    forces.clear_link("link")
    rig.run(0.5)
    assert velocity(rig)[0][0] == pytest.approx(0.5, abs=1e-9)
    forces.clear_link("puck::link")
    rig.run(0.5)
    assert velocity(rig)[0][0] == pytest.approx(0.5, abs=1e-9)


def test_a_deleted_model_takes_its_orders_along(pushed):
    rig, forces = pushed(weightless("puck"))
    push(rig, forces, (2.0, 0.0, 0.0), -1.0)
    rig.run(0.1)
    rig.simulator.delete("puck")
    rig.run(0.1)
    rig.simulator.spawn(weightless("puck"), at())
    rig.run(0.1)
    assert velocity(rig)[0] == (0.0, 0.0, 0.0)


def test_orders_survive_a_reset_of_the_world(pushed):
    rig, forces = pushed(weightless("puck"))
    push(rig, forces, (2.0, 0.0, 0.0), -1.0)
    rig.run(0.1)
    rig.simulator.reset_world()
    rig.run(0.1)
    assert velocity(rig)[0][0] == pytest.approx(0.1, abs=1e-9)


def test_a_sleeping_body_wakes_under_a_force(pushed, build):
    rig, forces = pushed(build.box("puck", 0.0, 0.0, 0.25, static=False, mass=2.0))
    rig.run(3.0)
    push(rig, forces, (100.0, 0.0, 0.0), 0.1)
    rig.run(0.1)
    assert velocity(rig)[0][0] > 1.0


def effort(rig, forces, value, seconds=0.5):
    forces.push_joint(rig.simulator.models["rotor"], "turn", value, 0, int(round(seconds * 1e9)))


@pytest.mark.parametrize("limit, given, acts", [(-1.0, 3.0, 3.0), (2.0, 3.0, 2.0), (2.0, -3.0, -2.0), (0.0, 3.0, 0.0)])
def test_an_effort_is_cut_to_the_limit(pushed, limit, given, acts):
    rig, forces = pushed(spun(effort=limit))
    effort(rig, forces, given)
    rig.run(1.0)
    assert rig.rate("turn", "rotor") == pytest.approx(acts, rel=1e-3, abs=1e-6)     # for 0.5 s on 0.5 kg m^2


def test_an_effort_beyond_the_velocity_limit_is_none(pushed):
    rig, forces = pushed(spun(velocity=1.0))
    effort(rig, forces, 5.0, 2.0)
    rig.run(2.0)
    assert 1.0 <= rig.rate("turn", "rotor") < 1.02


def test_efforts_add_up_and_are_cleared_by_name(pushed):
    rig, forces = pushed(spun())
    effort(rig, forces, 1.0, -1.0)
    effort(rig, forces, 2.0, -1.0)
    rig.run(0.1)
    assert rig.rate("turn", "rotor") == pytest.approx(0.6, rel=1e-3)
    forces.clear_joint("other")
    forces.clear_joint("turn")
    rig.run(0.1)
    assert rig.rate("turn", "rotor") == pytest.approx(0.6, rel=1e-3)


def test_a_prismatic_joint_is_pushed_along_its_axis(pushed):
    sled = weightless("rotor", Joint("turn", "prismatic", "world", "link", axis=Axis(xyz=(0.0, 1.0, 0.0))))
    rig, forces = pushed(sled)
    effort(rig, forces, 2.0)
    rig.run(1.0)
    assert rig.rate("turn", "rotor") == pytest.approx(0.5, rel=1e-3)
    assert math.isclose(velocity(rig, "rotor")[0][1], 0.5, rel_tol=1e-3)
