# SPDX-License-Identifier: BSD-3-Clause
"""Coulomb's law where wheels press a robot against something: friction cones, sliding along walls, climbing edges."""
import math
import time

import pytest

from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Axis, Box, Collision, Cylinder, Inertial, Joint, Link, Model, Sphere, Surface
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine as engine_of_kind

RADIUS, WHEEL_MASS, WHEEL_INERTIA, CHASSIS_MASS = 0.1, 0.2, 1e-3, 5.0     # m, kg, kg m^2 about the axle, kg
ACROSS = quaternion_from_rpy(math.pi / 2, 0.0, 0.0)
NOSES = {"ball": Sphere(0.05), "cylinder": Cylinder(0.05, 0.1)}
TORQUE = 0.5                                                             # N m of each motor
PUSH = 2.0 * TORQUE / RADIUS                                             # N


def cart(collisions, inertia, com=(0.0, 0.0, 0.0), surface=Surface()):
    """Return a chassis on two wheels, its frame at the height of the axle."""
    links, joints = [Link("chassis", inertial=Inertial(CHASSIS_MASS, (com, (0.0, 0.0, 0.0, 1.0)), inertia),
                          collisions=tuple(collisions))], []
    for name, y in (("left", 0.15), ("right", -0.15)):
        links.append(Link(name, ((0.0, y, 0.0), (0.0, 0.0, 0.0, 1.0)),
                          Inertial(WHEEL_MASS, inertia=(5e-4, 0.0, 0.0, WHEEL_INERTIA, 0.0, 5e-4)),
                          (Collision(name, Cylinder(RADIUS, 0.04), ((0.0, 0.0, 0.0), ACROSS), surface),)))
        joints.append(Joint(name, "revolute", "chassis", name, axis=Axis(xyz=(0.0, 1.0, 0.0))))
    return Model("cart", tuple(links), tuple(joints), pose=((0.0, 0.0, RADIUS), (0.0, 0.0, 0.0, 1.0)))


def glider(nose, mu):
    """Return a cart that cannot turn, for its inertia, and slides sideways: its wheels grip along their way only."""
    smooth = Surface(mu=0.0, mu2=0.0)
    feet = [Collision("foot%d%d" % (x, y), Sphere(0.05), ((0.1 * x, 0.1 * y, -0.05), (0.0, 0.0, 0.0, 1.0)), smooth)
            for x in (-1, 1) for y in (-1, 1)]
    tip = Collision("nose", nose, ((0.35, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), Surface(mu=mu, mu2=mu))
    return cart(feet + [tip], (1e3, 0.0, 0.0, 1e3, 0.0, 1e3), surface=Surface(mu=1e-4, mu2=1.0, fdir1=(0.0, 0.0, 1.0)))


def press(make_engine, build, nose, mu, angle):
    """Return an engine and the chassis of a glider whose motors press it against a wall, obliquely by ``angle``."""
    away = 0.05 + 0.1 + 1e-4
    wall = build.one_link("wall", Box((0.2, 6.0, 1.0)), build.at(
        0.35 + away * math.cos(angle), away * math.sin(angle), 0.5, yaw=angle), surface=Surface(mu=10.0, mu2=10.0))
    engine = make_engine(1.0, [build.ground(), wall, glider(nose, mu)])
    for joint in engine.handles[2].joints.values():
        engine.set_joint_motor(joint, 1e3, TORQUE)
    engine.step(200)
    return engine, engine.handles[2].links["chassis"]


def along(engine, link, angle):
    """Return where a link is along the wall [m] and how fast it moves along it and into it [m/s]."""
    state = engine.link_state(link)
    (x, y, _), (vx, vy, _) = state.position, state.linear_velocity
    return (x * math.sin(angle) - y * math.cos(angle), vx * math.sin(angle) - vy * math.cos(angle),
            vx * math.cos(angle) + vy * math.sin(angle))


@pytest.mark.parametrize("nose", NOSES)
@pytest.mark.parametrize("mu, degrees", [(0.2, 8), (0.5, 20), (1.0, 30), (1.0, 42)])
def test_a_robot_inside_the_friction_cone_does_not_slip(make_engine, build, nose, mu, degrees):
    engine, chassis = press(make_engine, build, NOSES[nose], mu, math.radians(degrees))
    before, speed, _ = along(engine, chassis, math.radians(degrees))
    engine.step(1000)
    after, _, _ = along(engine, chassis, math.radians(degrees))
    assert abs(speed) < 1e-3 and abs(after - before) < 1e-3         # sliding without friction: 0.25 m and more


@pytest.mark.parametrize("nose", NOSES)
@pytest.mark.parametrize("mu, degrees", [(0.0, 30), (0.2, 30), (0.5, 35), (0.5, 60), (1.0, 55)])
def test_beyond_it_a_robot_slides_along_the_wall_as_coulomb_says(make_engine, build, nose, mu, degrees):
    """Pressed by P at an angle a to the wall's normal, N = P cos a, and along the wall m s'' = P sin a - mu N.

    Of the motors' push the wheels take I s'' sin a / r^2 each for themselves, to be turned faster.
    """
    angle = math.radians(degrees)
    engine, chassis = press(make_engine, build, NOSES[nose], mu, angle)
    slope = math.sin(angle) - mu * math.cos(angle)
    mass = CHASSIS_MASS + 2.0 * WHEEL_MASS + 2.0 * WHEEL_INERTIA / RADIUS ** 2 * math.sin(angle) * slope
    expected = PUSH * slope / mass
    before, first, _ = along(engine, chassis, angle)
    engine.step(500)
    after, last, into = along(engine, chassis, angle)
    assert (last - first) / 0.5 == pytest.approx(expected, rel=0.02)
    assert abs(into) < 1e-3
    # the work of the motors, less that of friction, is what it moves with
    assert 0.5 * mass * (last ** 2 - first ** 2) == pytest.approx(PUSH * slope * (after - before), rel=0.03)


@pytest.mark.parametrize("mu, climbs", [(0.8, False), (1.3, True)])
def test_driven_wheels_climb_an_edge_by_friction_alone(make_engine, build, mu, climbs):
    """At an edge of height h the normal points up by asin(1 - h/r); it carries the load where mu is the cotangent.

    For h = 3 cm, r = 10 cm that is mu = 1.02.
    """
    edge = 0.03
    foot = Collision("foot", Sphere(0.05), ((-0.3, 0.0, -0.05), (0.0, 0.0, 0.0, 1.0)), Surface(mu=0.0, mu2=0.0))
    robot = cart([foot], (0.05, 0.0, 0.0, 0.1, 0.0, 0.1), (-0.05, 0.0, 0.0), Surface(mu=mu, mu2=mu))
    start = math.sqrt(RADIUS ** 2 - (RADIUS - edge) ** 2) + 1e-3        # from the axle to the edge
    step = build.box("step", start + 0.5, 0.0, 0.5 * edge, size=(1.0, 2.0, edge), surface=Surface(mu=10.0, mu2=10.0))
    engine = make_engine(1.0, [build.ground(), step, robot])
    for joint in engine.handles[2].joints.values():
        engine.set_joint_motor(joint, 1.0, 5.0)
    engine.step(4000)
    x, _, z = engine.link_state(engine.handles[2].links["chassis"]).position
    if climbs:
        assert x > start + 0.05 and z == pytest.approx(RADIUS + edge, abs=0.005)
    else:
        assert x < 0.02 and z < RADIUS + 0.01


def test_a_robot_on_the_ground_alone_is_solved_once(make_engine, build, m2wr, drive):
    """The repetition is for what presses against something: driving gives the same numbers with and without it."""
    def end(solves):
        engine = make_engine(1.0, [build.ground()], friction_solves=solves)
        handle = engine.add_model(m2wr, build.at(z=0.1))
        drive(engine, handle, 0.4, 0.6)
        engine.step(1500)
        return engine.link_state(handle.links["link_chassis"])
    assert end(1) == end(5)


def pressing(engine, build, robot, count, walls):
    """Add robots that drive backwards, the first of them against walls of their own; returns their handles."""
    handles = []
    for index in range(count):
        if index < walls:
            wall = build.box("wall%d" % index, -1.0, 2.0 * index, 0.5, size=(0.2, 1.5, 1.0))
            engine.add_model(wall, wall.pose)
        handles.append(engine.add_model(robot, build.at(0.0, 2.0 * index, 0.1), "robot%d" % index))
        for joint in handles[-1].joints.values():
            engine.set_joint_motor(joint, -5.0, 5.0)
    return handles


@pytest.mark.parametrize("walls", [0, 1])
def test_bodies_fall_asleep_after_a_second_with_corrections(make_engine, build, m2wr, walls):
    """The step at which Gazebo's rule lets them is the same with and without a robot that presses a wall elsewhere."""
    crate = build.box("crate", 5.0, 0.0, 0.15, size=(0.3,) * 3, static=False, mass=1.0)
    engine = make_engine(1.0, [build.ground()])
    pressing(engine, build, m2wr, 1, walls)
    engine.step(2500)                                       # it is at the wall
    body = engine._links[engine.add_model(crate, crate.pose).links["link"]].body
    asleep = 0
    while body.isEnabled() and asleep < 3000:
        engine.step(1)
        asleep += 1
    assert 1000 <= asleep <= 1010


def costs(build, robot, walls, solves):
    """Return the least CPU times [s] of 0.5 s with 30 robots, the first ones at walls, for each number of solves.

    They are measured in turn, so that a machine whose speed changes does not favour one.
    """
    engines = []
    for count in solves:
        engine = engine_of_kind("auto", EngineSettings(step_ns=5000000, friction_solves=count))
        engine.add_model(build.ground(), build.at())
        pressing(engine, build, robot, 30, walls)
        engine.step(400)
        engines.append(engine)
    times = [[] for _ in engines]
    for _ in range(8):
        for engine, found in zip(engines, times):
            started = time.process_time()
            engine.step(100)
            found.append(time.process_time() - started)
    for engine in engines:
        engine.close()
    return [min(found) for found in times]


@pytest.mark.parametrize("walls, bound", [(1, 1.5), (30, 3.0)])
def test_only_what_needs_it_is_solved_again(build, m2wr, walls, bound):
    """One robot at a wall does not make the step of 29 others dearer; at rest limits agree with the step before."""
    often, once = costs(build, m2wr, walls, (5, 1))
    assert often < bound * once


@pytest.mark.parametrize("mu", [0.2, 0.5, 1.0])
def test_wheels_at_a_wall_lift_what_friction_can_carry(make_engine, build, mu):
    """The ground carries N, its grip P = mu N presses the wheels to the wall, whose friction mu P lifts the robot.

    With the foot d behind the axle, moments about the foot give N (d + mu r + mu^2 (d + r)) = W d_W, the moment of the
    weight.  A friction of 1 takes most of the load off the wheels: what stands beside them they climb on where others
    push, too.  With 0.2 it is 4 % of the load.
    """
    back = 0.3
    foot = Collision("foot", Sphere(0.05), ((-back, 0.0, -0.05), (0.0, 0.0, 0.0, 1.0)), Surface(mu=0.0, mu2=0.0))
    robot = cart([foot], (0.05, 0.0, 0.0, 0.1, 0.0, 0.1), (-0.05, 0.0, 0.0), Surface(mu=mu, mu2=mu))
    wall = build.box("wall", RADIUS + 0.1 + 1e-3, 0.0, 0.5, size=(0.2, 2.0, 1.0), surface=Surface(mu=10.0, mu2=10.0))
    engine = make_engine(1.0, [build.ground(), wall, robot])
    watch = engine.watch_contacts(["cart::left::left", "cart::right::right"])
    for joint in engine.handles[2].joints.values():
        engine.set_joint_motor(joint, 1.0, 5.0)
    engine.step(1000)
    watch.drain()
    engine.step(100)
    felt = [report for pair in watch.drain() for report in pair]
    ground = sum(report.force[2] for report in felt if report.second.startswith("ground"))
    push = -sum(report.force[0] for report in felt if report.second.startswith("wall"))
    weight = 9.8 * (CHASSIS_MASS * (back - 0.05) + 2.0 * WHEEL_MASS * back)
    expected = weight / (back + mu * RADIUS + mu ** 2 * (back + RADIUS))
    assert ground == pytest.approx(expected, rel=0.02) and push == pytest.approx(mu * expected, rel=0.02)


@pytest.mark.parametrize("speed", [-0.2, 0.0, 0.3])
def test_two_robots_of_equal_push_keep_their_speed(make_engine, build, speed):
    """Wheels that slip push with mu times their load at whatever speed: forces cancel, and nothing stops the pair.

    So if such a pair begins to drift, it accelerates up to the speed at which one robot's wheels roll.
    """
    smooth = Surface(mu=0.0, mu2=0.0)
    foot = Collision("foot", Sphere(0.05), ((-0.3, 0.0, -0.05), (0.0, 0.0, 0.0, 1.0)), smooth)
    nose = Collision("nose", Box((0.1, 0.3, 0.02)), ((0.3, 0.0, -RADIUS + 0.05), (0.0, 0.0, 0.0, 1.0)), smooth)
    robot = cart([foot, nose], (0.05, 0.0, 0.0, 0.1, 0.0, 0.1), (-0.05, 0.0, 0.0))
    engine = make_engine(1.0, [build.ground()])
    handles = [engine.add_model(robot, build.at(x, 0.0, RADIUS, yaw), name)
               for name, x, yaw in (("one", -0.3505, 0.0), ("two", 0.3505, math.pi))]
    for handle in handles:
        for joint in handle.joints.values():
            engine.set_joint_motor(joint, 0.5 / RADIUS, 5.0)
    engine.step(500)
    for handle in handles:
        for link in handle.links.values():
            engine.set_link_velocity(link, (speed, 0.0, 0.0), engine.link_state(link).angular_velocity)
    for _ in range(10):
        engine.step(100)
        for handle in handles:
            assert engine.link_state(handle.links["chassis"]).linear_velocity[0] == pytest.approx(speed, abs=0.02)
