# SPDX-License-Identifier: BSD-3-Clause
"""Rays against meshes and heightmaps: the trees against every triangle one by one, and against ODE's own rays."""
import math
import os
import random
import subprocess
import sys

import numpy as np
import ode
import pytest

from m2wr_sim.geometry import compose, quaternion_from_rpy, rotate
from m2wr_sim.model.types import Box, Heightmap, Mesh, RayScan
from m2wr_sim.physics import native_shapes, pyode_bodies
from m2wr_sim.sensors import laser, mesh_kernels, ray_kernels, rays_numpy
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.mesh_tree import corners_of
from m2wr_sim.sensors.ray_scene import RayScene

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
SPANS = (0.0, 1.5, math.pi, 6.2, 2.0 * math.pi, 7.5, -2.5)


def any_turn(draw):
    numbers = [draw.gauss(0.0, 1.0) for _ in range(4)]
    length = math.sqrt(sum(value * value for value in numbers))
    return tuple(value / length for value in numbers)


def soup(draw, count, reach=3.0):
    """Return a mesh of loose triangles."""
    vertices = []
    for _ in range(count):
        middle = [draw.uniform(-reach, reach) for _ in range(3)]
        vertices.extend([value + draw.gauss(0.0, 0.5) for value in middle] for _ in range(3))
    return Mesh(np.array(vertices), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), "soup %r" % draw.random())


def hills(draw, rows, columns):
    heights = np.array([[draw.uniform(0.0, 1.0) for _ in range(columns)] for _ in range(rows)])
    return Heightmap(heights, (draw.uniform(3.0, 9.0), draw.uniform(3.0, 9.0)),
                     tuple(draw.gauss(0.0, 1.0) for _ in range(3)), "hills %r" % draw.random())


def block(size, offset=(0.0, 0.0, 0.0)):
    """Return a box as a mesh."""
    x, y, z = (0.5 * value for value in size)
    vertices = np.array([(a, b, c) for a in (-x, x) for b in (-y, y) for c in (-z, z)]) + offset
    faces = np.array([(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
                      (0, 6, 4), (1, 5, 7), (1, 7, 3)], np.int32)
    return Mesh(vertices, faces, "block %r %r" % (size, tuple(offset)))


def any_scan(draw, kind):
    rows = (1, 1, 5)[kind % 3]
    start, span = draw.uniform(-3.5, 0.5), SPANS[kind % len(SPANS)]
    return RayScan(samples=draw.randint(1, 220), min_angle=start, max_angle=start + span, vertical_samples=rows,
                   vertical_min_angle=-0.6 * (rows > 1), vertical_max_angle=1.9 * (rows > 1), range_min=0.1,
                   range_max=draw.uniform(2.0, 12.0))


def distances(scan, scene, pose):
    """Return the distances of all rays, and the rows of what they hit."""
    sensor = LaserSensor(scan, np.random.default_rng(0))
    sensor.cast(scene, pose)
    return sensor._distances.copy(), sensor._hits.copy()


def directions(scan, pose):
    sensor = LaserSensor(scan, np.random.default_rng(0))
    return [rotate(pose[1], (flat * x, flat * y, up)) for flat, up in sensor._rows for x, y in sensor._beams.T]


def plainly(meshes, origin, direction, nearest, longest):
    """Return the range of one ray: the plane of every triangle, then whether the point lies within its sides."""
    found = longest
    for geometry, pose in meshes:
        for a, b, c in corners_of(geometry):
            a, b, c = (np.array(compose(pose, (tuple(corner), UPRIGHT))[0]) for corner in (a, b, c))
            normal = np.cross(b - a, c - a)
            slope = normal @ direction
            if abs(slope) < 1e-14:
                continue
            t = normal @ (a - origin) / slope
            point = np.array(origin) + t * np.array(direction)
            inside = all(normal @ np.cross(two - one, point - one) >= 0.0 for one, two in ((a, b), (b, c), (c, a)))
            if inside and nearest < t < found:
                found = t
    return found


@pytest.fixture
def plain_numpy(monkeypatch):
    """Return a function that makes scans be cast without compiled kernels from then on."""
    def switch():
        monkeypatch.setattr(laser, "_cast_rays", rays_numpy.cast_rays_numpy)
        monkeypatch.setattr(laser, "_cast_meshes", rays_numpy.cast_meshes_numpy)
        monkeypatch.setattr(laser, "_cast_heights", rays_numpy.cast_heights_numpy)
    return switch


@pytest.mark.parametrize("seed", [2, 3, 4, 5, 6, 9, 10, 11])
def test_ranges_are_those_of_every_triangle_one_by_one(seed):
    draw, scene = random.Random(seed), RayScene()
    meshes = [(soup(draw, 12) if index else hills(draw, 3, 4),
               (tuple(draw.uniform(-2.0, 2.0) for _ in range(3)), any_turn(draw))) for index in range(2)]
    for geometry, pose in meshes:
        scene.add(geometry, pose, "m")
    pose = (tuple(draw.uniform(-3.0, 3.0) for _ in range(3)), any_turn(draw) if seed % 2 else UPRIGHT)
    scan = any_scan(draw, seed)
    found, _ = distances(scan, scene, pose)
    expected = [plainly(meshes, pose[0], ray, scan.range_min, scan.range_max) for ray in directions(scan, pose)]
    assert found == pytest.approx(expected, abs=1e-9, rel=0.0)
    assert min(expected) < scan.range_max


@pytest.mark.parametrize("seed", range(42))
def test_ranges_and_hits_are_those_of_the_fallback(seed, plain_numpy):
    if not ray_kernels.HAVE_NUMBA:
        assert laser._cast_meshes is rays_numpy.cast_meshes_numpy
        return
    draw, scene = random.Random(100 + seed), RayScene(2)
    for index in range(draw.randint(1, 4)):
        shape = soup(draw, draw.randint(1, 150)) if draw.random() < 0.6 else hills(draw, draw.randint(2, 12), 7)
        turn = any_turn(draw) if draw.random() < 0.7 else UPRIGHT
        scene.add(shape, (tuple(draw.uniform(-4.0, 4.0) for _ in range(3)), turn), index, retro=index + 1.0)
    scene.add(Box((1.0, 1.0, 1.0)), ((2.0, 2.0, 0.0), UPRIGHT), "box")
    scan = any_scan(draw, seed)
    pose = (tuple(draw.uniform(-3.0, 3.0) for _ in range(3)), any_turn(draw) if seed % 2 else UPRIGHT)
    fast, fast_hits = distances(scan, scene, pose)
    plain_numpy()
    plain, plain_hits = distances(scan, scene, pose)
    assert fast == pytest.approx(plain, abs=1e-9, rel=0.0)
    assert fast_hits.tolist() == plain_hits.tolist()


class _OdeRays:
    """ODE's own rays against native geoms."""

    def __init__(self, meshes):
        self._space = ode.SimpleSpace()
        self._geoms = []
        for geometry, pose in meshes:
            make = native_shapes.height_geom if isinstance(geometry, Heightmap) else native_shapes.mesh_geom
            geom = make(geometry, self._space, "test")
            pyode_bodies.place_geom(geom, pose, ((0.0, 0.0, 0.0), UPRIGHT))
            self._geoms.append(geom)
        self._ray = ode.GeomRay(None, 1.0)

    def range(self, origin, direction, nearest, longest):
        start = tuple(o + nearest * d for o, d in zip(origin, direction))
        self._ray.set(start, direction)
        self._ray.setLength(longest - nearest)
        depths = [contact.getContactGeomParams()[2] for geom in self._geoms for contact in ode.collide(self._ray, geom)]
        return min([nearest + depth for depth in depths], default=longest)


@pytest.mark.parametrize("kind, tolerance", [("hills", 1e-9), ("soup", 2e-5)])
@pytest.mark.parametrize("seed", range(6))
def test_ranges_are_those_of_ode(kind, tolerance, seed):
    """ODE meets heightfields in double precision, but keeps distances to meshes in single."""
    draw, scene = random.Random(seed), RayScene()
    meshes = [(hills(draw, 6, 9) if kind == "hills" else soup(draw, 60),
               (tuple(draw.uniform(-2.0, 2.0) for _ in range(3)),
                quaternion_from_rpy(draw.gauss(0.0, 0.1), draw.gauss(0.0, 0.1), draw.uniform(-3.0, 3.0))))
              for _ in range(2)]
    for geometry, pose in meshes:
        scene.add(geometry, pose, "m")
    tilt = quaternion_from_rpy(draw.gauss(0.0, 0.3), draw.gauss(0.0, 0.3), draw.uniform(-3.0, 3.0))
    pose, scan = ((draw.uniform(-2.0, 2.0), draw.uniform(-2.0, 2.0), draw.uniform(2.0, 4.0)), tilt), RayScan(
        samples=300, min_angle=-3.0, max_angle=3.0, vertical_samples=3, vertical_min_angle=-0.8, vertical_max_angle=0.2,
        range_min=0.1, range_max=10.0)
    found, _ = distances(scan, scene, pose)
    rays = _OdeRays(meshes)
    expected = [rays.range(pose[0], ray, scan.range_min, scan.range_max) for ray in directions(scan, pose)]
    # a ray through the very rim may be a hit for one and none for the other
    apart = [index for index, (one, two) in enumerate(zip(found, expected)) if abs(one - two) > tolerance]
    assert len(apart) <= 1 and sum(value < 10.0 for value in expected) > 50


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (40.0, -3.0, 2.0)])
@pytest.mark.parametrize("pose", [((0.0, 0.0, 0.5), UPRIGHT), ((0.3, -0.2, 0.4), quaternion_from_rpy(0.02, -0.03, 1.0)),
                                  ((2.05, 0.1, 0.3), UPRIGHT)])
def test_a_box_of_triangles_is_the_box(offset, pose):
    scan = RayScan(samples=721, min_angle=-math.pi, max_angle=math.pi, range_min=0.1, range_max=30.0)
    ranges = []
    for shape, place in ((Box((1.0, 2.0, 1.5)), (2.0, 0.0, 0.5)),
                         (block((1.0, 2.0, 1.5), offset), (2.0 - offset[0], -offset[1], 0.5 - offset[2]))):
        scene = RayScene()
        scene.add(shape, (place, UPRIGHT), "a")
        ranges.append(distances(scan, scene, pose)[0])
    assert ranges[0] == pytest.approx(ranges[1], abs=1e-9, rel=0.0) and ranges[0].min() < 30.0


def test_no_beam_slips_through_an_edge_between_two_triangles():
    scene = RayScene()
    scene.add(block((1.0, 2.0, 2.0)), ((2.0, 0.0, 0.0), UPRIGHT), "a")     # the diagonal crosses the middle of the face
    for yaw in (0.0, 1e-13, -1e-13):
        pose = ((0.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, yaw))
        assert distances(RayScan(range_min=0.1, range_max=9.0, samples=1), scene, pose)[0] == pytest.approx([1.5])


def test_a_face_in_the_scan_plane_is_not_seen():
    scene = RayScene()
    scene.add(block((1.0, 1.0, 1.0)), ((2.0, 0.0, -0.5), UPRIGHT), "a")
    ranges, _ = distances(RayScan(range_min=0.1, range_max=9.0, samples=3, min_angle=-0.1, max_angle=0.1), scene,
                          ((0.0, 0.0, 0.0), UPRIGHT))
    assert np.all(np.isclose(ranges, 1.5 / np.cos([0.1, 0.0, 0.1])) | (ranges == 9.0))


def test_a_mesh_moves_with_its_row_and_goes_with_its_owner():
    scene, scan = RayScene(), RayScan(samples=1, range_min=0.1, range_max=9.0)
    shape = block((1.0, 1.0, 1.0), (0.0, 3.0, 0.0))
    row = scene.add(shape, ((2.0, -3.0, 0.0), UPRIGHT), "a")
    scene.add(shape, ((4.0, -3.0, 0.0), UPRIGHT), "b")
    here = ((0.0, 0.0, 0.0), UPRIGHT)
    assert distances(scan, scene, here)[0] == pytest.approx([1.5])
    assert len(scene.forest.pack().trees) == 1              # one tree for both
    scene.set_pose(row, (6.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, -0.5 * math.pi))
    assert distances(scan, scene, here)[0] == pytest.approx([3.5])
    scene.remove_owner("b")
    assert distances(scan, scene, here)[0] == pytest.approx([8.5])
    scene.add(block((0.2, 0.2, 0.2)), ((1.0, 0.0, 0.0), UPRIGHT), "c")
    assert distances(scan, scene, here)[0] == pytest.approx([0.9])
    scene.remove_owner("a")
    scene.remove_owner("c")
    assert not scene.forest and distances(scan, scene, here)[0] == [9.0]


def test_the_owner_to_be_looked_through_is():
    scene = RayScene()
    scene.add(block((1.0, 1.0, 1.0)), ((2.0, 0.0, 0.0), UPRIGHT), "me")
    sensor = LaserSensor(RayScan(samples=1, range_min=0.1, range_max=9.0), np.random.default_rng(0))
    assert sensor.cast(scene, ((0.0, 0.0, 0.0), UPRIGHT), ignore_owner="me")[0] == [math.inf]


@pytest.mark.parametrize("pose", [((math.nan, 0.0, 0.0), UPRIGHT), ((0.0, 0.0, 0.0), (math.nan,) * 4),
                                  ((math.inf, 0.0, 0.0), UPRIGHT)])
def test_a_pose_that_is_not_finite_hits_nothing(pose):
    scene = RayScene()
    scene.add(block((1.0, 1.0, 1.0)), ((2.0, 0.0, 0.0), UPRIGHT), "a")
    scan = RayScan(samples=50, min_angle=-1.0, max_angle=1.0, range_min=0.1, range_max=9.0)
    assert set(distances(scan, scene, pose)[0]) == {9.0}
    scene.set_pose(scene.rows_of("a")[0], pose[0], pose[1])
    assert set(distances(scan, scene, ((0.0, 0.0, 0.0), UPRIGHT))[0]) == {9.0}


def test_numbers_of_both_kernel_files_agree():
    for name in ("ORIENTATION", "RANGE_MIN", "RANGE_MAX", "ANGLE_MIN", "ANGLE_STEP", "IGNORED", "KIND", "OWNER", "TREE",
                 "MESH", "AZIMUTH_MARGIN"):
        assert getattr(mesh_kernels, name) == getattr(ray_kernels, name), name


def test_without_numba_the_kernels_are_plain_functions():
    code = ("import sys; sys.modules['numba'] = None\n"
            "import numpy as np\nfrom m2wr_sim.sensors import laser, mesh_kernels, ray_kernels\n"
            "from m2wr_sim.sensors.ray_scene import RayScene\nfrom m2wr_sim.model.types import Mesh, RayScan\n"
            "scene = RayScene()\n"
            "scene.add(Mesh(np.array([[2., -1, -1], [2, 1, -1], [2, 0, 1]]), np.array([[0, 1, 2]])), "
            "((0, 0, 0), (0, 0, 0, 1)), 'a')\n"
            "scan = RayScan(samples=9, min_angle=-1.0, max_angle=1.0, range_min=0.1, range_max=9.0)\n"
            "results = []\n"
            "for cast in (laser._cast_meshes, mesh_kernels.cast_meshes):\n"
            "    laser._cast_meshes = cast\n"
            "    results.append(laser.LaserSensor(scan, np.random.default_rng(0)).cast(\n"
            "        scene, ((0, 0, 0), (0, 0, 0, 1)))[0])\n"
            "assert np.array_equal(*results) and results[0][4] == 2.0, results\n")
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120.0, env=dict(
        os.environ, PYTHONPATH=os.pathsep.join(path for path in sys.path if path)))
