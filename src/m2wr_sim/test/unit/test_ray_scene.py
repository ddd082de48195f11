# SPDX-License-Identifier: BSD-3-Clause
"""The table of shapes: rows, owners, poses, growth."""
import math

import numpy as np
import pytest

from m2wr_sim.geometry import matrix_from_quaternion, quaternion_from_rpy
from m2wr_sim.model.types import Box, Cylinder, Plane, RayScan, Sphere
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.ray_kernels import HALF, KIND, OWNER, PLANE
from m2wr_sim.sensors.ray_scene import RayScene

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
ORIGIN = ((0.0, 0.0, 0.0), UPRIGHT)


def at(x, y=0.0, z=0.0):
    return (x, y, z), UPRIGHT


def ahead(scene, **kwargs):
    """Return the range straight ahead from the origin."""
    laser = LaserSensor(RayScan(samples=1, range_min=0.0, range_max=50.0), np.random.default_rng(0))
    return laser.cast(scene, ORIGIN, **kwargs)[0][0]


def test_empty_scene_shows_nothing():
    assert ahead(RayScene(4)) == math.inf and len(RayScene(4)) == 0


def test_table_grows_and_rows_stay():
    scene = RayScene(1)
    rows = [scene.add(Sphere(0.5), at(k + 10.0), k) for k in range(20)]
    assert rows == list(range(20)) and scene.count == len(scene) == 20 and scene.capacity >= 20
    assert ahead(scene) == pytest.approx(9.5)
    scene.set_pose(rows[19], *at(3.0))
    assert ahead(scene) == pytest.approx(2.5)


def test_removed_owner_is_gone_and_its_rows_are_used_again():
    scene = RayScene(2)
    scene.add(Sphere(0.5), at(2.0), "near")
    scene.add(Box((1, 1, 1)), at(3.0), "near")
    scene.add(Plane((-1.0, 0.0, 0.0)), at(4.0), "near")
    far = scene.add(Sphere(0.5), at(6.0), "far")
    assert scene.rows_of("near") == (0, 1, 2)
    scene.remove_owner("near")
    assert ahead(scene) == pytest.approx(5.5) and len(scene) == 1 and scene.rows_of("near") == ()
    assert scene.rows_of("far") == (far,)
    assert scene.add(Sphere(0.5), at(3.0), "new") in (0, 1, 2)
    assert scene.count == 4 and ahead(scene) == pytest.approx(2.5)
    scene.remove_owner("never there")


def test_spawning_and_deleting_for_long_does_not_grow_the_table():
    scene = RayScene(8)
    for k in range(100):
        for _ in range(5):
            scene.add(Sphere(0.1), at(1.0), k)
        scene.remove_owner(k)
    assert scene.capacity == 8 and len(scene) == 0 and ahead(scene) == math.inf


def test_ignored_owner_is_looked_through_also_after_others_left():
    scene = RayScene(4)
    for x, owner in ((2.0, "a"), (4.0, "b"), (6.0, "c")):
        scene.add(Sphere(0.5), at(x), owner)
    assert ahead(scene, ignore_owner="a") == pytest.approx(3.5)
    scene.remove_owner("a")
    scene.add(Sphere(0.5), at(1.0), "d")
    assert ahead(scene, ignore_owner="d") == pytest.approx(3.5)
    assert ahead(scene, ignore_owner="a") == pytest.approx(0.5)
    assert len({scene.shapes[row, OWNER] for row in range(3)}) == 3


def test_version_grows_with_every_change():
    scene, versions = RayScene(4), []
    row = scene.add(Sphere(0.5), at(2.0), "a")
    versions.append(scene.version)
    scene.set_pose(row, *at(3.0))
    versions.append(scene.version)
    scene.set_poses(np.array([row]), np.array([(0.0, 0.0, 0.0) + tuple(UPRIGHT)]))
    versions.append(scene.version)
    scene.mover(np.array([row]), np.ones((1, 7)))()
    versions.append(scene.version)
    scene.remove_owner("a")
    versions.append(scene.version)
    assert versions == sorted(set(versions)) and versions[0] > 0


def test_many_poses_equal_single_ones():
    rng = np.random.default_rng(0)
    positions, angles = rng.normal(size=(6, 3)), rng.uniform(-3, 3, (6, 3))
    turns = np.array([quaternion_from_rpy(*row) for row in angles])
    one, many, moved = RayScene(6), RayScene(6), RayScene(2)
    for scene in (one, many, moved):
        rows = np.array([scene.add(Box((1, 2, 3)), ORIGIN, 0) for _ in range(6)])
    poses = np.hstack((positions, 3.0 * turns))         # of any length
    many.set_poses(rows, poses)
    for row in rows:
        one.set_pose(row, positions[row], turns[row])
        np.testing.assert_allclose(one.shapes[row, :9].reshape(3, 3), matrix_from_quaternion(turns[row]), atol=1e-14)
    np.testing.assert_allclose(many.shapes, one.shapes, atol=1e-14)
    np.testing.assert_array_equal(many.spheres, one.spheres)
    late = np.zeros_like(poses)
    move = moved.mover(rows, late)
    move()
    late[:] = poses
    for _ in range(2):
        move()
        np.testing.assert_array_equal(moved.shapes[:6], many.shapes)
        np.testing.assert_array_equal(moved.spheres[:, :6], many.spheres)
        for _ in range(moved.capacity):                 # the tables grow under the mover
            moved.add(Sphere(0.5), ORIGIN, "more")
        late[:] += 1.0
        move()
        late[:] = poses


def test_rows_outside_the_table_are_not_written():
    scene = RayScene(2)
    scene.add(Sphere(0.5), at(2.0), "a")
    before = scene.spheres.copy()
    scene.set_poses(np.array([-1, 2, 99]), np.ones((3, 7)))
    scene.mover(np.array([-1, 2, 99]), np.ones((3, 7)))()
    np.testing.assert_array_equal(scene.spheres, before)


def test_wrong_shapes_of_pose_arrays_are_refused():
    with pytest.raises(ValueError, match=r"expected \(1, 7\)"):
        RayScene(2).set_poses(np.array([0]), np.zeros((1, 4)))


@pytest.mark.parametrize("rows, poses", [
    (np.array([0]), np.zeros((2, 7))), (np.array([0]), np.zeros((1, 7), np.float32)),
    (np.array([0], np.int32), np.zeros((1, 7))), (np.array([0, 1]), np.zeros((2, 14))[:, ::2])])
def test_arrays_without_a_contiguous_address_are_refused(rows, poses):
    with pytest.raises(ValueError, match="expected"):
        RayScene(2).mover(rows, poses)


def test_a_plane_follows_the_pose_of_its_link():
    scene = RayScene(1)
    row = scene.add(Plane((-2.0, 0.0, 0.0)), ((4.0, 7.0, 1.0), quaternion_from_rpy(0.3, 0.2, 0.1)), "wall")
    assert scene.shapes[row, KIND] == PLANE and ahead(scene) == pytest.approx(4.0)
    scene.set_pose(row, (5.0, 0.0, 0.0), quaternion_from_rpy(1.0, 1.0, 1.0))
    assert ahead(scene) == pytest.approx(5.0)


def test_sizes_are_halved_and_bounding_spheres_enclose():
    scene = RayScene(3)
    scene.add(Box((2.0, 4.0, 4.0)), ORIGIN, 0)
    scene.add(Cylinder(3.0, 8.0), ORIGIN, 0)
    scene.add(Sphere(2.0), ORIGIN, 0)
    np.testing.assert_array_equal(scene.shapes[:3, HALF:HALF + 3], [(1, 2, 2), (3, 3, 4), (2, 2, 2)])
    np.testing.assert_allclose(scene.spheres[3, :3], [3.0, 5.0, 2.0])


@pytest.mark.parametrize("geometry, message", [
    (Box((1.0, -1.0, 1.0)), "not negative"), (Sphere(math.nan), "finite"), (Cylinder(1.0, math.inf), "finite"),
    (Plane((0.0, 0.0, 0.0)), "plane normal"), (Plane((math.nan, 0.0, 1.0)), "plane normal")])
def test_bad_sizes_are_named_and_leave_the_scene_alone(geometry, message):
    scene = RayScene(2)
    with pytest.raises(ValueError, match=message):
        scene.add(geometry, ORIGIN, "a")
    assert len(scene) == 0 and scene.count == 0


def test_unknown_geometry_is_named():
    with pytest.raises(TypeError, match="cannot see a dict"):
        RayScene(2).add({}, ORIGIN, "a")
