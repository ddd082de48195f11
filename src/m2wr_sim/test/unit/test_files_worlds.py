# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of this package: everything loads, has its position, and the routes between obstacles are free."""
import math
from pathlib import Path

import numpy as np
import pytest

from m2wr_sim.geometry import compose, matrix_from_quaternion, yaw_of
from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.model.types import Box, Cylinder, Plane, Sphere

PACKAGE = Path(__file__).resolve().parents[2]
WORLDS = sorted(path.stem for path in (PACKAGE / "worlds").glob("*.world"))
ROBOT_RADIUS = 0.45
BARRIERS = {
    "world01": [],
    "world02": [(-4.97, 4.73, 0.0), (-0.94, 4.73, 0.0), (2.99, 4.72, 0.0), (-2.28, -0.40, 0.0), (1.77, -0.39, 0.0),
                (-4.71, -2.79, -1.58)],
    "world03": [(-4.75, 0.83, -1.54), (-2.66, 2.94, 0.0), (-0.73, 2.94, 0.0), (3.40, -2.95, -1.54), (1.67, -5.22, 0.0),
                (-2.37, -5.23, 0.0), (-4.72, -3.19, -1.58), (1.51, -0.50, 0.0)],
}


def load(name):
    path = PACKAGE / "worlds" / (name + ".world")
    return load_world(str(path), resolve_model=ModelFolders([str(PACKAGE / "models")]))


def shapes_of(world):
    """Yield (model name, geometry, world pose) of every collision but planes."""
    for model in world.models:
        for link in model.links:
            for part in link.collisions:
                if not isinstance(part.geometry, Plane):
                    yield model.name, part.geometry, compose(compose(model.pose, link.pose), part.pose)


def half_extents(geometry):
    if isinstance(geometry, Box):
        return [0.5 * edge for edge in geometry.size]
    if isinstance(geometry, Sphere):
        return [geometry.radius] * 3
    return [geometry.radius, geometry.radius, 0.5 * geometry.length]


def corners(geometry, pose):
    """Return the ground points of the corners of a shape's bounding box."""
    turn, half = matrix_from_quaternion(pose[1]), half_extents(geometry)
    points = []
    for index in range(8):
        signs = [1.0 if index >> bit & 1 else -1.0 for bit in range(3)]
        points.append(turn @ [sign * edge for sign, edge in zip(signs, half)] + pose[0])
    return points


def clearance(world, x, y, height=0.2):
    """Return the distance on the ground from points (scalars or arrays) to the nearest shape below ``height``."""
    best = np.full(np.shape(x), np.inf)
    for _, geometry, pose in shapes_of(world):
        points = np.array(corners(geometry, pose))
        if points[:, 2].min() > height:
            continue
        offset = np.stack([np.asarray(x) - pose[0][0], np.asarray(y) - pose[0][1]])
        if isinstance(geometry, Cylinder):
            best = np.minimum(best, np.maximum(0.0, np.hypot(*offset) - geometry.radius))
            continue
        turn = matrix_from_quaternion(pose[1])     # barriers and walls turn about z, their plates about their length
        along = turn[:2, 0] / np.hypot(*turn[:2, 0])
        outside = [np.maximum(0.0, np.abs(offset[0] * axis[0] + offset[1] * axis[1]) - np.abs(
            (points[:, :2] - pose[0][:2]) @ axis).max()) for axis in (along, np.array([-along[1], along[0]]))]
        best = np.minimum(best, np.hypot(*outside))
    return best


@pytest.mark.parametrize("name", WORLDS)
def test_world_loads_without_a_note(name):
    world = load(name)
    assert world.notes == () and world.state is None
    assert [light.name for light in world.lights] == ["sun"]
    assert world.physics.max_step_size == 0.001 and world.physics.gravity == (0.0, 0.0, -9.8)
    names = [model.name for model in world.models]
    assert names[:1] == ([] if name == "void" else ["ground_plane"]) and len(set(names)) == len(names)


def test_ground_plane_is_gazebos():
    plane = load("empty").models[0]
    part = plane.links[0].collisions[0]
    assert plane.static and (plane.links[0].name, part.name) == ("link", "collision")
    assert part.geometry == Plane((0.0, 0.0, 1.0), (100.0, 100.0))
    assert (part.surface.mu, part.surface.mu2, part.surface.collide_bitmask) == (100.0, 50.0, 0xffff)


@pytest.mark.parametrize("name", sorted(BARRIERS))
def test_arena_layout(name):
    models = {model.name: model for model in load(name).models}
    outer = [model for key, model in models.items() if key.startswith("wall_")]
    inner = [model for key, model in models.items() if key.startswith("barrier_")]
    assert len(outer) == 16 and sum(key.startswith("corner_") for key in models) == 7
    for model in outer:
        x, y, _ = model.pose[0]
        assert max(abs(x), abs(y)) == 9.4 and min(abs(x), abs(y)) in (2.03, 6.1)
    found = [model.pose[0][:2] + (yaw_of(model.pose[1]),) for model in inner]
    assert [pytest.approx(pose) for pose in found] == BARRIERS[name]
    assert all(model.static for key, model in models.items() if not key.startswith("can"))


def test_barrier_shape():
    """Six boxes; the face stands 0.336 m from the middle at the laser's height, the foot 0.405 m at the caster's."""
    barrier = next(model for model in load("world01").models if model.name == "wall_north_1")
    boxes = [(part.geometry, part.pose) for part in barrier.links[0].collisions]
    assert len(boxes) == 6 and all(geometry.size[0] == 4.065 for geometry, _ in boxes)

    def half_width(height):
        reach = 0.0
        for step in range(1000):
            y = 0.5 * step / 1000.0
            for geometry, pose in boxes:
                local = matrix_from_quaternion(pose[1]).T @ [0.0, y - pose[0][1], height - pose[0][2]]
                if all(abs(value) <= 0.5 * edge for value, edge in zip(local, geometry.size)):
                    reach = y
        return reach

    assert half_width(0.15) == pytest.approx(0.336, abs=0.001)
    assert half_width(0.05) == pytest.approx(0.405, abs=0.001)
    assert half_width(1.0) == pytest.approx(0.153, abs=0.001)


@pytest.mark.parametrize("name", ["world01", "world02", "world03"])
@pytest.mark.parametrize("place", [(0.0, 8.0), (0.0, -4.0)])
def test_start_and_goal_are_free(name, place):
    assert clearance(load(name), *place) > ROBOT_RADIUS


def test_clearance_itself_against_known_distances():
    world = load("world02")
    assert clearance(world, -2.28, 0.6) == pytest.approx(1.0 - 0.4055, abs=1e-6)    # 1 m beside a barrier's middle line
    corner = math.hypot(4.4 - 4.3125, 0.34 - 0.0055)
    assert clearance(world, -4.4, 0.34) == pytest.approx(corner, abs=1e-6)
    assert clearance(world, 8.0, 8.0) == pytest.approx(math.hypot(0.75, 0.75) - 0.3, abs=1e-6)      # a corner's barrel
    assert clearance(world, -0.94, 4.73) == 0.0


def test_the_arena_is_closed_for_the_robot():
    """Between outer barriers and corner barrels no gap is as wide as the robot (0.44 m)."""
    step, count = 0.1, 201
    ticks = step * (np.arange(count) - count // 2)
    free = clearance(load("world01"), *np.meshgrid(ticks, ticks, indexing="ij")) >= 0.22
    seen, todo = {(count // 2, count // 2)}, [(count // 2, count // 2)]
    while todo:
        row, column = todo.pop()
        for new in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if free[new] and new not in seen:
                assert np.abs(ticks[list(new)]).max() < 9.4, "the robot gets out near {}".format(ticks[list(new)])
                seen.add(new)
                todo.append(new)
    assert len(seen) > 20000      # it did get around: most of 17 m x 17 m


def test_yard_of_the_unreachable_world_is_closed_and_roomy():
    world = load("unreachable")
    assert clearance(world, 0.0, -4.0) == pytest.approx(2.0)
    distances = np.arange(2.0, 3.2, 0.04)
    for angle in np.radians(np.arange(360)):
        hit = clearance(world, distances * np.cos(angle), -4.0 + distances * np.sin(angle)).min()
        assert hit == 0.0, "gap at {:.0f} degrees".format(math.degrees(angle))


def test_shapes_world_has_one_of_everything():
    world = load("shapes")
    kinds = {(type(geometry).__name__, model.static) for model in world.models for link in model.links
             for geometry in (part.geometry for part in link.collisions)}
    assert {(kind, static) for kind in ("Box", "Cylinder", "Sphere") for static in (True, False)} <= kinds
    table = next(model for model in world.models if model.name == "table")
    assert table.nested == ("top",)
    poses = {link.name: compose(table.pose, link.pose)[0] for link in table.links}
    assert poses["top::lid"] == pytest.approx((0.0, 5.2, 1.0))
    for model in world.models[1:]:
        lowest = min(point[2] for name, geometry, pose in shapes_of(world) if name == model.name
                     for point in corners(geometry, pose))
        assert lowest == pytest.approx(0.0, abs=1e-9)


def test_loose_things_have_the_inertia_of_their_shape():
    for world in (load("shapes"), load("world02")):
        for model in (model for model in world.models if not model.static):
            link, = model.links
            mass, shape = link.inertial.mass, link.collisions[0].geometry
            if isinstance(shape, Box):
                x, y, z = shape.size
                expected = (mass * (y * y + z * z) / 12, mass * (x * x + z * z) / 12, mass * (x * x + y * y) / 12)
            elif isinstance(shape, Sphere):
                expected = (0.4 * mass * shape.radius ** 2,) * 3
            else:
                side = mass * (3 * shape.radius ** 2 + shape.length ** 2) / 12
                expected = (side, side, 0.5 * mass * shape.radius ** 2)
            xx, xy, xz, yy, yz, zz = link.inertial.inertia
            assert (xx, yy, zz) == pytest.approx(expected, rel=1e-5) and (xy, xz, yz) == (0.0, 0.0, 0.0)
