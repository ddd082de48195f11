# SPDX-License-Identifier: BSD-3-Clause
"""No body, and no heap of bodies, gains energy by itself: falling, sliding, rolling, tumbling, bumping, coasting."""
import math

import pytest

from m2wr_sim.geometry import quaternion_from_rpy, rotate, rotate_inverse
from m2wr_sim.model.types import Box, Cylinder, Surface

GRAVITY = 9.8
STEPS = [1, 5]                  # ms
LYING = quaternion_from_rpy(math.pi / 2, 0.0, 0.0)


def energy_of(engine, models):
    """Return kinetic and potential energy [J] of ``[(record, handle), ...]``; height counts from the world's origin."""
    total = 0.0
    for record, handle in models:
        for link in record.links:
            state, inertial = engine.link_state(handle.links[link.name]), link.inertial
            arm = rotate(state.orientation, inertial.pose[0])
            w, v = state.angular_velocity, state.linear_velocity
            velocity = (v[0] + w[1] * arm[2] - w[2] * arm[1], v[1] + w[2] * arm[0] - w[0] * arm[2],
                        v[2] + w[0] * arm[1] - w[1] * arm[0])
            own = rotate_inverse(inertial.pose[1], rotate_inverse(state.orientation, w))
            xx, xy, xz, yy, yz, zz = inertial.inertia
            spin = (xx * own[0] + xy * own[1] + xz * own[2], xy * own[0] + yy * own[1] + yz * own[2],
                    xz * own[0] + yz * own[1] + zz * own[2])
            total += 0.5 * inertial.mass * sum(value * value for value in velocity)
            total += 0.5 * sum(a * b for a, b in zip(own, spin))
            total += inertial.mass * GRAVITY * (state.position[2] + arm[2])
    return total


def most_gained(engine, models, seconds, step_ms):
    """Return by how much the energy ever rises above what it was before, and how much is lost in the end [J]."""
    first = least = energy_of(engine, models)
    gained = 0.0
    for _ in range(int(seconds * 1000 / step_ms)):
        engine.step(1)
        now = energy_of(engine, models)
        gained, least = max(gained, now - least), min(least, now)
    return gained, first - least


def given_back(mass, fall, step_ms):
    """Return what may come back [J]: a body that fell sinks in by up to a step of travel and is lifted at 0.1 m/s."""
    return mass * (GRAVITY * (step_ms * 1e-3 * math.sqrt(2.0 * GRAVITY * fall) + 2e-4) + 0.5 * 0.1 ** 2)


CASES = {
    "ball falls": (lambda build, values: build.sphere("b", 0, 0, 1.0, **values), (0, 0, 0), (0, 0, 0)),
    "box falls on an edge": (lambda build, values: build.one_link(
        "b", Box((0.4, 0.3, 0.2)), ((0, 0, 0.8), quaternion_from_rpy(0.4, 0.6, 0.2)), **values), (0, 0, 0), (0, 0, 0)),
    "box slides": (lambda build, values: build.box("b", 0, 0, 0.1, size=(0.4, 0.3, 0.2), **values),
                   (2, 0, 0), (0, 0, 0)),
    "box slides and turns": (lambda build, values: build.box("b", 0, 0, 0.1, size=(0.4, 0.3, 0.2), **values),
                             (1, 1, 0), (0, 0, 9)),
    "ball rolls": (lambda build, values: build.sphere("b", 0, 0, 0.25, **values), (1, 0, 0), (0, 4, 0)),
    "ball skids": (lambda build, values: build.sphere("b", 0, 0, 0.25, **values), (2, 0, 0), (0, -8, 0)),
    "wheel rolls": (lambda build, values: build.one_link(
        "b", Cylinder(0.2, 0.1), ((0, 0, 0.2), LYING), **values), (1, 0, 0), (0, 5, 0)),
}


@pytest.mark.parametrize("step_ms", STEPS)
@pytest.mark.parametrize("mu, bounce", [(0.0, 0.0), (0.8, 0.0), (0.8, 0.5)])
@pytest.mark.parametrize("name", CASES)
def test_a_single_body_gains_nothing(make_engine, build, name, mu, bounce, step_ms):
    make, linear, angular = CASES[name]
    surface = Surface(mu=mu, mu2=mu, restitution=bounce, restitution_threshold=0.1)
    record = make(build, {"static": False, "mass": 2.0, "surface": surface})
    engine = make_engine(step_ms, [build.one_link("ground", build.ground().links[0].collisions[0].geometry, build.at(),
                                                  surface=surface), record])
    engine.set_link_velocity(engine.handles[1].links["link"], linear, angular)
    gained, lost = most_gained(engine, [(record, engine.handles[1])], 2.0, step_ms)
    fall = record.pose[0][2] if "falls" in name else 0.0
    assert gained < given_back(2.0, fall, step_ms)
    assert lost > (1.0 if fall else 0.0 if "rolls" in name else 0.01 if mu else -1e-3)


@pytest.mark.parametrize("step_ms", STEPS)
@pytest.mark.parametrize("spin", [(0.0, 0.0, 6.0), (6.0, 0.1, 0.0), (0.1, 6.0, 0.1)])      # the last: unstable axis
def test_a_body_that_tumbles_in_free_flight_keeps_what_it_has(make_engine, build, step_ms, spin):
    record = build.box("b", 0, 0, 0, size=(0.4, 0.2, 0.1), static=False, mass=2.0)
    engine = make_engine(step_ms, [record], gravity=(0.0, 0.0, 0.0))
    engine.set_link_velocity(engine.handles[0].links["link"], (0.0, 0.0, 0.0), spin)
    before = energy_of(engine, [(record, engine.handles[0])])
    gained, _ = most_gained(engine, [(record, engine.handles[0])], 4.0, step_ms)
    assert gained < 0.02 * before


@pytest.mark.parametrize("step_ms", STEPS)
def test_bodies_that_bump_into_one_another_gain_nothing(make_engine, build, step_ms):
    records = [build.box("crate%d" % k, 0.05 * k, 0.03 * k, 0.2 + 0.31 * k, size=(0.3, 0.3, 0.3), static=False)
               for k in range(4)] + [build.sphere("ball", -1.0, 0.0, 0.3, radius=0.15, static=False, mass=3.0)]
    engine = make_engine(step_ms, [build.ground()] + records)
    engine.set_link_velocity(engine.handles[-1].links["link"], (4.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    models = list(zip(records, engine.handles[1:]))
    gained, lost = most_gained(engine, models, 3.0, step_ms)
    assert gained < given_back(7.0, 1.0, step_ms) and lost > 10.0
    assert len(engine.drain_contact_events()) > 3              # they did meet


@pytest.mark.parametrize("step_ms", STEPS)
@pytest.mark.parametrize("linear, angular, height", [((0.8, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1),
                                                     ((0.3, 0.2, 0.0), (0.0, 0.0, 2.0), 0.1),
                                                     ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.6)])
def test_a_robot_with_its_motors_off_only_slows_down(make_engine, m2wr, build, step_ms, linear, angular, height):
    engine = make_engine(step_ms, [build.ground()])
    handle = engine.add_model(m2wr, build.at(z=height))
    for joint in handle.joints.values():
        engine.set_joint_motor(joint, 0.0, 0.0)
    engine.step(int(200 / step_ms) if height < 0.2 else 0)
    for link in handle.links.values():
        engine.set_link_velocity(link, linear, angular)
    gained, lost = most_gained(engine, [(m2wr, handle)], 3.0, step_ms)
    assert gained < given_back(6.4, height - 0.1, step_ms) and lost > 0.0
