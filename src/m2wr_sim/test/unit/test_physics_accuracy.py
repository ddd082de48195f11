# SPDX-License-Identifier: BSD-3-Clause
"""How true the report's robot drives, stands and bumps, at steps of 1 to 10 ms."""
import math
import random
from dataclasses import replace

import pytest

from m2wr_sim.geometry import quaternion_from_rpy, rotate, yaw_of
from m2wr_sim.model.types import Axis, Box, Collision, Cylinder, Inertial, Joint, Link, Model, Sphere, Surface

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
STEPS = [1, 2, 5, 10]                       # ms
BODY_TO_AXLE = 0.05                         # the chassis frame stands that far ahead of the axle [m]
HEIGHT = 0.0999                             # wheel radius less the contact layer [m]


def tilt_of(orientation):
    """Return the angle [rad] between the chassis and the vertical."""
    return math.acos(max(-1.0, min(1.0, rotate(orientation, (0.0, 0.0, 1.0))[2])))


class Course:
    """One m2wr in an engine, with time counted in seconds."""

    def __init__(self, engine, robot, drive, pose, step_ms, name=None):
        self.engine, self._drive, self._step_ms = engine, drive, step_ms
        self.handle = engine.add_model(robot, pose, name)
        self.chassis = self.handle.links["link_chassis"]

    def drive(self, linear_x, angular_z):
        self._drive(self.engine, self.handle, linear_x, angular_z)
        return self

    def run(self, seconds):
        self.engine.step(int(round(seconds * 1000.0 / self._step_ms)))
        return self.state

    @property
    def state(self):
        return self.engine.link_state(self.chassis)

    def speeds(self, seconds):
        """Return mean yaw rate and axle speed over some seconds."""
        turned, travelled, state = 0.0, 0.0, self.state
        for _ in range(int(round(seconds / 0.1))):
            before, state = state, self.run(0.1)
            turned += math.remainder(yaw_of(state.orientation) - yaw_of(before.orientation), 2.0 * math.pi)
            travelled += math.dist(self.axle(before), self.axle(state))
        return turned / seconds, travelled / seconds

    @staticmethod
    def axle(state):
        yaw = yaw_of(state.orientation)
        return (state.position[0] - BODY_TO_AXLE * math.cos(yaw), state.position[1] - BODY_TO_AXLE * math.sin(yaw))


@pytest.fixture
def make_course(make_engine, m2wr, drive, build):
    def make(step_ms, models=(), pose=None, settle=1.0):
        engine = make_engine(step_ms, [build.ground()] + list(models))
        course = Course(engine, m2wr, drive, pose or build.at(z=0.1), step_ms)
        course.drive(0.0, 0.0).run(settle)
        return course
    return make


@pytest.mark.parametrize("height", [0.1, 0.5])
@pytest.mark.parametrize("step_ms", STEPS)
def test_a_parked_robot_does_not_creep(make_course, build, step_ms, height):
    course = make_course(step_ms, pose=build.at(z=height), settle=2.0)
    before = course.state
    after = course.run(20.0)
    assert math.dist(before.position, after.position) < 1e-5
    assert tilt_of(after.orientation) < 1e-4 and after.position[2] == pytest.approx(HEIGHT, abs=1e-4)
    assert abs(yaw_of(after.orientation) - yaw_of(before.orientation)) < 1e-5


@pytest.mark.parametrize("height", [0.1, 0.5])
@pytest.mark.parametrize("step_ms", STEPS)
def test_it_drives_straight(make_course, build, step_ms, height):
    course = make_course(step_ms, pose=build.at(z=height), settle=2.0)
    messages = course.engine.solver_messages
    before = course.drive(0.5, 0.0).run(1.0)
    after = course.run(10.0)
    heading = yaw_of(before.orientation)
    dx, dy = after.position[0] - before.position[0], after.position[1] - before.position[1]
    assert dx / 10.0 == pytest.approx(0.5, rel=1e-3)
    assert abs(dy * math.cos(heading) - dx * math.sin(heading)) < 1e-4              # of 5 m
    assert abs(yaw_of(after.orientation) - heading) < 1e-4
    assert after.position[2] == pytest.approx(HEIGHT, abs=1e-4)
    assert course.engine.solver_messages == messages


@pytest.mark.parametrize("angular_z", [1.0, -1.0])
@pytest.mark.parametrize("step_ms", STEPS)
def test_it_spins_on_the_spot(make_course, step_ms, angular_z):
    course = make_course(step_ms)
    messages = course.engine.solver_messages
    axle = course.axle(course.drive(0.0, angular_z).run(1.0))
    turn_rate, _ = course.speeds(6.0)
    assert turn_rate == pytest.approx(angular_z, rel=1e-3)
    assert math.dist(course.axle(course.state), axle) < 1e-4
    assert course.engine.solver_messages == messages


@pytest.mark.parametrize("linear_x, angular_z", [(0.5, 1.0), (-0.3, 0.6)])
@pytest.mark.parametrize("step_ms", STEPS)
def test_it_drives_circles(make_course, step_ms, linear_x, angular_z):
    course = make_course(step_ms)
    messages = course.engine.solver_messages
    course.drive(linear_x, angular_z).run(1.0)
    turn_rate, speed = course.speeds(6.0)
    chord = math.sin(0.05 * angular_z) / (0.05 * angular_z)     # pieces of 0.1 s are measured along their chords
    assert turn_rate == pytest.approx(angular_z, rel=1e-3)
    assert speed == pytest.approx(abs(linear_x) * chord, rel=1e-3)
    assert course.engine.solver_messages == messages


@pytest.mark.parametrize("step_ms", STEPS)
def test_a_joint_angle_is_the_way_over_the_radius(make_course, step_ms):
    course = make_course(step_ms)
    joint = course.handle.joints["joint_left_wheel"]
    course.drive(0.5, 0.0).run(1.0)
    way, angle = course.state.position[0], course.engine.joint_angle(joint)
    course.run(5.0)
    rolled = (course.engine.joint_angle(joint) - angle) * 0.1
    assert rolled == pytest.approx(course.state.position[0] - way, rel=1e-3)


def travel_bound(step_ms):
    """Return how deep [m] a contact may begin at 0.5 m/s: one step of travel, plus the layer it comes to rest in."""
    return 0.5 * step_ms * 1e-3 + 1.1e-4


@pytest.mark.parametrize("step_ms", STEPS)
def test_it_backs_into_a_wall_and_stands(make_course, build, step_ms):
    course = make_course(step_ms, [build.box("wall", -2.0, 0.0, 0.5, size=(0.2, 4.0, 1.0))])
    course.drive(-0.5, 0.0)
    deepest = 0.0
    for _ in range(int(5000 / step_ms)):
        course.engine.step(1)
        position, orientation, _, _ = course.state
        rear = min(position[0] + rotate(orientation, (-0.25, 0.0, z))[0] for z in (-0.035, 0.035))
        deepest = max(deepest, -1.9 - rear)
    assert 0.0 < deepest <= travel_bound(step_ms)
    before = course.state
    for _ in range(100):
        after = course.run(0.01)
        assert math.dist(before.position, after.position) < 1e-6
        before = after
    assert tilt_of(after.orientation) < 1e-3 and abs(yaw_of(after.orientation)) < 1e-3
    events = course.engine.drain_contact_events()
    assert {side.split("::")[0] for event in events for side in event[1:3]} == {"wall", "m2wr"}


@pytest.mark.parametrize("step_ms", STEPS)
def test_its_nose_does_not_sink_into_a_wall(make_course, build, step_ms):
    course = make_course(step_ms, [build.box("wall", 2.0, 0.0, 0.5, size=(0.2, 4.0, 1.0))])
    course.drive(0.5, 0.0)
    deepest = 0.0
    for _ in range(int(6000 / step_ms)):        # the round nose slides off to one side in the end
        course.engine.step(1)
        position, orientation, _, _ = course.state
        deepest = max(deepest, position[0] + rotate(orientation, (0.35, 0.0, -0.05))[0] + 0.05 - 1.9)
    assert 0.0 < deepest <= travel_bound(step_ms)


@pytest.mark.parametrize("step_ms", STEPS)
def test_a_robot_put_half_into_the_ground_rises_gently(make_engine, m2wr, drive, build, step_ms):
    engine = make_engine(step_ms, [build.ground()])
    course = Course(engine, m2wr, drive, build.at(z=0.0), step_ms)
    course.drive(0.0, 0.0)
    highest = fastest = steepest = 0.0
    for _ in range(int(4000 / step_ms)):
        engine.step(1)
        state = course.state
        highest = max(highest, state.position[2])
        fastest = max(fastest, math.sqrt(sum(value * value for value in state.linear_velocity)))
        steepest = max(steepest, tilt_of(state.orientation))
    assert highest < 0.15 and fastest < 0.5 and steepest < math.radians(10.0)
    assert course.state.position[2] == pytest.approx(HEIGHT, abs=1e-4) and tilt_of(course.state.orientation) < 1e-3


def obstacles(build, count, seed, inner, outer):
    """Return boxes and cylinders scattered over a ring, the same ones for the same seed."""
    chance, models = random.Random(seed), []
    for index in range(count):
        angle, distance = chance.uniform(0.0, 2.0 * math.pi), chance.uniform(inner, outer)
        x, y = distance * math.cos(angle), distance * math.sin(angle)
        if index % 2:
            models.append(build.cylinder("pillar%d" % index, x, y, 0.5, radius=chance.uniform(0.1, 0.3)))
        else:
            models.append(build.box("box%d" % index, x, y, 0.5, size=(chance.uniform(0.2, 0.8), 0.4, 1.0)))
    return models


def balanced_robot():
    """Return a robot on two wheels between two casters, its mass low: nothing but the ground can make it tilt."""
    chassis = Link("link_chassis", inertial=Inertial(5.0, inertia=(0.0396, 0, 0, 0.106, 0, 0.142)), collisions=(
        Collision("chassis", Box((0.5, 0.3, 0.07))),
        Collision("front", Sphere(0.05), ((0.2, 0.0, -0.05), UPRIGHT), Surface(mu=0.0, mu2=0.0)),
        Collision("rear", Sphere(0.05), ((-0.2, 0.0, -0.05), UPRIGHT), Surface(mu=0.0, mu2=0.0))))
    links, joints = [chassis], []
    for side, y in (("right", 0.15), ("left", -0.15)):      # named as m2wr's are
        links.append(Link("link_" + side, ((0.0, y, 0.0), UPRIGHT),
                          Inertial(0.2, inertia=(5.3e-4, 0, 0, 1e-3, 0, 5.3e-4)),
                          (Collision("wheel", Cylinder(0.1, 0.04),
                                     ((0.0, 0.0, 0.0), quaternion_from_rpy(math.pi / 2, 0, 0))),)))
        joints.append(Joint("joint_%s_wheel" % side, "revolute", "link_chassis", "link_" + side,
                            axis=Axis(xyz=(0.0, 1.0, 0.0))))
    return Model("balanced", tuple(links), tuple(joints))


def with_friction(model, links, mu):
    """Return a model with another coefficient of friction for all collisions of some links."""
    changed = tuple(replace(link, collisions=tuple(
        replace(shape, surface=replace(shape.surface, mu=mu, mu2=mu)) for shape in link.collisions))
        if link.name in links else link for link in model.links)
    return replace(model, links=changed)


def roam(engine, courses, seconds, check):
    """Drive robots at random, a new command twice a second, calling ``check`` for each ten times a second."""
    chance = random.Random(11)
    for _ in range(int(2 * seconds)):
        for course in courses:
            course.drive(chance.uniform(-1.0, 1.0), chance.uniform(-2.0, 2.0))
        for _ in range(5):
            courses[0].run(0.1)
            for course in courses:
                check(course.state)
    names = {side.split("::")[0] for contact in engine.drain_contact_events() for side in contact[1:3]}
    assert {"r%d" % k for k in range(len(courses))} < names and len(names) > len(courses) + 1   # no empty drive


def make_arena(make_engine, build, step_ms, robot, drive):
    """Return an engine with walls 4 m off, pillars, and six robots in the middle."""
    side = 4.0
    walls = [build.box("wall%d" % k, x, y, 0.5, size=size) for k, (x, y, size) in enumerate((
        (side, 0.0, (0.2, 8.2, 1.0)), (-side, 0.0, (0.2, 8.2, 1.0)), (0.0, side, (8.2, 0.2, 1.0)),
        (0.0, -side, (8.2, 0.2, 1.0))))]
    engine = make_engine(step_ms, [build.ground()] + walls + obstacles(build, 24, 5, 1.7, 3.6))
    return engine, [Course(engine, robot, drive, build.at(0.8 * (k % 3) - 0.8, 0.9 * (k // 3) - 0.45, 0.1), step_ms,
                           "r%d" % k) for k in range(6)]


@pytest.mark.parametrize("step_ms", [2, 5])
def test_random_driving_never_tilts_a_balanced_robot(make_engine, build, drive, step_ms):
    """Its wheels slip: at a wall they are pressed with mu W at most, so friction lifts with mu^2 W, W / 25 here."""
    robot = with_friction(balanced_robot(), ["link_left", "link_right"], 0.2)
    engine, courses = make_arena(make_engine, build, step_ms, robot, drive)

    def check(state):
        assert tilt_of(state.orientation) < math.radians(3.0) and 0.09 < state.position[2] < 0.11
        assert max(abs(state.position[0]), abs(state.position[1])) < 4.0
    roam(engine, courses, 15, check)


WHEELS = ["link_left_wheel", "link_right_wheel"]


def test_random_driving_among_obstacles_never_overturns_m2wr(make_engine, build, m2wr, drive):
    """Its centre of mass is above what it is hit at, and its nose may stick to what it is pressed against: it tilts.
    """
    engine, courses = make_arena(make_engine, build, 5, with_friction(m2wr, WHEELS, 0.2), drive)

    def check(state):
        assert tilt_of(state.orientation) < math.radians(10.0) and 0.09 < state.position[2] < 0.12
        assert max(abs(state.position[0]), abs(state.position[1])) < 4.0
    roam(engine, courses, 15, check)
    for course in courses:
        course.drive(0.0, 0.0)
    courses[0].run(2.0)
    assert max(tilt_of(course.state.orientation) for course in courses) < math.radians(1.0)


def test_robots_whose_wheels_grip_are_never_flung(make_engine, build, m2wr, drive):
    """With a friction of 1 a wheel climbs what it is pressed against, and m2wr, top-heavy, may fall over then.

    It is not faster than wheels at 1 m/s and turning with 2 rad/s make it, and falling by twice a wheel's radius.
    """
    fastest = 1.0 + 2.0 * 0.15 + math.sqrt(2.0 * 9.81 * 0.2)
    engine, courses = make_arena(make_engine, build, 5, m2wr, drive)

    def check(state):
        assert 0.05 < state.position[2] < 0.4                           # one robot upon the other at most
        assert math.sqrt(sum(value * value for value in state.linear_velocity)) < fastest
        assert max(abs(state.position[0]), abs(state.position[1])) < 4.0
    roam(engine, courses, 15, check)


@pytest.mark.parametrize("step_ms", STEPS)
def test_gentle_driving_never_lifts_the_nose(make_course, step_ms):
    course, speed, chance = make_course(step_ms), 0.0, random.Random(2)
    for _ in range(20):
        target, turn = chance.uniform(-1.0, 1.0), chance.uniform(-1.0, 1.0)
        for _ in range(10):
            speed += max(-0.1, min(0.1, target - speed))        # 2 m/s^2; the nose lifts from 3.7 on
            state = course.drive(speed, turn).run(0.05)
            assert tilt_of(state.orientation) < 2e-3 and state.position[2] == pytest.approx(HEIGHT, abs=5e-4)


def test_many_obstacles_out_of_reach_change_nothing(make_course, build):
    results = []
    for count in (0, 300):
        course = make_course(2, obstacles(build, count, 3, 5.0, 20.0))
        course.drive(0.5, 0.7).run(4.0)
        results.append(course.state)
    assert results[0] == results[1]


def test_it_pushes_a_free_box(make_course, build):
    course = make_course(2, [build.box("crate", 1.0, 0.0, 0.15, size=(0.3, 0.3, 0.3), static=False, mass=1.0)])
    crate = course.engine.handles[1].links["link"]
    course.drive(0.4, 0.0).run(5.0)
    position, orientation, _, _ = course.engine.link_state(crate)
    assert position[0] > 1.4 and abs(position[1]) < 0.3 and position[2] == pytest.approx(0.15, abs=0.02)
    assert course.state.position[0] > 1.0 and tilt_of(course.state.orientation) < math.radians(3.0)
    contacts = course.engine.drain_contact_events()
    assert {side.split("::")[0] for contact in contacts for side in contact[1:3]} == {"crate", "m2wr"}


def back_to_back(make_engine, build, robot, drive, step_ms):
    """Return an engine and two robots that have pushed each other with their backs for a second."""
    engine = make_engine(step_ms, [build.ground()])
    courses = [Course(engine, robot, drive, build.at(x, 0.0, 0.1, yaw), step_ms, name)
               for x, yaw, name in ((-1.0, math.pi, "one"), (1.0, 0.0, "two"))]
    for course in courses:
        course.drive(-0.5, 0.0)
    engine.step(2500 // step_ms)
    return engine, courses


def check_contact(engine, courses):
    one, two = (course.state for course in courses)
    assert math.dist(one.position, two.position) == pytest.approx(0.5, abs=3e-3)    # backs: 0.25 m behind the frame
    assert max(tilt_of(one.orientation), tilt_of(two.orientation)) < math.radians(1.0)
    assert abs(one.linear_velocity[0] - two.linear_velocity[0]) < 1e-3
    assert {frozenset((contact.first.split("::")[0], contact.second.split("::")[0]))
            for contact in engine.drain_contact_events()} == {frozenset(("one", "two"))}


@pytest.mark.parametrize("step_ms", [1, 5])
def test_two_robots_meet_back_to_back_and_hold_each_other(make_engine, m2wr, drive, build, step_ms):
    """Their backs are smooth: then the load of every wheel, and with it its push, follows from statics."""
    engine, courses = back_to_back(make_engine, build, with_friction(m2wr, ["link_chassis"], 0.0), drive, step_ms)
    for course in courses:
        before = course.state
        assert math.dist(course.run(1.0).position, before.position) < 1e-2
    check_contact(engine, courses)


@pytest.mark.parametrize("step_ms", [1, 5])
def test_robots_whose_backs_stick_stay_together(make_engine, m2wr, drive, build, step_ms):
    """Friction between the backs may shift load from one robot to the other, and statics does not tell how much.

    Wheels that slip push with mu times their load at whatever speed, so nothing brings the pair to a halt; it can only
    not be faster than the wheels turn.
    """
    engine, courses = back_to_back(make_engine, build, m2wr, drive, step_ms)
    for course in courses:
        before = course.state
        assert math.dist(course.run(1.0).position, before.position) < 0.5
    check_contact(engine, courses)


@pytest.mark.parametrize("step_ms", [1, 5])
def test_runs_repeat_bit_for_bit_whatever_the_batch(make_course, build, step_ms):
    results = []
    for batch in (1, 7, 50):
        course = make_course(step_ms, [build.box("crate", 0.8, 0.1, 0.15, size=(0.3, 0.3, 0.3), static=False),
                                       build.box("wall", 2.0, 0.0, 0.5, size=(0.2, 4.0, 1.0))])
        course.drive(0.5, 0.2)
        for left in range(2000, 0, -batch):
            course.engine.step(min(batch, left))
        results.append((course.state, course.engine.link_state(course.engine.handles[1].links["link"]),
                        course.engine.joint_angle(course.handle.joints["joint_left_wheel"]),
                        course.engine.drain_contact_events()))
    assert results[0] == results[1] == results[2] and results[0][3]


def test_the_iterative_solver_repeats_from_its_seed(make_engine, m2wr, drive, build):
    results = []
    for _ in range(2):
        engine = make_engine(2, [build.ground(), build.box("crate", 0.8, 0.1, 0.15, size=(0.3,) * 3, static=False)],
                             solver="quick")
        engine.reseed(7)
        course = Course(engine, m2wr, drive, build.at(z=0.1), 2)
        results.append(course.drive(0.5, 0.2).run(3.0))
    assert results[0] == results[1] and results[0].position[0] > 0.5


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("way", [0, 1])
def test_friction_has_the_direction_that_turns_with_the_shape(make_engine, build, turned, way):
    surface = Surface(mu=0.8, mu2=0.2, fdir1=(1.0, 0.0, 0.0))
    brick = build.box("brick", 0.0, 0.0, 0.05, (0.4, 0.4, 0.1), static=False, mass=2.0, surface=surface)
    brick = replace(brick, pose=build.at(0.0, 0.0, 0.05, math.pi / 2 if turned else 0.0), allow_auto_disable=False)
    engine = make_engine(models=(build.ground(), brick))
    engine.step(500)
    link = engine.handles[1].links["link"]
    start = engine.link_pose(link)[0]
    engine.set_link_velocity(link, tuple(2.0 if axis == way else 0.0 for axis in range(3)), (0.0, 0.0, 0.0))
    engine.step(3000)
    end = engine.link_pose(link)[0]
    mu = 0.8 if (way == 0) is not turned else 0.2
    assert end[way] - start[way] == pytest.approx(4.0 / (2.0 * mu * 9.8), rel=0.02)
    assert abs(end[1 - way] - start[1 - way]) < 0.01


@pytest.mark.parametrize("kind, xyz", [("revolute", (0.0, 0.0, 1.0)), ("prismatic", (1.0, 0.0, 0.0))])
def test_a_damped_spring_settles_at_its_reference(make_engine, kind, xyz):
    inertial = Inertial(0.5, inertia=(0.5, 0.0, 0.0, 0.5, 0.0, 0.5))
    axis = Axis(xyz=xyz, spring_stiffness=8.0, spring_reference=0.3)
    models = [Model(name, (Link("link", inertial=inertial, gravity=False),), (
        Joint("j", kind, "world", "link", axis=replace(axis, damping=damping)),))
        for name, damping in (("free", 0.0), ("slowed", 2.0))]
    engine = make_engine(models=models)
    free, slowed = (handle.joints["j"] for handle in engine.handles)
    seen = []
    for _ in range(1571):                       # one period: 2 pi sqrt(0.5 / 8) s
        engine.step(1)
        seen.append(engine.joint_angle(free))
    assert max(seen) == pytest.approx(0.6, abs=2e-3) and abs(seen[-1]) < 2e-3
    assert seen[785] == pytest.approx(0.6, abs=2e-3)
    engine.step(8000)
    assert engine.joint_angle(slowed) == pytest.approx(0.3, abs=1e-3)
