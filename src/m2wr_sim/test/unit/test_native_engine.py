"""The compiled loop against the Python loop: the same numbers to the last bit."""
import math
import random

import pytest
from m2wr_sim.errors import ParameterError
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import (Axis, Box, Collision, Cylinder, Inertial, Joint, Link, Model, Plane, Sphere, Surface)
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.physics.pyode_engine import PyodeEngine

pytest.importorskip("numba", reason="the compiled loop needs numba")
native_ode.publish_symbols()
native = pytest.importorskip("m2wr_sim.physics.native_engine")

WHEEL = quaternion_from_rpy(0.0, 1.5707, 1.5707)
NO_TURN = (0.0, 0.0, 0.0, 1.0)


def robot():
    chassis = Link("chassis", inertial=Inertial(6.0, ((0.025, 0.0, 0.09), NO_TURN), (0.04, 0.0, 0.0, 0.12, 0.0, 0.12)),
                   collisions=(Collision("box", Box((0.5, 0.3, 0.07))),
                               Collision("caster", Sphere(0.05), ((0.35, 0.0, -0.05), NO_TURN),
                                         Surface(mu=0.0, mu2=0.0))))

    def wheel(name, y):
        return Link(name, ((-0.05, y, 0.0), NO_TURN), Inertial(0.2, inertia=(5e-4, 0.0, 0.0, 1e-3, 0.0, 5e-4)),
                    (Collision(name, Cylinder(0.1, 0.04), ((0.0, 0.0, 0.0), WHEEL)),))

    return Model("robot", (chassis, wheel("left", 0.2), wheel("right", -0.2)), tuple(
        Joint(name, "revolute", "chassis", name, axis=Axis((0.0, 1.0, 0.0))) for name in ("left", "right")))


def solid(name, geometry, mass=None, surface=Surface()):
    inertial = Inertial(mass or 1.0, inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
    link = Link("link", inertial=inertial, collisions=(Collision("shape", geometry, surface=surface),))
    return Model(name, (link,), static=mass is None)


def build(engine_class, step_ns=1000000, solver="step"):
    """A crowd: floor, obstacles, two robots, things to push."""
    engine = engine_class(EngineSettings(step_ns=step_ns, solver=solver))
    engine.reseed(7)
    engine.add_model(solid("floor", Plane()), ((0.0, 0.0, 0.0), NO_TURN))
    places = random.Random(1)
    for index in range(30):
        angle, distance = places.uniform(0.0, 2.0 * math.pi), places.uniform(1.2, 6.0)
        shape = Box((0.5, 0.3, 1.0)) if index % 2 else Cylinder(0.2, 1.0)
        engine.add_model(solid("obstacle%d" % index, shape),
                         ((distance * math.cos(angle), distance * math.sin(angle), 0.5),
                          quaternion_from_rpy(0.0, 0.0, angle)))
    robots = [engine.add_model(robot(), ((0.0, 0.9 * index, 0.3), NO_TURN), "robot%d" % index) for index in range(2)]
    rubber = Surface(restitution=0.5, restitution_threshold=0.0, kp=1e5)
    free = [engine.add_model(solid("crate", Box((0.3, 0.3, 0.3)), 1.0),
                             ((0.9, 0.0, 0.5), quaternion_from_rpy(0.1, 0.2, 0.3))),
            engine.add_model(solid("ball", Sphere(0.2), 0.5, rubber), ((0.9, 0.9, 0.9), NO_TURN))]
    return engine, robots, free


def drive(engine, robots, free, batch, rounds=12, steps=250):
    """Drive with random wheel speeds; returns every state seen on the way, and the touches."""
    speeds, seen = random.Random(3), []
    for turn in range(rounds):
        for handle in robots:
            for joint in handle.joints.values():
                engine.set_joint_motor(joint, speeds.uniform(-10.0, 15.0), 5.0)
        done = 0
        while done < steps:
            engine.step(min(batch, steps - done))
            done += min(batch, steps - done)
        seen.extend(engine.link_state(link) for handle in robots + free for link in handle.links.values())
        seen.extend(engine.joint_angle(joint) for handle in robots for joint in handle.joints.values())
        if turn == rounds // 2:
            engine.remove_model(free.pop())
    return seen, engine.drain_touches()


@pytest.mark.parametrize("step_ns, solver", [(1000000, "step"), (5000000, "step"), (1000000, "quick")])
def test_same_bits_as_the_python_loop_for_any_batch_length(step_ns, solver):
    results = []
    for engine_class, batch in ((PyodeEngine, 7), (native.NativeEngine, 50), (native.NativeEngine, 1)):
        engine, robots, free = build(engine_class, step_ns, solver)
        results.append(drive(engine, robots, free, batch))
        engine.close()
    assert results[0][1], "nothing was touched: the scene tests too little"
    assert results[1] == results[0]
    assert results[2] == results[0]


def test_worlds_the_compiled_loop_leaves_to_pyode_are_the_same_too():
    results = []
    for engine_class in (PyodeEngine, native.NativeEngine):
        engine, robots, free = build(engine_class)
        damped = Model("damped", (Link("link", inertial=Inertial(1.0, inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01)),
                                       collisions=(Collision("shape", Sphere(0.1)),), linear_damping=0.01),))
        engine.step(20)
        handle = engine.add_model(damped, ((-1.0, 0.0, 1.0), NO_TURN))
        first = drive(engine, robots, free, 10, rounds=2)
        engine.remove_model(handle)
        results.append((first, drive(engine, robots, free, 10, rounds=2)))
        engine.close()
    assert results[0] == results[1]


def test_a_world_without_bodies_lets_time_pass():
    engine = native.NativeEngine(EngineSettings())
    engine.add_model(solid("floor", Plane()), ((0.0, 0.0, 0.0), NO_TURN))
    engine.step(100)
    assert engine.drain_touches() == []
    engine.close()


def test_factory_gives_the_compiled_loop_where_it_can_and_refuses_unknown_names():
    for kind, expected in (("auto", native.NativeEngine), ("native", native.NativeEngine), ("pyode", PyodeEngine)):
        engine = make_engine(kind, EngineSettings())
        assert type(engine) is expected
        engine.close()
    with pytest.raises(ParameterError, match="auto, native, pyode"):
        make_engine("bullet", EngineSettings())
