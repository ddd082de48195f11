# SPDX-License-Identifier: BSD-3-Clause
"""Damped joints: the closed forms, and that no damping at any step ever drives a joint."""
import math
from dataclasses import replace

import pytest

from conftest import ENGINES
from m2wr_sim.geometry import IDENTITY, quaternion_from_rpy
from m2wr_sim.model.types import Axis, Inertial, Joint, Link, Model
from m2wr_sim.physics.dampers import mobilities
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine as engine_of_kind

INERTIA = 0.5
STRONG = (1.0, 1e3, 1e9, 1e300)
STEPS_MS = (0.01, 1.0, 20.0, 100.0)


def link(name, moment=INERTIA, mass=1.0, **fields):
    return Link(name, gravity=False, inertial=Inertial(mass, inertia=(moment, 0.0, 0.0, moment, 0.0, moment)), **fields)


def rotor(damping, kind="revolute", **axis):
    """Return a link of 0.5 kg m^2 and 1 kg on a damped joint to the world."""
    return Model("rotor", (link("link"),), (
        Joint("turn", kind, "world", "link", axis=Axis(damping=damping, **axis)),))


def started(engine, kind="revolute"):
    """Give the first model's first link a speed of one along z; returns the model's handle."""
    handle = engine.handles[0]
    speeds = [(0.0, 0.0, 1.0), (0.0, 0.0, 0.0)]         # along, about
    engine.set_link_velocity(next(iter(handle.links.values())), *speeds[::1 if kind == "prismatic" else -1])
    return handle


def dampers(engine):
    return sum(len(drive.dampers) for drive in engine._joints.values())


@pytest.mark.parametrize("step_ms", STEPS_MS)
@pytest.mark.parametrize("damping", (1e-6, 0.1) + STRONG)
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_the_rate_falls_by_its_closed_form_and_never_turns_round(make_engine, damping, step_ms, kind):
    engine = make_engine(step_ms, [rotor(damping, kind)])
    handle = started(engine, kind)
    lost = damping * 1e-3 * step_ms / (1.0 if kind == "prismatic" else INERTIA)
    kept = 1.0 - lost if lost <= 1.0 else 1.0 / (1.0 + min(lost, 1e6))
    rates = [1.0]
    for _ in range(4):
        engine.step(1)
        rates.append(engine.joint_rate(handle.joints["turn"]))
    assert rates[1] == pytest.approx(kept, rel=1e-6, abs=1e-12)
    assert all(-1e-12 <= late <= early + 1e-12 for early, late in zip(rates, rates[1:]))
    assert dampers(engine) == (lost > 1.0)


def test_what_a_force_can_damp_gets_no_damper(make_engine, m2wr):
    engine = make_engine(1.0, [m2wr, rotor(0.9 * INERTIA / 1e-3)])
    assert dampers(engine) == 0


@pytest.mark.parametrize("damping", STRONG)
@pytest.mark.parametrize("step_ms", STEPS_MS)
@pytest.mark.parametrize("moments", [(0.5, 1e-9, 0.5), (1e-6, 1.0, 1e-6, 1.0), (0.1, 0.1, 0.1, 0.1, 0.1)])
def test_energy_never_grows_in_a_chain_of_damped_hinges(make_engine, damping, step_ms, moments):
    links = tuple(link("l%d" % index, moment) for index, moment in enumerate(moments))
    joints = tuple(Joint("j%d" % index, "revolute", one.name, two.name, axis=Axis(damping=damping))
                   for index, (one, two) in enumerate(zip(links, links[1:])))
    engine = make_engine(step_ms, [Model("chain", links, joints)])
    handle = started(engine)
    energies = []
    for _ in range(30):
        engine.step(1)
        spins = [engine.link_state(handle.links[one.name]).angular_velocity[2] for one in links]
        energies.append(sum(0.5 * moment * spin * spin for moment, spin in zip(moments, spins)))
    assert all(late <= early * (1.0 + 1e-6) for early, late in zip(energies, energies[1:]))
    assert math.isfinite(sum(energies))
    assert energies[0] <= 0.5 * moments[0] * (1.0 + 1e-9)


@pytest.mark.parametrize("damping", [8.0, 1e300])
def test_many_dampers_on_one_light_link_together_do_not_drive_it(make_engine, damping):
    links = (link("hub", 0.01),) + tuple(link("arm%d" % index, 1.0) for index in range(8))
    joints = tuple(Joint("j%d" % index, "revolute", "hub", "arm%d" % index, axis=Axis(damping=damping))
                   for index in range(8))
    engine = make_engine(1.0, [Model("star", links, joints)])
    handle = started(engine)
    spins = []
    for _ in range(50):
        engine.step(1)
        spins.append(engine.link_state(handle.links["hub"]).angular_velocity[2])
    assert all(0.0 <= late <= early + 1e-9 for early, late in zip([1.0] + spins, spins))
    assert spins[-1] == pytest.approx(0.01 / 8.01, rel=0.1)          # what was in the hub, now shared by all


@pytest.mark.parametrize("damping", [1.0, 30.0, 300.0, 490.0, 1e4, 1e300])
@pytest.mark.parametrize("apart, moment", [(0.0, 1e-4), (1.0, 1e-4), (10.0, 0.05)])
def test_a_damped_slider_does_not_spin_its_links(make_engine, damping, apart, moment):
    links = (link("one", moment), link("two", moment, pose=((apart, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
    engine = make_engine(1.0, [Model("m", links, (Joint("j", "prismatic", "one", "two", axis=Axis(damping=damping)),))])
    started(engine, "prismatic")
    for _ in range(200):
        engine.step(1)
        states = [engine.link_state(number) for number in engine.handles[0].links.values()]
        energy = sum(0.5 * sum(value * value for value in state.linear_velocity)
                     + 0.5 * moment * sum(value * value for value in state.angular_velocity) for state in states)
        assert energy <= 0.5


def test_a_longer_step_is_stable_and_the_old_one_unchanged(make_engine):
    engine = make_engine(1.0, [rotor(100.0)])
    handle = started(engine)
    engine.step(1)
    assert dampers(engine) == 0 and engine.joint_rate(handle.joints["turn"]) == pytest.approx(0.8)
    engine.configure(replace(engine.settings, step_ns=100000000))
    engine.step(1)
    assert dampers(engine) == 1 and engine.joint_rate(handle.joints["turn"]) == pytest.approx(0.8 / 21.0)
    engine.configure(replace(engine.settings, step_ns=1000000))
    engine.step(1)
    assert dampers(engine) == 0 and engine.joint_rate(handle.joints["turn"]) == pytest.approx(0.64 / 21.0)


@pytest.mark.parametrize("damping", [0.5, 1e6])
def test_a_motor_works_against_the_damping(make_engine, damping):
    engine = make_engine(1.0, [rotor(damping)])
    handle = engine.handles[0]
    engine.set_joint_motor(handle.joints["turn"], 5.0, 2.0)
    engine.step(20000)
    assert engine.joint_rate(handle.joints["turn"]) == pytest.approx(2.0 / damping, rel=1e-2)


def test_engines_agree_bit_for_bit_with_dampers():
    found = {}
    for kind in ENGINES:
        engine = engine_of_kind(kind, EngineSettings(step_ns=5000000))
        links = tuple(link("l%d" % index, 0.05) for index in range(3))
        joints = (Joint("first", "revolute", "l0", "l1", axis=Axis(damping=500.0)),
                  Joint("second", "revolute", "l1", "l2", axis=Axis(damping=0.001)),
                  Joint("third", "revolute", "world", "l0"))
        handle = engine.add_model(Model("chain", links, joints), IDENTITY)
        engine.set_joint_motor(handle.joints["second"], 20.0, 5.0)
        engine.set_joint_motor(handle.joints["third"], 3.0, 50.0)
        engine.step(400)
        found[kind] = [(engine.joint_angle(joint), engine.joint_rate(joint)) for joint in handle.joints.values()]
        angles = [angle for angle, _ in found[kind]]
        assert angles[1] == pytest.approx(40.0, rel=0.1)                # less what it takes to get there
        assert angles[2] == pytest.approx(6.0, rel=0.05) and angles[0] == pytest.approx(0.0, abs=0.1)
        engine.close()
    assert len({str(entry) for entry in found.values()}) == 1


def test_a_model_with_dampers_goes_and_comes_back_the_same(make_engine):
    rates = []
    engine = make_engine(1.0, [])
    for _ in range(2):
        engine.handles = [engine.add_model(rotor(1e4), IDENTITY)]
        handle = started(engine)
        engine.step(3)
        rates.append(engine.joint_rate(handle.joints["turn"]))
        engine.remove_model(handle)
        engine.step(1)
    assert rates[0] == rates[1] == pytest.approx(1.0 / 21.0 ** 3, rel=1e-6)


def test_mobility_of_a_joint_counts_along_its_axis(make_engine):
    turned = Link("child", ((0.0, 0.0, 0.0), quaternion_from_rpy(0.5 * math.pi, 0.0, 0.0)),
                  inertial=Inertial(2.0, inertia=(0.1, 0.0, 0.0, 0.2, 0.0, 0.4)))
    parent = Link("parent", inertial=Inertial(4.0, ((0.0, 0.0, 0.0), quaternion_from_rpy(0.5 * math.pi, 0.0, 0.0)),
                                              (1.0, 0.0, 0.0, 2.0, 0.0, 5.0)))
    for kind, expected in (("revolute", [1.0 / 0.4, 1.0 / 5.0]), ("prismatic", [0.5, 0.25])):
        engine = make_engine(1.0, [Model("m", (parent, turned), (Joint("j", kind, "parent", "child"),))])
        drive, = engine._joints.values()
        links = {entry.spec.name: entry for entry in engine._links.values()}
        assert mobilities(drive, links) == pytest.approx(expected)


# ---- joints with two axes ---------------------------------------------------------------------------------------

def cross(**axes):
    """Return a link on a universal joint to the world: the first axis along x, the second along y."""
    first, second = (Axis(xyz=xyz, **axes.get(name, {})) for name, xyz in (("first", (1.0, 0.0, 0.0)),
                                                                           ("second", (0.0, 1.0, 0.0))))
    return Model("cross", (link("link"),), (Joint("joint", "universal", "world", "link", axis=first, axis2=second),))


@pytest.mark.parametrize("axis, speed", [("first", (1.0, 0.0, 0.0)), ("second", (0.0, 1.0, 0.0))])
def test_each_axis_of_a_universal_joint_has_its_own_damping(make_engine, axis, speed):
    for damping, kept in ((0.0, 1.0), (INERTIA / 1e-3, 0.5 ** 3)):
        engine = make_engine(1.0, [cross(**{axis: {"damping": damping}, "first" if axis == "second" else "second":
                                            {"damping": 1e5}})])
        part = engine.handles[0].links["link"]
        engine.set_link_velocity(part, (0.0, 0.0, 0.0), speed)
        engine.step(3)
        spin = engine.link_state(part).angular_velocity
        assert sum(a * b for a, b in zip(spin, speed)) == pytest.approx(kept, rel=1e-3)


@pytest.mark.parametrize("index, speed", [(0, (2.0, 0.0, 0.0)), (1, (0.0, 2.0, 0.0))])
def test_motors_and_stops_act_on_the_axis_they_are_given_for(make_engine, index, speed):
    engine = make_engine(1.0, [cross()])
    handle = engine.handles[0]
    axis = cross().joints[0].axes()[index]
    engine.change_joint(handle.joints["joint"], axis, {"rate": 2.0, "max_force": 50.0}, index)
    engine.step(200)
    spin = engine.link_state(handle.links["link"]).angular_velocity
    assert [abs(value) for value in spin] == pytest.approx([abs(value) for value in speed], abs=1e-3)
    engine.change_joint(handle.joints["joint"], axis, {"lower": -0.5, "upper": 0.5}, index)
    engine.step(2000)
    spin = engine.link_state(handle.links["link"]).angular_velocity
    assert max(map(abs, spin)) < 0.01


# -- springs --------------------------------------------------------------------------------------------------------

def sprung(stiffness, damping=0.0, kind="revolute", reference=0.4):
    return rotor(damping, kind, spring_stiffness=stiffness, spring_reference=reference)


@pytest.mark.parametrize("kind, moved", [("revolute", INERTIA), ("prismatic", 1.0)])
@pytest.mark.parametrize("damping", [0.0, 3.0, 1e5])
@pytest.mark.parametrize("stiffness", [1e3, 1e6, 1e12])
def test_a_stiff_spring_follows_the_implicit_formula(make_engine, kind, moved, damping, stiffness):
    step = 0.1
    engine = make_engine(1e3 * step, [sprung(stiffness, damping, kind)])
    joint, away, rate = engine.handles[0].joints["turn"], -0.4, 0.0
    for _ in range(6):
        engine.step(1)
        bound = 1e6 * moved / step                  # past that the solver's own compliance says what happens
        strength = step * stiffness + damping
        used = min(strength, bound)
        gain = step * used / moved
        rate = (rate - gain * stiffness / strength * away) / (1.0 + gain)
        assert engine.joint_rate(joint) == pytest.approx(rate, rel=1e-5, abs=1e-5)
        away = engine.joint_angle(joint) - 0.4      # libode turns by a little less than rate times step
    assert dampers(engine) == 1


@pytest.mark.parametrize("step_ms", STEPS_MS)
@pytest.mark.parametrize("stiffness", [1.0, 50.0, 1e4, 1e9, 1e300])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_no_spring_gains_amplitude_at_any_step(make_engine, stiffness, step_ms, kind):
    engine = make_engine(step_ms, [sprung(stiffness, 0.0, kind)])
    joint, seen = engine.handles[0].joints["turn"], []
    for _ in range(300):
        engine.step(1)
        seen.append(abs(engine.joint_angle(joint) - 0.4))
    assert max(seen) <= 0.4 * 1.2                   # a force found before the step overshoots by less than that
    if dampers(engine):
        assert seen[-1] < 0.01


def test_a_chain_of_stiff_springs_comes_to_rest(make_engine):
    links = tuple(link("l%d" % index, 0.01) for index in range(5))
    joints = tuple(Joint("j%d" % index, "revolute", one.name, two.name, axis=Axis(
        spring_stiffness=1e7, spring_reference=0.1 * (index + 1)))
                   for index, (one, two) in enumerate(zip(links, links[1:])))
    engine = make_engine(5.0, [Model("chain", links, joints)])
    engine.step(400)
    for index, joint in enumerate(engine.handles[0].joints.values()):
        assert engine.joint_angle(joint) == pytest.approx(0.1 * (index + 1), abs=1e-6)
        assert abs(engine.joint_rate(joint)) < 1e-6


def test_a_spring_between_stops_rests_at_the_stop(make_engine):
    engine = make_engine(5.0, [rotor(0.0, spring_stiffness=1e5, spring_reference=0.4, lower=-0.2, upper=0.2,
                                     stop_erp=0.2, stop_cfm=0.0)])
    joint = engine.handles[0].joints["turn"]
    engine.step(400)
    assert 0.15 < engine.joint_angle(joint) < 0.41 and abs(engine.joint_rate(joint)) < 1e-6


def test_a_spring_made_stiff_and_soft_again_changes_sides(make_engine):
    engine = make_engine(1.0, [sprung(8.0)])
    joint = engine.handles[0].joints["turn"]
    axis = engine._joints[joint].spec.axis
    engine.step(10)
    for stiffness, count in ((1e8, 1), (8.0, 0)):
        engine.change_joint(joint, replace(axis, spring_stiffness=stiffness), {})
        assert dampers(engine) == count
        engine.step(200)
        assert engine.joint_angle(joint) == pytest.approx(0.4, abs=1e-3)


def test_a_damper_that_was_a_spring_wants_rest(make_engine):
    engine = make_engine(1.0, [sprung(1e8)])
    joint = engine.handles[0].joints["turn"]
    axis = engine._joints[joint].spec.axis
    engine.step(1)
    engine.change_joint(joint, replace(axis, spring_stiffness=0.0, damping=1e5), {})
    engine.step(200)
    assert dampers(engine) == 1 and abs(engine.joint_rate(joint)) < 1e-9


def test_engines_agree_bit_for_bit_with_springs():
    found = {}
    for kind in ENGINES:
        engine = engine_of_kind(kind, EngineSettings(step_ns=5000000))
        links = tuple(link("l%d" % index, 0.05, pose=((0.1 * index, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
                      for index in range(5))
        springs = ((3.0, 0.0), (1e6, 0.0), (1e9, 4.0), (-0.5, 0.0))
        joints = tuple(Joint("j%d" % index, "prismatic" if index == 2 else "revolute", "l%d" % index,
                             "l%d" % (index + 1), axis=Axis(spring_stiffness=stiffness, spring_reference=0.2,
                                                            damping=damping))
                       for index, (stiffness, damping) in enumerate(springs))
        handle = engine.add_model(Model("chain", links, joints), IDENTITY)
        other = engine.add_model(sprung(1e5), ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), "other")
        engine.step(100)
        engine.change_joint(other.joints["turn"], Axis(spring_stiffness=1e6, spring_reference=-0.3), {})
        engine.step(100)
        found[kind] = [(engine.joint_angle(joint), engine.joint_rate(joint))
                       for joint in list(handle.joints.values()) + list(other.joints.values())]
        engine.close()
    assert len({str(entry) for entry in found.values()}) == 1
    assert found[ENGINES[0]][4][0] == pytest.approx(-0.3, abs=1e-3)
