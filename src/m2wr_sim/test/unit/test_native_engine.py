# SPDX-License-Identifier: BSD-3-Clause
"""The compiled loop against the Python loop: the same numbers to the last bit."""
import ctypes
import math
import random

import numpy as np
import pytest

from m2wr_sim.errors import ParameterError, SimError
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Axis, Box, Collision, Cylinder, Inertial, Joint, Link, Model, Plane, Sphere, Surface
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.engine import Engine, EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.physics.pyode_engine import PyodeEngine

pytest.importorskip("numba", reason="the compiled loop needs numba")
native_ode.publish_symbols()
native = pytest.importorskip("m2wr_sim.physics.native_engine")
kernels = pytest.importorskip("m2wr_sim.physics.broad_phase_kernels")

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
    """Many robots: floor, obstacles, two robots, things to push."""
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
    grooved = Surface(mu=0.9, mu2=0.3, fdir1=(1.0, 1.0, 0.2))
    free = [engine.add_model(solid("crate", Box((0.3, 0.3, 0.3)), 1.0, grooved),
                             ((0.9, 0.0, 0.5), quaternion_from_rpy(0.1, 0.2, 0.3))),
            engine.add_model(solid("ball", Sphere(0.2), 0.5, rubber), ((0.9, 0.9, 0.9), NO_TURN))]
    return engine, robots, free


def drive(engine, robots, free, batch, rounds=12, steps=250):
    """Drive with random wheel speeds; returns all states, and the contacts."""
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
    return seen, engine.drain_contact_events()


@pytest.mark.parametrize("step_ns, solver", [(1000000, "step"), (5000000, "step"), (1000000, "quick")])
def test_same_bits_as_the_python_loop_for_any_batch_length(step_ns, solver):
    results = []
    for engine_class, batch in ((PyodeEngine, 7), (native.NativeEngine, 50), (native.NativeEngine, 1)):
        engine, robots, free = build(engine_class, step_ns, solver)
        results.append(drive(engine, robots, free, batch))
        engine.close()
    assert results[0][1], "no contact: the scene tests too little"
    assert results[1] == results[0]
    assert results[2] == results[0]


def test_broad_phase_bounds_change_no_number(monkeypatch):
    results = []
    for bounds in (True, False):
        monkeypatch.setattr(native.NativeEngine, "broad_phase_bounds", bounds)
        engine, robots, free = build(native.NativeEngine)
        results.append(drive(engine, robots, free, 50, rounds=20))
        engine.close()
    assert results[0][1] and results[0] == results[1]


def skittles(engine_class):
    """Things that fall asleep, side by side and on one another, and a robot that drives into them later."""
    engine = engine_class(EngineSettings(step_ns=1000000))
    engine.add_model(solid("floor", Plane()), ((0.0, 0.0, 0.0), NO_TURN))
    for index in range(8):
        engine.add_model(solid("post%d" % index, Box((0.2, 0.2, 1.0))), ((9.0, 2.0 * index, 0.5), NO_TURN))
    handle = engine.add_model(robot(), ((0.0, 0.0, 0.12), NO_TURN), "robot")
    free = [engine.add_model(solid("can%d" % index, Cylinder(0.06, 0.12), 0.4), ((x, y, z), NO_TURN))
            for index, (x, y, z) in enumerate(((1.5, 0.05, 0.06), (1.6, -0.1, 0.06), (1.5, 0.05, 0.2), (1.0, 3.0, 0.06),
                                               (8.82, 0.0, 0.06)))]
    seen = []
    for count, speed in ((1300, 0.0), (1500, 12.0), (700, -8.0)):
        for joint in handle.joints.values():
            engine.set_joint_motor(joint, speed, 5.0)
        for _ in range(count // 50):
            engine.step(50)
            seen.append([engine.link_state(link) for part in [handle] + free for link in part.links.values()])
    contacts = engine.drain_contact_events()
    engine.close()
    return seen, contacts


def test_what_sleeps_far_from_all_others_changes_no_number(monkeypatch):
    results = [skittles(native.NativeEngine)]
    monkeypatch.setattr(native.NativeEngine, "broad_phase_bounds", False)
    results += [skittles(native.NativeEngine), skittles(PyodeEngine)]
    seen, contacts = results[0]
    assert results[1] == results[0] and results[2] == results[0]
    sides = [contact.first + contact.second for contact in contacts]
    assert any("robot" in names and "can" in names for names in sides)
    resting, end = seen[26], seen[-1]
    assert resting[-2] == end[-2] and resting[-5] != end[-5]        # one was left alone, one was pushed


def test_sleeping_models_are_skipped_until_one_is_near():
    engine = native.NativeEngine(EngineSettings(step_ns=1000000))
    engine.add_model(solid("floor", Plane()), ((0.0, 0.0, 0.0), NO_TURN))
    for index in range(4):
        engine.add_model(solid("post%d" % index, Box((0.2, 0.2, 1.0))), ((9.0, 2.0 * index, 0.5), NO_TURN))
    can = engine.add_model(solid("can", Cylinder(0.06, 0.12), 0.4), ((0.0, 0.0, 0.06), NO_TURN))
    other = engine.add_model(solid("other", Cylinder(0.06, 0.12), 0.4), ((3.0, 0.0, 0.06), NO_TURN))

    library = ctypes.CDLL(native_ode.library()._name)
    library.dBodyIsEnabled.argtypes = [ctypes.c_void_p]

    def apart():
        words, layout = engine._block.words, native.layout
        rows = [int(words[layout.H_SPACES]) + index * layout.SPACE_WORDS for index in range(2)]
        return [bool(kernels.sleeps_apart(words, engine._block.values, row)) for row in rows]

    def asleep():
        return [not bool(library.dBodyIsEnabled(engine._handles[engine._links[link]])) for part in (can, other)
                for link in part.links.values()]

    engine.step(10)
    assert asleep() == apart() == [False, False]
    engine.step(2000)
    assert asleep() == apart() == [True, True]
    engine.set_link_pose(next(iter(other.links.values())), ((0.15, 0.0, 0.06), NO_TURN))
    engine.step(2000)
    assert asleep() == [True, True] and apart() == [False, False]       # near one another, but not in contact
    engine.set_link_pose(next(iter(other.links.values())), ((2.0, 0.0, 0.06), NO_TURN))
    engine.step(2000)
    assert asleep() == apart() == [True, True]
    engine.set_link_velocity(next(iter(can.links.values())), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    assert apart() == [False, True]
    engine.close()


def free_flags(engine):
    """Tell of each movable model whether the engine believes that nothing but the ground is near it."""
    words = engine._block.words
    return [bool(words[int(words[native.layout.H_SPACES]) + index * native.layout.SPACE_WORDS + native.layout.S_FREE])
            for index in range(int(words[native.layout.H_SPACE_COUNT]))]


@pytest.mark.parametrize("arrival", ["spawned", "moved"])
def test_wall_placed_inside_the_bounds_stops_the_robot(arrival):
    engine = native.NativeEngine(EngineSettings())
    engine.add_model(solid("floor", Plane()), ((0.0, 0.0, 0.0), NO_TURN))
    for index in range(6):                  # more shapes than the robot has: else it asks for everything anyway
        engine.add_model(solid("post%d" % index, Cylinder(0.1, 1.0)), ((20.0, index, 0.5), NO_TURN))
    wall = solid("wall", Box((0.1, 3.0, 1.0)))
    far = engine.add_model(wall, ((30.0, 0.0, 0.5), NO_TURN)) if arrival == "moved" else None
    handle = engine.add_model(robot(), ((0.0, 0.0, 0.1), NO_TURN))
    for joint in handle.joints.values():
        engine.set_joint_motor(joint, 5.0, 5.0)
    engine.step(200)
    assert free_flags(engine) == [True]
    place = ((0.65, 0.0, 0.5), NO_TURN)
    if far is None:
        engine.add_model(wall, place)
    else:
        engine.set_link_pose(far.links["link"], place)
    engine.step(2000)
    assert free_flags(engine) == [False]
    assert engine.link_pose(handle.links["chassis"])[0][0] < 0.35            # 1.1 without the wall
    assert any("wall" in contact.first + contact.second for contact in engine.drain_contact_events())
    engine.close()


def folding_arm():
    """Four links in a row on damped hinges, the last one on a damped slider; links collide among themselves."""
    def part(index, self_collide):
        return Link("part%d" % index, ((0.32 * index, 0.0, 0.0), NO_TURN),
                    Inertial(0.5, inertia=(0.01, 0.0, 0.0, 0.01, 0.0, 0.01)),
                    (Collision("box", Box((0.3, 0.2, 0.1))), Collision("ball", Sphere(0.1))),
                    self_collide=self_collide, linear_damping=0.001 * index, angular_damping=0.002)

    links = tuple(part(index, index != 2) for index in range(4))
    axis = Axis((0.0, 1.0, 0.0), damping=0.05)
    joints = tuple(Joint("bend%d" % index, "revolute", "part%d" % index, "part%d" % (index + 1),
                         ((-0.16, 0.0, 0.0), NO_TURN), axis) for index in range(2))
    slide = Joint("slide", "prismatic", "part2", "part3",
                  axis=Axis((1.0, 0.0, 0.0), damping=0.5, lower=-0.1, upper=0.1))
    return Model("arm", links, joints + (slide,))


def test_damping_and_self_collision_give_the_same_numbers():
    results = []
    for engine_class in (PyodeEngine, native.NativeEngine):
        engine, robots, free = build(engine_class)
        engine.step(20)
        handle = engine.add_model(folding_arm(), ((-1.0, 0.0, 1.0), NO_TURN))
        for joint, rate in (("bend0", -3.0), ("bend1", -3.0), ("slide", 0.2)):
            engine.set_joint_motor(handle.joints[joint], rate, 4.0)
        seen, contacts = drive(engine, robots, [handle] + free, 10, rounds=3)
        itself = [one for one in contacts if one.first.startswith("arm") and one.second.startswith("arm")]
        results.append((seen, contacts, [engine.joint_angle(joint) for joint in handle.joints.values()]))
        assert itself, "no self-collision: the scene tests too little"
        engine.close()
    assert results[0] == results[1]


def test_full_turns_are_counted_across_world_changes():
    for engine_class in (PyodeEngine, native.NativeEngine):
        engine, robots, _ = build(engine_class)
        joint = robots[0].joints["left"]
        engine.set_joint_motor(joint, 10.0, 5.0)
        engine.step(1500)
        turned = engine.joint_angle(joint)
        assert turned > 2.0 * math.pi
        engine.add_model(solid("late", Sphere(0.1), 1.0), ((5.0, 5.0, 1.0), NO_TURN))
        assert engine.joint_angle(joint) == turned
        engine.step(100)
        assert turned < engine.joint_angle(joint) < turned + 1.5
        engine.set_joint_angle(joint, 0.0)
        assert engine.joint_angle(joint) == 0.0
        engine.close()


@pytest.mark.parametrize("axis", [(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)])
@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (math.pi, 0.0, 0.0), (0.3, -0.2, -3.0)])
def test_a_hinge_at_rest_reads_the_same_zero(axis, turn):
    signs = []
    for engine_class in (PyodeEngine, native.NativeEngine):
        engine = engine_class(EngineSettings(gravity=(0.0, 0.0, 0.0)))
        links = tuple(Link(name, pose=((x, 0.0, 0.0), NO_TURN), inertial=Inertial())
                      for name, x in (("one", 0.0), ("two", 0.5)))
        hinge = Joint("hinge", "revolute", "one", "two", axis=Axis(axis))
        handle = engine.add_model(Model("pair", links, (hinge,)), ((0.0, 0.0, 1.0), quaternion_from_rpy(*turn)))
        engine.step(4)
        signs.append((engine.joint_angle(handle.joints["hinge"]),
                      math.copysign(1.0, engine.joint_angle(handle.joints["hinge"]))))
        engine.close()
    assert signs[0] == signs[1]


def test_poses_of_shapes_are_those_of_the_slow_way():
    engine, robots, free = build(native.NativeEngine)
    offset = ((0.1, -0.2, 0.3), quaternion_from_rpy(0.3, -0.2, 1.0))
    parts = [(link, offset) for handle in robots + free for link in handle.links.values()]
    results = [np.zeros((len(parts), 7)) for _ in range(2)]
    read, slow = engine.pose_reader(parts, results[0]), Engine.pose_reader(engine, parts, results[1])
    for extra in range(2):
        engine.step(300)
        read()
        slow()
        assert np.array_equal(*results) and np.all(results[0][:, 3:].any(axis=1))
        engine.add_model(solid("extra%d" % extra, Sphere(0.1), 1.0), ((5.0, 5.0 + extra, 1.0), NO_TURN))
    with pytest.raises(ValueError, match=r"expected \(%d, 7\)" % len(parts)):
        engine.pose_reader(parts, results[0][1:])
    engine.remove_model(free[0])
    with pytest.raises(KeyError):
        read()
    engine.close()


def test_motion_of_a_link_is_that_of_the_slow_way():
    engine, robots, _ = build(native.NativeEngine)
    link = robots[0].links["chassis"]
    engine.set_joint_motor(robots[0].joints["left"], 3.0, 5.0)
    results = [np.zeros(13) for _ in range(2)]
    offset = ((0.1, -0.2, 0.3), quaternion_from_rpy(0.3, -0.2, 1.0))
    read, slow = engine.motion_reader(link, offset, results[0]), Engine.motion_reader(engine, link, offset, results[1])
    engine.step(300)
    read()
    slow()
    np.testing.assert_allclose(*results, rtol=1e-12, atol=1e-12)
    assert np.abs(results[0][7:]).max() > 0.1
    with pytest.raises(ValueError, match=r"expected \(13,\)"):
        engine.motion_reader(link, offset, np.zeros(7))
    engine.close()


def test_a_body_thrown_out_of_the_world_stops_it_and_is_named():
    engine, robots, _ = build(native.NativeEngine)
    engine.step(10)
    engine.set_joint_motor(robots[1].joints["left"], 3.0, 5.0)
    engine.set_link_velocity(robots[1].links["chassis"], (0.0, 0.0, 1e12), (0.0, 0.0, 0.0))
    with pytest.raises(SimError, match=r"step 11 .*robot1::\w+ is at .*Motors: left 3 with up to 5, right"):
        engine.step(100)
    engine.close()


def test_a_world_without_bodies_lets_time_pass():
    engine = native.NativeEngine(EngineSettings())
    engine.add_model(solid("floor", Plane()), ((0.0, 0.0, 0.0), NO_TURN))
    engine.step(100)
    assert engine.drain_contact_events() == []
    engine.close()


def test_factory_selects_an_engine_and_refuses_unknown_names():
    for kind, expected in (("auto", native.NativeEngine), ("native", native.NativeEngine), ("pyode", PyodeEngine)):
        engine = make_engine(kind, EngineSettings())
        assert type(engine) is expected
        engine.close()
    with pytest.raises(ParameterError, match="auto, native, pyode"):
        make_engine("bullet", EngineSettings())


def test_far_static_shapes_collide_as_near_ones():
    """A row of 600 posts reaches 300 m; the robot drives against the last one, as in a world with that post alone."""
    ends = []
    for count in (600, 1):
        engine = make_engine("auto", EngineSettings())
        engine.add_model(Model("ground", (Link("link", collisions=(Collision("plane", Plane((0.0, 0.0, 1.0))),)),),
                               static=True), ((0.0, 0.0, 0.0), NO_TURN))
        for index in range(600 - count, 600):
            post = Model("post%d" % index, (Link("link", collisions=(Collision("post", Box((0.2, 0.2, 1.0))),)),),
                         static=True)
            engine.add_model(post, ((0.5 * (index + 1), 0.0, 0.5), NO_TURN))
        handle = engine.add_model(robot(), ((301.0, 0.0, 0.1), (0.0, 0.0, 1.0, 0.0)))
        assert engine._doublings == (2 if count == 600 else 0) and len(engine._unsettled) == count % 256
        for joint in ("left", "right"):
            engine.set_joint_motor(handle.joints[joint], 5.0, 5.0)
        engine.step(1500)
        ends.append(engine.link_pose(handle.links["chassis"]))
        engine.close()
    assert ends[0] == ends[1] and 300.3 < ends[0][0][0] < 300.8


def test_settled_static_shapes_can_be_removed():
    engine = make_engine("auto", EngineSettings())
    handles = [engine.add_model(Model("post%d" % index, (Link("link", collisions=(
        Collision("post", Box((0.2, 0.2, 1.0))),)),), static=True), ((1.0 * index, 0.0, 0.5), NO_TURN))
        for index in range(300)]
    for handle in handles[::-1]:
        engine.remove_model(handle)
    assert engine._unsettled == [] and not engine._shapes
    engine.close()
