# SPDX-License-Identifier: BSD-3-Clause
"""Contacts with heightmaps: compared with sampled ground, and a wheel over steps and down ramps with closed forms."""
import math

import numpy as np
import pytest

from m2wr_sim.geometry import quaternion_from_rpy, rotate
from m2wr_sim.model.types import (
    Axis,
    Box,
    Collision,
    Cylinder,
    Heightmap,
    Inertial,
    Joint,
    Link,
    Mesh,
    Model,
    Sphere,
    Surface,
)
from m2wr_sim.physics import height_kernels as kernels
from m2wr_sim.physics import height_round_kernels as rounds
from m2wr_sim.physics import height_window_kernels as windows
from m2wr_sim.physics.height_field_kernels import FEW_CELLS, cells_below, greatest_in, ground_below, tops_of

RADIUS, WIDTH, STEP_HEIGHT, GRAVITY = 0.1, 0.04, 0.02, 9.8
MASS, SPIN = 5.4, 0.002         # of an axle with two wheels [kg], and about its axis of the wheels [kg m^2]
SHARE = SPIN / (MASS * RADIUS ** 2)
FIELD = np.array((0.0, 0.0, 0.0, math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)))     # libode's heightmap, upright
ROUGH = Surface(mu=100.0, mu2=100.0)
ACROSS = quaternion_from_rpy(-0.5 * math.pi, 0.0, 0.0)


def axle():
    """Return two free wheels on one axle, 0.4 m apart."""
    links = [Link("body", inertial=Inertial(5.0, inertia=(0.05, 0, 0, 5.0, 0, 0.05)))]
    joints = []
    for name, y in (("left", 0.2), ("right", -0.2)):
        links.append(Link(
            name, pose=((0.0, y, 0.0), (0.0, 0.0, 0.0, 1.0)),
            inertial=Inertial(0.2, ((0.0,) * 3, ACROSS), (5e-4, 0, 0, 5e-4, 0, 0.5 * SPIN)),
            collisions=(Collision("c", Cylinder(RADIUS, WIDTH), ((0.0,) * 3, ACROSS), surface=ROUGH),)))
        joints.append(Joint("to_" + name, "revolute", "body", name, axis=Axis((0.0, 1.0, 0.0))))
    return Model("axle", tuple(links), tuple(joints))


def field_of(height, size=(6.0, 2.0), cell=0.01):
    across, up = (np.linspace(-0.5 * side, 0.5 * side, int(round(side / cell)) + 1) for side in size)
    x, y = np.meshgrid(across, up[::-1])
    return Heightmap(height(x, y), size)


def kerb(build, kind):
    """Return a step of two centimetres at x = 0.5, up along x."""
    if kind == "box":
        return [build.ground(), build.box("kerb", 1.5, 0.0, 0.5 * STEP_HEIGHT, size=(2.0, 2.0, STEP_HEIGHT),
                                          surface=ROUGH)]
    if kind == "heights":
        ground = field_of(lambda x, y: np.where(x > 0.495, STEP_HEIGHT, 0.0))
    else:
        profile = ((-3.0, 0.0), (0.5, 0.0), (0.5, STEP_HEIGHT), (3.0, STEP_HEIGHT))
        ground = Mesh(np.array([(x, y, z) for x, z in profile for y in (-1.0, 1.0)]),
                      np.array([part for k in (0, 2, 4) for part in ((k, k + 2, k + 3), (k, k + 3, k + 1))]))
    return [build.one_link("kerb", ground, build.at(), surface=ROUGH)]


def roll(engine, build, speed, start=0.0):
    """Let the axle roll along x; return a function for its energy, that of rest on the ground being 0 [J]."""
    handle = engine.add_model(axle(), build.at(start, 0.0, RADIUS - 1e-4))
    for name, link in handle.links.items():
        engine.set_link_velocity(link, (speed, 0.0, 0.0), (0.0, speed / RADIUS if name != "body" else 0.0, 0.0))

    def energy():
        total = 0.0
        for name, link in handle.links.items():
            state, (mass, spin) = engine.link_state(link), (5.0, 5.0) if name == "body" else (0.2, 0.5 * SPIN)
            total += (mass * GRAVITY * (state.position[2] - RADIUS) + 0.5 * spin * state.angular_velocity[1] ** 2
                      + 0.5 * mass * sum(value * value for value in state.linear_velocity))
        return total
    return handle.links["body"], energy


def speed_to_climb():
    """Return the least speed: at the edge the angular momentum about it stays, and the rest lifts the axle [m/s]."""
    return (math.sqrt(2.0 * GRAVITY * STEP_HEIGHT / (1.0 + SHARE)) * (1.0 + SHARE) * RADIUS
            / (RADIUS - STEP_HEIGHT + SHARE * RADIUS))


@pytest.mark.parametrize("kind", ["box", "heights", "mesh"])
@pytest.mark.parametrize("step_ms", [1, 2, 5, 10])
def test_a_wheel_climbs_a_step_from_its_speed_on(make_engine, build, engine_kind, kind, step_ms):
    if engine_kind != "native" and (kind != "heights" or step_ms != 5):
        pytest.skip("the engines give the same bits, and this one is slow")
    low = 0.96 if step_ms < 5 else 0.92
    if kind == "mesh":          # libode finds late how deep a wheel is in an edge of a mesh
        low = 0.8 if step_ms < 10 else 0.75
    for factor, climbs in ((low, False), (1.03, True)):
        for start in (0.0, 0.003):
            engine = make_engine(step_ms, kerb(build, kind))
            body, energy = roll(engine, build, factor * speed_to_climb(), start)
            least = before = energy()
            for _ in range(2200 // step_ms):
                engine.step(1)
                now = energy()          # it may grow by what pushes a wheel out of what it enters in one step
                assert now < least + 1.5 * MASS * GRAVITY * speed_to_climb() * 1e-3 * step_ms and now < 1.01 * before
                least = min(least, now)
            state = engine.link_state(body)
            assert (state.position[2] > RADIUS + 0.9 * STEP_HEIGHT) == climbs
            assert state.position[2] > RADIUS - 1e-3 and abs(state.position[1]) < 1e-3


@pytest.mark.parametrize("step_ms, error", [(1, 0.015), (2, 0.025), (5, 0.05), (10, 0.1)])
def test_the_speed_after_a_step_is_that_of_an_impact(make_engine, build, step_ms, error):
    engine = make_engine(step_ms, kerb(build, "heights"))
    body, _ = roll(engine, build, 1.0)
    engine.step(1700 // step_ms)
    turn = (RADIUS - STEP_HEIGHT + SHARE * RADIUS) / ((1.0 + SHARE) * RADIUS ** 2)
    after = math.sqrt((turn * RADIUS) ** 2 - 2.0 * GRAVITY * STEP_HEIGHT / (1.0 + SHARE))
    assert engine.link_state(body).linear_velocity[0] == pytest.approx(after, rel=error)


RAMP = math.radians(10.0)


def rolled_down(engine, step_ms):
    """Let an axle roll down a ramp for 1.5 s; return its squared speed, that by energy, and how far it is aside [m]."""
    pose = ((-3.0 + RADIUS * math.sin(RAMP), 0.0, 3.0 * math.tan(RAMP) + RADIUS * math.cos(RAMP)),
            quaternion_from_rpy(0.0, RAMP, 0.0))
    body = engine.add_model(axle(), pose).links["body"]
    start = engine.link_state(body).position[2]
    engine.step(1500 // step_ms)
    state = engine.link_state(body)
    return (sum(value * value for value in state.linear_velocity),
            2.0 * GRAVITY * (start - state.position[2]) / (1.0 + SHARE), abs(state.position[1]))


@pytest.mark.parametrize("cell", [0.02, 0.2])
@pytest.mark.parametrize("step_ms", [1, 10])
def test_wheels_roll_down_a_ramp_by_energy(make_engine, build, step_ms, cell):
    ramp = field_of(lambda x, y: -math.tan(RAMP) * x + 0.0 * y, (12.0, 2.0), cell)
    gained, due, aside = rolled_down(make_engine(step_ms, [build.one_link("ramp", ramp, build.at(), surface=ROUGH)]),
                                     step_ms)
    assert gained == pytest.approx(due, rel=0.01)
    assert aside < 1e-9


@pytest.mark.parametrize("step_ms", [1, 10])
def test_a_robot_rests_on_a_slope_of_20_degrees(make_engine, build, m2wr, step_ms):
    """What is left is the compliance of the motors of the wheels: each turns by ``cfm`` times its torque."""
    tilt = math.radians(20.0)
    slope = build.one_link("slope", field_of(lambda x, y: math.tan(tilt) * x + 0.0 * y, cell=0.05), build.at(),
                           surface=ROUGH)
    engine = make_engine(step_ms, [slope])
    up = (-math.sin(tilt), 0.0, math.cos(tilt))
    handle = engine.add_model(m2wr, (tuple(0.1 * value for value in up), quaternion_from_rpy(0.0, -tilt, 0.0)))
    for joint in handle.joints.values():
        engine.set_joint_motor(joint, 0.0, 50.0)
    engine.step(1500 // step_ms)
    before = engine.link_state(handle.links["link_chassis"])
    engine.step(1000 // step_ms)
    after = engine.link_state(handle.links["link_chassis"])
    torque = RADIUS * 6.4 * GRAVITY * math.sin(tilt) / 2.0
    assert math.dist(before.position, after.position) < 1.2 * engine.settings.cfm * torque * RADIUS < 1.5e-6


def mesh_of(slope, cells):
    """Return a mesh of 12 m x 2 m that rises along x, of so many cells along x and y, of two triangles each."""
    across, up = np.linspace(-6.0, 6.0, cells[0] + 1), np.linspace(-1.0, 1.0, cells[1] + 1)
    places = np.array([(x, y, slope * x) for x in across for y in up])
    firsts = [row * len(up) + column for row in range(cells[0]) for column in range(cells[1])]
    return Mesh(places, np.array([part for k in firsts for part in (
        (k, k + len(up), k + len(up) + 1), (k, k + len(up) + 1, k + 1))]))


@pytest.mark.parametrize("cells", [(1, 1), (120, 20)])
@pytest.mark.parametrize("step_ms", [1, 2, 5, 10])
def test_wheels_roll_down_a_mesh_ramp_by_energy(make_engine, build, engine_kind, cells, step_ms):
    if engine_kind != "native" and step_ms != 5:
        pytest.skip("the engines give the same bits, and this one is slow")
    ramp = mesh_of(-math.tan(RAMP), cells)
    gained, due, aside = rolled_down(make_engine(step_ms, [build.one_link("ramp", ramp, build.at(), surface=ROUGH)]),
                                     step_ms)
    assert due * (0.98 if step_ms == 10 else 0.993) < gained < due      # edges between triangles take some, give none
    assert aside < (1e-5 if cells == (1, 1) else 0.03)     # and turn the axle a little


@pytest.mark.parametrize("step_ms", [1, 2, 5, 10])
def test_a_robot_creeps_on_a_mesh_slope_by_compliance(make_engine, build, engine_kind, m2wr, step_ms):
    """Each contact yields by ``cfm`` times its force; the robot weighs 63 N."""
    if engine_kind != "native" and step_ms != 5:
        pytest.skip("the engines give the same bits, and this one is slow")
    tilt = math.radians(20.0)
    engine = make_engine(step_ms, [build.one_link("slope", mesh_of(math.tan(tilt), (120, 20)), build.at(),
                                                  surface=ROUGH)])
    up = (-math.sin(tilt), 0.0, math.cos(tilt))
    handle = engine.add_model(m2wr, (tuple(0.1 * value for value in up), quaternion_from_rpy(0.0, -tilt, 0.0)))
    for joint in handle.joints.values():
        engine.set_joint_motor(joint, 0.0, 50.0)
    engine.step(1500 // step_ms)
    before = engine.link_state(handle.links["link_chassis"])
    engine.step(1000 // step_ms)
    away = math.dist(before.position, engine.link_state(handle.links["link_chassis"]).position)
    assert away == pytest.approx(0.5 * engine.settings.cfm * 6.4 * GRAVITY * math.sin(tilt), rel=0.2)


def test_the_edge_of_a_heightmap_carries_the_belly_of_a_box(make_engine, build):
    """A ridge of one row of samples under the middle of a box, far from its corners."""
    ridge = build.one_link("ridge", field_of(lambda x, y: np.where(np.abs(x) < 0.005, 0.05, 0.0)), build.at(),
                           surface=ROUGH)
    engine = make_engine(1, [ridge, build.one_link("box", Box((0.4, 0.3, 0.1)), build.at(z=0.11), static=False)])
    engine.step(300)
    assert engine.link_state(engine.handles[1].links["link"]).position[2] == pytest.approx(0.1, abs=2e-3)


# -- the kernel itself --------------------------------------------------------------------------------------------

def contacts(heights, cell, kind, size, position, rpy):
    out = np.empty((kernels.MOST, kernels.CONTACT))
    pose = np.array(tuple(position) + tuple(quaternion_from_rpy(*rpy)))
    count = kernels.height_contacts(heights, tops_of(heights), np.array(cell), FIELD, kind, np.array(size),
                                    pose, out, np.empty(kernels.WORK), np.empty(windows.WINDOW, np.int64))
    return out[:count]


def sampled(heights, cell, position, reach, spacing=0.0004):
    """Return points of the ground (n, 3) around a place, by the rule of the record: the diagonal rises with x and y."""
    rows, columns = heights.shape
    x, y = np.meshgrid(np.arange(-reach, reach, spacing) + position[0], np.arange(-reach, reach, spacing) + position[1])
    across, down = x / cell[0] + 0.5 * (columns - 1), 0.5 * (rows - 1) - y / cell[1]
    j, i = np.clip(across.astype(int), 0, columns - 2), np.clip(down.astype(int), 0, rows - 2)
    right, up = across - j, 1.0 - (down - i)
    low, high = heights[i + 1, j], heights[i, j + 1]
    z = np.where(right >= up, low + (heights[i + 1, j + 1] - low) * right + (high - heights[i + 1, j + 1]) * up,
                 low + (high - heights[i, j]) * right + (heights[i, j] - low) * up)
    return np.stack((x, y, z), -1).reshape(-1, 3)


@pytest.mark.parametrize("kind", [kernels.SPHERE, kernels.WHEEL])
@pytest.mark.parametrize("cell", [(0.02, 0.03), (0.15, 0.1)])
def test_the_deepest_contact_is_that_of_sampled_ground(kind, cell):
    random = np.random.default_rng(int(1e3 * cell[0]) + kind)
    compared = 0
    for _ in range(60):
        heights = 0.02 * random.standard_normal((21, 27))
        position = (random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(0.05, 0.14))
        rpy = (-0.5 * math.pi + random.uniform(-0.2, 0.2), 0.0, random.uniform(-3.0, 3.0))
        points = sampled(heights, cell, position, 0.12)
        away = points - position
        if kind == kernels.WHEEL:
            axis = np.array(rotate(quaternion_from_rpy(*rpy), (0.0, 0.0, 1.0)))
            along = away @ axis
            away = (away - along[:, None] * axis)[np.abs(along) <= 0.5 * WIDTH]
        nearest = np.min(np.linalg.norm(away, axis=1))
        below = sampled(heights, cell, position, 0.0005)[0, 2]
        found = contacts(heights, cell, kind, (RADIUS, WIDTH, 0.0), position, rpy)
        if below > position[2] - 0.03:
            continue                            # its centre is in the ground or nearly
        if nearest < RADIUS - 0.001:
            deepest = max(found[:, 6])
            assert deepest <= RADIUS - nearest + 1.5e-3
            if not any(abs(row[3:6] @ axis) > 0.9 for row in found) if kind == kernels.WHEEL else True:
                assert deepest == pytest.approx(RADIUS - nearest, abs=1.5e-3)
                compared += 1
            assert np.allclose(np.linalg.norm(found[:, 3:6], axis=1), 1.0)
        elif nearest > RADIUS + 0.001:
            assert len(found) == 0
    assert compared > 15


@pytest.mark.parametrize("half, radius", [(0.0, 0.05), (0.02, 0.1), (0.04, 0.3)])
@pytest.mark.parametrize("cell", [0.005, 0.02, 0.07])
def test_narrowing_loses_no_triangle_in_contact(half, radius, cell):
    """The triangles in contact among the cells that are listed are those among all cells below the shape."""
    random, sizes, found_any = np.random.RandomState(7), np.array([cell, 1.3 * cell]), 0
    near, work = np.zeros((513, 11)), np.zeros(rounds.ROUND_WORK)
    window, everything = np.zeros(windows.WINDOW, np.int64), np.zeros(windows.WINDOW, np.int64)
    for _ in range(150):
        heights = random.normal(0.0, random.choice((0.0, 0.002, 0.01)), (120, 90)) + random.choice(
            (0.0, 0.3)) * cell * np.arange(90)
        tops, centre = tops_of(heights), np.array(tuple(random.uniform(-0.2, 0.2, 2)) + (0.0,))
        turned = quaternion_from_rpy(0.5 * math.pi + random.uniform(-0.6, 0.6), 0.0, random.uniform(-3.1, 3.1))
        frame = np.array([rotate(turned, axis) for axis in np.eye(3).tolist()])
        centre[2] = ground_below(heights, sizes, centre[0], centre[1])[0] + radius + random.uniform(-0.02, 0.02)
        reach = np.array([half * abs(along) + radius * math.sqrt(max(1.0 - along * along, 0.0)) if half > 0.0
                          else radius for along in frame[2]])
        assert cells_below(heights, sizes, centre, reach, everything)
        window[:4] = everything[:4]
        everything = everything.copy()
        across = windows.narrow(heights, tops, sizes, centre, frame, radius, half,
                                greatest_in(heights, tops, window), reach, window)
        listed = windows.tighten(heights, sizes, centre, frame, radius, half, across, window) if across >= 0.0 else 0
        rows = []
        for place, number in ((window, listed), (everything, windows.MOST_LISTED + 1)):
            count = rounds._near_triangles(heights, sizes, centre, frame, radius, half, place, number, near, work)
            rows.append(near[:count].copy())
        assert len(rows[0]) == len(rows[1])
        np.testing.assert_allclose(rows[0], rows[1], rtol=0.0, atol=1e-12)
        found_any += len(rows[0]) > 0
    assert found_any > 30


def test_a_kerb_beside_a_wheel_pushes_its_side():
    """It reaches 1 mm into the wheel from the side, and is 2 cm high: it does not lift the wheel."""
    heights = np.tile(np.where(np.arange(401) < 190, 0.02, 0.0)[:, None], (1, 41))      # rows are against y
    found = contacts(heights, (0.01, 0.001), kernels.WHEEL, (RADIUS, WIDTH, 0.0), (0.0, -0.009, 0.0999),
                     (-0.5 * math.pi, 0.0, 0.0))
    rows = sorted(found.tolist(), key=lambda row: row[5])
    assert len(rows) == 2 and rows[1][3:] == pytest.approx((0.0, 0.0, 1.0, 1e-4), abs=1e-6)
    assert rows[0][3:] == pytest.approx((0.0, -1.0, 0.0, 0.001), abs=1.1e-3)


def test_level_ground_gives_one_contact_in_the_middle():
    heights = np.zeros((40, 60))
    for kind, position in ((kernels.WHEEL, (0.013, 0.017, 0.0999)), (kernels.SPHERE, (0.013, 0.017, 0.0999))):
        found = contacts(heights, (0.01, 0.01), kind, (RADIUS, WIDTH, 0.0), position, (-0.5 * math.pi + 1e-5, 0.0, 0.3))
        assert found.shape == (1, 7)
        assert found[0] == pytest.approx((0.013, 0.017, 0.0, 0.0, 0.0, 1.0, 1e-4), abs=2e-5)
    corners = contacts(heights, (0.01, 0.01), kernels.BOX, (0.2, 0.1, 0.1), (0.0, 0.0, 0.0499), (0.0,) * 3)
    assert {tuple(np.round(row[:2], 6)) for row in corners} >= {(x, y) for x in (-0.1, 0.1) for y in (-0.05, 0.05)}
    assert np.allclose(corners[:, 6], 1e-4)
    barrel = contacts(heights, (0.01, 0.01), kernels.CYLINDER, (RADIUS, 0.2, 0.0), (0.0, 0.0, 0.0999),
                      (-0.5 * math.pi, 0.0, 0.0))
    assert sorted(np.round(barrel[:, 1], 6)) == [-0.1, 0.1]


@pytest.mark.parametrize("kind", [kernels.SPHERE, kernels.CYLINDER, kernels.WHEEL])
def test_a_slope_of_many_cells_is_that_of_one(kind):
    """So a contact of up to 2 mm, above which its side may be in contact, does not depend on the sampling."""
    random = np.random.default_rng(kind)
    for _ in range(50):
        slopes, found = random.uniform(-0.02, 0.02, 2), []
        position = (random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2))
        height = slopes @ position + RADIUS * math.sqrt(1.0 + slopes @ slopes) - random.uniform(1e-5, 1e-3)
        rpy = (-0.5 * math.pi + random.uniform(-0.02, 0.02), 0.0, random.uniform(-3.0, 3.0))
        for count in (2, 41, 401):
            x = np.linspace(-1.0, 1.0, count)
            heights = slopes[0] * x[None, :] - slopes[1] * x[:, None]
            cell = 2.0 / (count - 1)
            found.append(contacts(heights, (cell, cell), kind, (RADIUS, WIDTH, 0.0), position + (height,), rpy))
        assert len(found[0]) > 0
        assert found[1] == pytest.approx(found[0], abs=1e-9) and found[2] == pytest.approx(found[0], abs=1e-9)


def test_no_sample_exceeds_the_greatest_height_of_its_cells():
    random = np.random.default_rng(5)
    for _ in range(200):
        rows, columns = random.integers(2, 120, 2)
        heights = random.standard_normal((rows, columns))
        top, left = random.integers(0, rows - 1), random.integers(0, columns - 1)
        window = np.array([top, random.integers(top, rows - 1), left, random.integers(left, columns - 1)])
        part = heights[top:window[1] + 2, left:window[3] + 2]
        greatest = greatest_in(heights, tops_of(heights), window)
        assert part.max() <= greatest <= heights.max()
        if (window[1] - top + 1) * (window[3] - left + 1) <= FEW_CELLS:
            assert greatest == part.max()


@pytest.mark.parametrize("shape", [Box((0.3, 0.2, 0.1)), Sphere(0.1), Cylinder(0.1, 0.2)])
def test_a_body_falls_asleep_on_rough_ground(make_engine, build, shape):
    random = np.random.default_rng(3)
    ground = build.one_link("ground", Heightmap(0.02 * random.random((41, 41)), (2.0, 2.0)), build.at())
    engine = make_engine(2, [ground, build.one_link("body", shape, ((0.05, 0.03, 0.3), (0.0, 0.0, 0.0, 1.0)),
                                                    static=False, surface=Surface(mu=0.8, mu2=0.8))])
    engine.step(1500)
    state = engine.link_state(engine.handles[1].links["link"])
    assert 0.03 < state.position[2] < 0.13 and math.hypot(*state.position[:2]) < 0.3


def test_outside_the_map_there_is_no_ground():
    heights = np.zeros((5, 5))
    for kind in (kernels.SPHERE, kernels.WHEEL, kernels.CYLINDER, kernels.BOX):
        assert len(contacts(heights, (0.1, 0.1), kind, (0.1, 0.1, 0.1), (5.0, 5.0, 0.05), (0.0,) * 3)) == 0
        assert len(contacts(heights, (0.1, 0.1), kind, (0.1, 0.1, 0.1), (1e6, -1e6, -5.0), (0.0,) * 3)) == 0
