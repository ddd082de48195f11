# SPDX-License-Identifier: BSD-3-Clause
"""Meshes and heightmaps as ground, obstacles and bodies: rest, drive, slide, come and go."""
import gc
import math
import os
import random
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import quaternion_from_rpy, rotate, rotate_inverse, yaw_of
from m2wr_sim.model.sdf.loader import load_sdf_models
from m2wr_sim.model.types import Box, Heightmap, Mesh, RayScan, Sphere, Surface
from m2wr_sim.physics import factory, native_shapes
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.ray_scene import RayScene
from test_mesh_kernels import block

DATA = Path(__file__).resolve().parents[1] / "data"
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
LAYER = 1e-4            # m, by which resting contacts overlap
GRAVITY = 9.8
BLOCK = (0.3, 0.2, 0.1)


def wave(x, y):
    return 0.03 * np.sin(3.4 * x) * np.cos(2.0 * y)


WAVE_SLOPE = math.degrees(math.atan(0.03 * 3.4))


def slope(x, y):
    return 0.5 * x + 0.0 * y


def flat(x, y):
    return 0.0 * x + 0.0 * y


def mesh_of(height, size=8.0, cells=40):
    """Return a square sheet of triangles over the origin."""
    ticks = np.linspace(-0.5 * size, 0.5 * size, cells + 1)
    x, y = np.meshgrid(ticks, ticks)
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    triangles = np.concatenate((np.stack((a, b, d), 1), np.stack((a, d, c), 1))).astype(np.int32)
    return Mesh(np.stack((x, y, height(x, y)), -1).reshape(-1, 3), triangles, "%s mesh" % height.__name__)


def heights_of(height, size=8.0, cells=40):
    ticks = np.linspace(-0.5 * size, 0.5 * size, cells + 1)
    x, y = np.meshgrid(ticks, ticks[::-1])
    return Heightmap(height(x, y), (size, size), (0.0, 0.0, 0.0), "%s heights" % height.__name__)


GROUNDS = {"mesh": mesh_of, "heights": heights_of}


@pytest.fixture(params=sorted(GROUNDS))
def ground_of(request, build):
    """Return a function that makes a static model of a height function, once as a mesh and once as a heightmap."""
    def make(height, mu=100.0, **values):
        return build.one_link("floor", GROUNDS[request.param](height, **values), build.at(),
                              surface=Surface(mu=mu, mu2=mu))
    return make


def body(build, kind, pose):
    """Return a movable block, ball, or block made of triangles."""
    shape = {"block": Box(BLOCK), "ball": Sphere(0.1), "triangles": block(BLOCK)}[kind]
    return build.one_link(kind, shape, pose, static=False)


def state(engine, number, link="link"):
    return engine.link_state(engine.handles[number].links[link])


# -- rest ---------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("kind, height", [("block", 0.05), ("ball", 0.1), ("triangles", 0.05)])
@pytest.mark.parametrize("step_ms", [1, 5])
def test_a_body_comes_to_rest_on_triangles(make_engine, build, ground_of, kind, height, step_ms):
    engine = make_engine(step_ms, [ground_of(flat), body(build, kind, build.at(0.13, 0.21, height + 0.1, 0.3))])
    engine.step(3000 // step_ms)
    before = state(engine, 1)
    engine.step(2000 // step_ms)
    after = state(engine, 1)
    assert after.position[2] == pytest.approx(height - LAYER, abs=1e-4)
    assert math.dist(before.position, after.position) < 1e-5 and engine.drain_contact_events() == []


@pytest.mark.parametrize("kind", ["block", "ball", "triangles"])
def test_a_mesh_rests_on_a_plane_and_carries_a_load(make_engine, build, kind):
    models = [build.ground(), build.box("table", 0.0, 0.0, 0.25, static=True),
              body(build, "triangles", build.at(z=0.6)), body(build, kind, build.at(0.0, 3.0, 0.5))]
    engine = make_engine(1, models[:3] + ([models[3]] if kind != "triangles" else []))
    engine.step(2000)
    assert state(engine, 2).position[2] == pytest.approx(0.55, abs=1e-3)
    if kind != "triangles":
        engine.set_link_pose(engine.handles[3].links["link"], build.at(0.0, 0.0, 0.75))
        engine.step(2000)
        top = {"block": 0.65, "ball": 0.7}[kind]
        assert state(engine, 3).position[2] == pytest.approx(top, abs=2e-3)


def test_a_ball_rests_at_the_height_the_laser_sees(make_engine, build, ground_of):
    """A bowl off the middle: a mirrored or turned field would leave the ball elsewhere."""
    def bowl(x, y):
        return 0.2 * ((x - 1.3) ** 2 + (y + 0.8) ** 2)

    model = ground_of(bowl, mu=1.0)
    engine = make_engine(1, [model, body(build, "ball", build.at(1.5, -0.6, 0.2))])
    engine.set_link_velocity(engine.handles[1].links["link"], (0.0,) * 3, (0.0,) * 3)
    for _ in range(100):
        engine.step(200)
        engine.set_link_velocity(engine.handles[1].links["link"], tuple(
            0.7 * value for value in state(engine, 1).linear_velocity), (0.0,) * 3)
    x, y, z = state(engine, 1).position
    assert math.hypot(x - 1.3, y + 0.8) < 0.11          # a facet is 0.2 m wide
    scene = RayScene()
    scene.add(model.links[0].collisions[0].geometry, build.at(), "floor")
    down = ((x, y, z), quaternion_from_rpy(0.0, 0.5 * math.pi, 0.0))
    sensor = LaserSensor(RayScan(samples=1, range_min=0.0, range_max=5.0), np.random.default_rng(0))
    assert sensor.cast(scene, down)[0][0] == pytest.approx(0.1, abs=3e-3)


# -- both engines -------------------------------------------------------------------------------------------------

def tumble(kind, build, models, steps, motors=None):
    engine = factory.make_engine(kind, EngineSettings())
    try:
        handles = [engine.add_model(model, model.pose) for model in models]
        if motors is not None:
            motors(engine, handles[-1])
        engine.step(steps)
        states = [engine.link_state(link) for handle in handles for link in handle.links.values()]
        return states, engine.drain_contact_events()
    finally:
        engine.close()


@pytest.mark.parametrize("kind", ["block", "ball", "triangles"])
def test_engines_give_the_same_bits(build, ground_of, kind):
    tilted = ((0.13, 0.21, 0.5), quaternion_from_rpy(0.4, -0.3, 0.2))
    models = [ground_of(wave), build.one_link("wall", block((0.2, 3.0, 1.0)), build.at(-0.6, 0.0, 0.4)),
              body(build, kind, tilted), build.one_link("other", block((0.2, 0.2, 0.2)), build.at(0.2, 0.2, 0.9),
                                                        static=False)]
    results = [tumble(name, build, models, 1500) for name in ("pyode", "auto")]
    assert results[0] == results[1]


def test_engines_agree_on_floor_and_wall_in_one_mesh(build, m2wr, drive):
    """Wheels have contacts with the floor and the wall of one mesh: two contacts, not one in between."""
    walls = [block((30.0, 30.0, 0.1), (0.0, 0.0, -0.05)), block((0.2, 6.0, 1.0), (1.5, 0.0, 0.5))]
    room = Mesh(np.concatenate([wall.vertices for wall in walls]),
                np.concatenate([wall.triangles + 8 * index for index, wall in enumerate(walls)]), "room")
    models = [build.one_link("room", room, build.at()), m2wr]
    models[1] = m2wr.__class__(**dict(vars(m2wr), pose=build.at(0.3, 0.2, 0.1, 0.4)))
    results = [tumble(name, build, models, 4000, lambda engine, handle: drive(engine, handle, 0.5, 0.1))
               for name in ("pyode", "auto")]
    assert results[0] == results[1]
    states, contacts = results[0]
    tilt = math.degrees(math.acos(min(1.0, rotate(states[1].orientation, (0.0, 0.0, 1.0))[2])))
    assert contacts and tilt < 5.0 and states[1].position[2] < 0.15 and states[1].position[0] < 1.5


def test_engines_agree_on_the_friction_direction_of_a_mesh(build):
    """The direction of mu rotates with the mesh."""
    skewed = Surface(mu=1.0, mu2=0.1, fdir1=(1.0, 1.0, 0.0))
    crate = build.one_link("crate", block(BLOCK), build.at(z=0.06, yaw=0.4), static=False, surface=skewed)

    def push(engine, handle):
        engine.set_link_velocity(handle.links["link"], (1.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    results = [tumble(name, build, [build.ground(), crate], 500, push) for name in ("pyode", "auto")]
    assert results[0] == results[1]
    assert abs(results[0][0][-1].position[1]) > 0.01                    # it does not slide straight


def test_a_world_put_back_repeats_itself(make_engine, build, ground_of):
    models = [ground_of(wave), body(build, "triangles", build.at(0.1, 0.2, 0.4)),
              body(build, "block", build.at(0.15, 0.2, 0.7))]
    engine = make_engine(1, models)
    results = []
    for _ in range(2):
        engine.step(800)
        results.append([state(engine, 1), state(engine, 2)])
        engine.forget()
        for number in (1, 2):
            link = engine.handles[number].links["link"]
            engine.set_link_pose(link, models[number].pose)
            engine.set_link_velocity(link, (0.0,) * 3, (0.0,) * 3)
    assert results[0] == results[1]


# -- driving ------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("linear_x, angular_z", [(0.5, 0.0), (0.0, 1.0), (0.5, 1.0)])
@pytest.mark.parametrize("step_ms", [1, 5])
def test_a_robot_drives_on_triangles_as_on_a_plane(make_engine, build, m2wr, drive, ground_of, step_ms, linear_x,
                                                   angular_z):
    engine = make_engine(step_ms, [ground_of(flat, size=20.0, cells=20)])
    handle = engine.add_model(m2wr, build.at(0.013, 0.037, 0.1))
    chassis = handle.links["link_chassis"]
    drive(engine, handle, linear_x, angular_z)
    engine.step(2000 // step_ms)
    turned = travelled = 0.0
    before = engine.link_state(chassis)
    for _ in range(30):
        engine.step(100 // step_ms)
        after = engine.link_state(chassis)
        turned += math.remainder(yaw_of(after.orientation) - yaw_of(before.orientation), 2.0 * math.pi)
        travelled += math.dist(axle(before), axle(after))
        before = after
    assert turned / 3.0 == pytest.approx(angular_z, abs=0.01) and travelled / 3.0 == pytest.approx(linear_x, abs=0.005)
    assert before.position[2] == pytest.approx(0.0999, abs=2e-4)


def axle(robot):
    yaw = yaw_of(robot.orientation)
    return robot.position[0] - 0.05 * math.cos(yaw), robot.position[1] - 0.05 * math.sin(yaw)


@pytest.mark.parametrize("step_ms", [1, 5])
def test_random_driving_on_waves_tilts_no_more_than_the_ground(make_engine, build, ground_of, step_ms):
    robot, = load_sdf_models((DATA / "two_wheels.sdf").read_text())
    worst = 0.0
    for seed in range(3):
        draw, engine = random.Random(seed), make_engine(step_ms, [ground_of(wave, size=40.0, cells=200)])
        messages = engine.solver_messages
        handle = engine.add_model(robot, build.at(z=0.15))
        engine.step(1000 // step_ms)
        for _ in range(8):
            linear_x, turn = draw.uniform(-1.0, 1.0), 0.15 * draw.uniform(-2.0, 2.0)
            engine.set_joint_motor(handle.joints["left"], (linear_x - turn) / 0.1, 5.0)
            engine.set_joint_motor(handle.joints["right"], (linear_x + turn) / 0.1, 5.0)
            for _ in range(10):
                engine.step(100 // step_ms)
                found = engine.link_state(handle.links["chassis"])
                x, y, z = found.position
                worst = max(worst, math.degrees(math.acos(min(1.0, rotate(found.orientation, (0.0, 0.0, 1.0))[2]))))
                assert abs(z - wave(x, y) - 0.1) < 0.05 and max(abs(x), abs(y)) < 19.0
        assert engine.solver_messages == messages
    assert worst < WAVE_SLOPE + 0.5


# -- energy -------------------------------------------------------------------------------------------------------

def energy(found, inertia):
    turn = rotate_inverse(found.orientation, found.angular_velocity)
    return (GRAVITY * found.position[2] + 0.5 * sum(value * value for value in found.linear_velocity)
            + 0.5 * sum(moment * value * value for moment, value in zip(inertia, turn)))


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["block", "triangles", "ball"])
@pytest.mark.parametrize("height", [wave, slope])
@pytest.mark.parametrize("step_ms", [1, 5])
def test_energy_never_grows(make_engine, build, ground_of, height, kind, mu, step_ms):
    """Up to what it takes to push a body out again that was one step's way deep in the ground when it was noticed."""
    model = body(build, kind, ((0.53, 0.21, 0.8), quaternion_from_rpy(0.3, 0.4, 0.0)))
    xx, _, _, yy, _, zz = model.links[0].inertial.inertia
    engine = make_engine(step_ms, [ground_of(height, mu=mu), model])
    least, fastest = math.inf, 0.0
    for _ in range(1500 // step_ms):
        engine.step(1)
        found = state(engine, 1)
        fastest = max(fastest, math.hypot(*found.linear_velocity))
        now = energy(found, (xx, yy, zz))
        least = min(least, now)
        assert now - least < 1.5 * GRAVITY * fastest * 1e-3 * step_ms


# -- coming and going ---------------------------------------------------------------------------------------------

def test_equal_shapes_share_their_data_until_the_last_is_gone(make_engine, build):
    shape, engine = block((1.0, 1.0, 1.0)), make_engine(1)
    models = [build.one_link("m%d" % index, block((1.0, 1.0, 1.0)), build.at(3.0 * index, 0.0, 0.5))
              for index in range(3)]
    handles = [engine.add_model(model, model.pose) for model in models]
    ball = engine.add_model(body(build, "ball", build.at(3.0, 0.0, 1.2)), build.at(3.0, 0.0, 1.2))
    data = weakref.ref(native_shapes._data[shape])
    assert sum(key == shape for key in native_shapes._data) == 1
    engine.remove_model(handles[0])
    engine.step(500)
    assert data() is not None
    assert engine.link_state(ball.links["link"]).position[2] == pytest.approx(1.1, abs=1e-3)
    engine.remove_model(handles[1])
    engine.remove_model(handles[2])
    gc.collect()
    assert data() is None and shape not in native_shapes._data
    engine.step(500)
    assert engine.link_state(ball.links["link"]).position[2] < 0.5       # it falls


def test_a_static_mesh_can_be_moved(make_engine, build, ground_of):
    engine = make_engine(1, [ground_of(flat), body(build, "block", build.at(z=0.3))])
    engine.set_link_pose(engine.handles[0].links["link"], build.at(z=0.2))
    engine.step(1500)
    assert state(engine, 1).position[2] == pytest.approx(0.25, abs=1e-3)


def test_a_heightmap_on_a_moving_model_stays_in_the_world(make_engine, build):
    carrier = build.one_link("carrier", heights_of(flat), build.at(z=1.0), static=False)
    engine = make_engine(1, [build.ground(), carrier, body(build, "block", build.at(z=1.2))])
    engine.step(1500)
    assert state(engine, 2).position[2] == pytest.approx(1.05, abs=1e-3)
    assert [moves for _, _, moves in engine.collisions(engine.handles[1])] == [False]


def test_it_steps_in_another_thread(make_engine, build, ground_of):
    results = []
    for threaded in (False, True):
        engine = make_engine(1, [ground_of(wave), body(build, "triangles", build.at(0.1, 0.2, 0.4))])
        if threaded:
            thread = threading.Thread(target=engine.step, args=(500,))
            thread.start()
            thread.join(60.0)
            assert not thread.is_alive(), "500 steps took more than a minute"
        else:
            engine.step(500)
        results.append(state(engine, 1))
    assert results[0] == results[1]


@pytest.mark.parametrize("shape, said", [
    (Mesh(np.zeros((3, 2)), np.array([[0, 1, 2]])), "expected"),
    (Mesh(np.zeros((3, 3)), np.array([[0, 1, 3]])), "expected"),
    (Mesh(np.full((3, 3), math.nan), np.array([[0, 1, 2]])), "finite"),
    (Mesh(np.zeros((3, 3)), np.zeros((0, 3), int)), "expected"),
    (Heightmap(np.zeros((1, 5))), "at least 2 x 2"), (Heightmap(np.full((2, 2), math.inf)), "finite"),
    (Mesh(1e-320 * np.eye(3), np.array([[0, 1, 2]])), "at least 1e-07 m"),
    (Mesh(1e300 * np.eye(3), np.array([[0, 1, 2]])), "at most 1e.06 m"),
    (Heightmap(np.zeros((2, 2)), (0.0, 1.0)), "over 1e-07 to"), (Heightmap(np.full((2, 2), 1e300)), "at most 1e.06 m"),
    (Heightmap(np.zeros((2, 2)), (1e-320, 1.0)), "over 1e-07 to")])
def test_arrays_that_are_no_shape_are_refused(make_engine, build, shape, said):
    with pytest.raises(ModelError, match=said) as caught:
        make_engine(1, [build.one_link("m", shape, build.at())])
    assert "m::link::collision" in str(caught.value)


def test_the_laser_of_a_simulation_sees_moved_meshes(make_rig, build):
    hill = heights_of(slope)
    models = [build.one_link("wall", block((0.2, 4.0, 2.0)), build.at(3.0, 0.0, 0.5)),
              build.one_link("crate", block((0.4, 0.4, 0.4)), build.at(0.0, 2.0, 0.2), static=False),
              build.one_link("hill", hill, build.at(30.0), static=False)]
    rig = make_rig(*models)
    simulator, sensor = rig.simulator, LaserSensor(
        RayScan(samples=3, min_angle=0.0, max_angle=math.pi, range_min=0.05, range_max=9.0), np.random.default_rng(0))

    def look(x=0.0):
        simulator.refresh_scene()
        return [float(value) for value in sensor.cast(simulator.scene, build.at(x, 0.0, 0.3))[0]]

    assert look() == pytest.approx([2.9, 1.8, math.inf], abs=1e-6)
    simulator.set_model_state("wall", build.at(5.0, 0.0, 0.5), (0.0,) * 3, (0.0,) * 3)
    simulator.set_model_state("crate", build.at(0.0, 3.0, 0.2), (0.0,) * 3, (0.0,) * 3)
    rig.run(0.1)
    assert look() == pytest.approx([4.9, 2.8, math.inf], abs=1e-3)
    simulator.set_model_state("hill", build.at(0.0, 0.0, 9.0), (0.0,) * 3, (0.0,) * 3)
    assert look(30.0)[0] == pytest.approx(0.6, abs=1e-6)        # the ground stays though its model goes
    simulator.delete("wall")
    simulator.delete("crate")
    assert look() == [math.inf] * 3


@pytest.mark.parametrize("kind", ["native", "pyode"])
@pytest.mark.parametrize("closes", [True, False])
def test_the_process_ends_well(kind, closes):
    if kind == "native":
        pytest.importorskip("numba")
    code = ("import sys; sys.path[:0] = %r\n"
            "from conftest import at, one_link\nfrom test_native_shapes import mesh_of, heights_of, wave, block\n"
            "from m2wr_sim.physics.factory import make_engine\nfrom m2wr_sim.physics.engine import EngineSettings\n"
            "engine = make_engine(%r, EngineSettings())\n"
            "for model in (one_link('m', mesh_of(wave), at()), one_link('h', heights_of(wave), at(z=-0.2)),\n"
            "              one_link('b', block((0.2, 0.2, 0.2)), at(z=0.5), static=False)):\n"
            "    engine.add_model(model, model.pose)\n"
            "engine.step(700)\n"
            "if %r: engine.close()\n" % ([os.path.dirname(__file__)] + sys.path, kind, closes))
    assert subprocess.run([sys.executable, "-c", code], timeout=120.0).returncode == 0
