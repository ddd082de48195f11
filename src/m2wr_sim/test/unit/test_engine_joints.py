# SPDX-License-Identifier: BSD-3-Clause
"""Joints in the engine: limits, motors, damping, friction, and the angles of hinges, against closed forms."""
import math
from dataclasses import replace

import pytest

from m2wr_sim.model.types import Axis, Inertial, Joint, Link, Model

GRAVITY = 9.8
SMALL = Inertial(1.0, inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01))


def root_of(engine, index):
    """Return the number of the first link of the model added as number ``index``."""
    return next(iter(engine.handles[index].links.values()))


def state_of(engine, index=-1):
    return engine.link_state(root_of(engine, index))


def pendulum(kind, axis=Axis(xyz=(0.0, 1.0, 0.0)), parent="world", offset=(0.0, 0.0, 0.0)):
    """Return a model of one or two links with one joint of a kind at the origin of the child."""
    base = () if parent == "world" else (Link("base", inertial=replace(SMALL, mass=1000.0), gravity=False),)
    arm = Link("arm", inertial=replace(SMALL, pose=(offset, (0.0, 0.0, 0.0, 1.0))))
    return Model("pendulum", base + (arm,), (Joint("joint", kind, parent, "arm", axis=axis),))


@pytest.mark.parametrize("parent", ["world", "base"])
def test_a_driven_hinge_counts_full_turns(make_engine, parent):
    engine = make_engine(1, [pendulum("revolute", parent=parent)])
    joint = engine.handles[0].joints["joint"]
    engine.set_joint_motor(joint, -9.0, 5.0)
    engine.step(3000)
    assert engine.joint_rate(joint) == pytest.approx(-9.0, rel=1e-3)
    inertia = 0.01 if parent == "world" else 0.005      # two equal bodies turn against each other
    spin_up = 9.0 * inertia / 5.0               # s: rate times inertia over torque
    assert engine.joint_angle(joint) == pytest.approx(-9.0 * (3.0 - 0.5 * spin_up), rel=1e-3)


@pytest.mark.parametrize("batch", [7, 10, 100])
@pytest.mark.parametrize("step_ms, rates, torque", [(1, (12.0, -5.0, 30.0), 0.5), (1, (300.0, -900.0), 50.0),
                                                    (5, (200.0, -300.0), 10.0)])
def test_angles_do_not_depend_on_the_batch(make_engine, step_ms, rates, torque, batch):
    angles = []
    for size in (1, batch):
        engine = make_engine(step_ms, [pendulum("revolute")])
        joint = engine.handles[0].joints["joint"]
        for rate in rates:
            engine.set_joint_motor(joint, rate, torque)
            for left in range(2100, 0, -size):
                engine.step(min(size, left))
        angles.append(engine.joint_angle(joint))
    assert angles[0] == angles[1]


def test_the_sign_of_a_hinge_is_that_of_its_axis(make_engine):
    engine = make_engine(1, [pendulum("revolute", Axis(xyz=(0.0, 0.0, 1.0)))])
    engine.set_joint_motor(engine.handles[0].joints["joint"], 1.0, 5.0)
    engine.step(500)
    assert state_of(engine).angular_velocity[2] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("rate", [1.0, -1.0])
def test_a_hinge_stops_at_its_limits(make_engine, rate):
    engine = make_engine(1, [pendulum("revolute", Axis(xyz=(0.0, 0.0, 1.0), lower=-0.5, upper=0.8))])
    joint = engine.handles[0].joints["joint"]
    engine.set_joint_motor(joint, rate, 0.5)
    engine.step(3000)
    assert engine.joint_angle(joint) == pytest.approx(0.8 if rate > 0 else -0.5, abs=2e-2)


def test_a_pendulum_swings_with_its_period(make_engine):
    engine = make_engine(1, [pendulum("revolute", offset=(0.05, 0.0, -0.5))])
    joint, crossings, before = engine.handles[0].joints["joint"], [], None
    for step in range(6000):
        engine.step(1)
        offset = engine.joint_angle(joint) - math.atan2(0.05, 0.5)      # about where it hangs still
        if before is not None and before < 0.0 <= offset:
            crossings.append(step)
        before = offset
    length = math.hypot(0.05, 0.5)
    period = 2 * math.pi * math.sqrt((0.01 + length ** 2) / (GRAVITY * length))
    measured = (crossings[-1] - crossings[0]) * 1e-3 / (len(crossings) - 1)
    assert len(crossings) >= 3 and measured == pytest.approx(period, rel=0.01)


def test_joint_damping_slows_exponentially(make_engine):
    engine = make_engine(1, [pendulum("revolute", Axis(xyz=(0.0, 0.0, 1.0), damping=0.02))])
    joint = engine.handles[0].joints["joint"]
    engine.set_link_velocity(root_of(engine, 0), (0.0, 0.0, 0.0), (0.0, 0.0, 5.0))
    engine.step(500)
    assert engine.joint_rate(joint) == pytest.approx(5.0 * math.exp(-0.02 / 0.01 * 0.5), rel=0.01)


def test_the_fudge_factor_tones_a_motor_down_that_leaves_a_stop(make_engine):
    rates = []
    for factor in (None, 1.0, 0.1):
        engine = make_engine(1, [pendulum("revolute", Axis(xyz=(0.0, 0.0, 1.0), lower=0.0, upper=0.8,
                                                           fudge_factor=factor))])
        joint, = engine.handles[0].joints.values()
        engine.set_joint_motor(joint, 3.0, 0.01)
        engine.step(1)
        rates.append(engine.joint_rate(joint))
    assert rates[0] == rates[1] > rates[2]


def test_joint_friction_stops_at_a_steady_rate(make_engine):
    engine = make_engine(1, [pendulum("revolute", Axis(xyz=(0.0, 0.0, 1.0), friction=0.05))])
    joint = engine.handles[0].joints["joint"]
    engine.set_link_velocity(root_of(engine, 0), (0.0, 0.0, 0.0), (0.0, 0.0, 5.0))
    engine.step(500)
    assert engine.joint_rate(joint) == pytest.approx(5.0 - 0.05 / 0.01 * 0.5, rel=0.01)
    engine.step(1000)
    assert engine.joint_rate(joint) == pytest.approx(0.0, abs=1e-9)


def test_a_motor_reaches_its_rate_only_as_its_torque_allows(make_engine):
    engine = make_engine(1, [pendulum("revolute", Axis(xyz=(0.0, 0.0, 1.0)))])
    joint = engine.handles[0].joints["joint"]
    engine.set_joint_motor(joint, 100.0, 0.1)
    engine.step(500)
    assert engine.joint_rate(joint) == pytest.approx(0.1 / 0.01 * 0.5, rel=0.01)
    engine.set_joint_motor_force(joint, 0.0)
    engine.step(500)
    assert engine.joint_rate(joint) == pytest.approx(5.0, rel=0.01)


def test_a_slider_moves_along_its_axis(make_engine):
    engine = make_engine(1, [pendulum("prismatic", Axis(xyz=(1.0, 0.0, 0.0), lower=-0.2, upper=0.3))])
    joint = engine.handles[0].joints["joint"]
    engine.set_joint_motor(joint, 0.5, 50.0)
    engine.step(400)
    spin_up = 0.5 * 1.0 / 50.0                  # s: speed times mass over force
    assert engine.joint_angle(joint) == pytest.approx(0.5 * (0.4 - 0.5 * spin_up), rel=5e-3)
    assert engine.joint_rate(joint) == pytest.approx(0.5, rel=1e-3)
    engine.step(1000)
    assert engine.joint_angle(joint) == pytest.approx(0.3, abs=5e-3)
    assert state_of(engine).position[1:] == pytest.approx((0.0, 0.0), abs=1e-3)


@pytest.mark.parametrize("kind", ["fixed", "ball", "universal"])
def test_other_joints_hold_their_anchor(make_engine, kind):
    engine = make_engine(1, [pendulum(kind, offset=(0.3, 0.0, 0.0))])
    engine.step(700)
    position, orientation, _, _ = state_of(engine)
    assert position == pytest.approx((0.0, 0.0, 0.0), abs=5e-3)
    assert (abs(orientation[3]) > 0.999) is (kind == "fixed")
