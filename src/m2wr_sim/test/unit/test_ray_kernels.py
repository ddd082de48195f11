# SPDX-License-Identifier: BSD-3-Clause
"""The ray kernels against slow twins: surfaces one by one, ODE's own rays, closed forms."""
import math
import subprocess
import sys

import numpy as np
import pytest

from m2wr_sim.geometry import matrix_from_quaternion, quaternion_from_rpy, rotate
from m2wr_sim.model.types import Box, Cylinder, Plane, Sphere
from m2wr_sim.sensors import ray_kernels as kernels
from m2wr_sim.sensors.ray_scene import RayScene
from m2wr_sim.sensors.rays_numpy import cast_rays_numpy

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
FANS = {
    "half_circle": (np.linspace(-math.pi / 2, math.pi / 2, 181), [0.0]),
    "full_circle": (np.linspace(0.0, 2 * math.pi, 360), [0.0]),
    "across_pi": (np.linspace(2.0, 5.0, 97), [0.0]),
    "turned_back": (np.linspace(math.pi, -math.pi, 211), [0.0]),
    "three_turns": (np.linspace(-9.0, 9.0, 301), [0.0]),
    "shifted_by_turns": (np.linspace(30.0, 33.0, 97), [0.0]),
    "few": (np.linspace(-1.0, 1.0, 5), [0.0]),
    "one": (np.zeros(1), [0.0]),
    "all_the_same": (np.full(20, 0.3), [0.0]),
    "rows": (np.linspace(-math.pi, math.pi, 90), np.linspace(-0.6, 0.7, 7)),
    "over_the_top": (np.linspace(-2.0, 2.0, 41), [-math.pi / 2, 0.4, math.pi / 2, 2.5]),
}


def cast(scene, position, orientation, fan, range_min=0.1, range_max=10.0, kernel=kernels.cast_rays, ignored=-1):
    """Return the ranges (V * N,), infinite where nothing is hit, and the rows hit."""
    azimuths, elevations = fan
    beams = np.array([np.cos(azimuths), np.sin(azimuths)])
    rows = np.ascontiguousarray(np.array([np.cos(elevations), np.sin(elevations)]).T)
    frame = np.zeros(kernels.FRAME_SIZE)
    frame[:3], frame[3:7] = position, orientation
    step = (azimuths[-1] - azimuths[0]) / (len(azimuths) - 1) if len(azimuths) > 1 else 0.0
    frame[7:13] = (range_min, range_max, azimuths[0], step, scene.count, ignored)
    results = []
    for size in (0, beams.shape[1] * rows.shape[0]):
        ranges, hits = np.empty(beams.shape[1] * rows.shape[0]), np.empty(size, np.int64)
        kernel(ranges, hits, beams, rows, frame, scene.spheres, scene.shapes, scene.order, np.empty(0, np.int32))
        ranges[ranges >= range_max] = np.inf
        results.append(ranges)
    np.testing.assert_allclose(results[0], results[1], rtol=0.0, atol=1e-12)     # asking for hits changes nothing
    return results[0], hits


def directions(orientation, fan):
    """Return the world directions (V * N, 3) of a fan's rays."""
    return np.array([rotate(orientation, (math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)))
                     for e in fan[1] for a in fan[0]])


def crossings(geometry, origin, ray):
    """Yield every t at which the line origin + t ray, in the shape's axes, crosses the shape's surface."""
    if isinstance(geometry, Box):
        half = 0.5 * np.array(geometry.size)
        for axis in range(3):
            for side in (-half[axis], half[axis]):
                if ray[axis] != 0.0:
                    t = (side - origin[axis]) / ray[axis]
                    others = [k for k in range(3) if k != axis]
                    if all(abs(origin[k] + t * ray[k]) <= half[k] for k in others):
                        yield t
        return
    axes = slice(0, 2 if isinstance(geometry, Cylinder) else 3)
    o, d = origin[axes], ray[axes]
    a, b, c = d @ d, o @ d, o @ o - geometry.radius ** 2
    if a > 0.0 and b * b >= a * c:
        for sign in (-1.0, 1.0):
            t = (-b + sign * math.sqrt(b * b - a * c)) / a
            if isinstance(geometry, Sphere) or abs(origin[2] + t * ray[2]) <= 0.5 * geometry.length:
                yield t
    if isinstance(geometry, Cylinder) and ray[2] != 0.0:
        for side in (-0.5, 0.5):
            t = (side * geometry.length - origin[2]) / ray[2]
            if np.hypot(*(origin + t * ray)[:2]) <= geometry.radius:
                yield t


def plain_cast(shapes, position, orientation, fan, range_min=0.1, range_max=10.0):
    """The slow twin: the least surface crossing of any shape beyond the shortest range."""
    answer = []
    for ray in directions(orientation, fan):
        best = np.inf
        for geometry, pose in shapes:
            if isinstance(geometry, Plane):
                normal = np.array(geometry.normal) / np.linalg.norm(geometry.normal)
                slope = normal @ ray
                found = [normal @ (np.array(pose[0]) - position) / slope] if slope else []
            else:
                turn = matrix_from_quaternion(pose[1])
                found = crossings(geometry, turn.T @ (np.array(position) - pose[0]), turn.T @ ray)
            best = min([best] + [t for t in found if t > range_min])
        answer.append(best if best < range_max else np.inf)
    return np.array(answer)


def random_shapes(rng, count, tilt, side=6.0):
    """Return (geometry, pose) pairs; some lie around the origin, a few are long walls."""
    shapes = [(Plane((0.1, 0.0, 1.0)), ((0.0, 0.0, -0.7), UPRIGHT))]
    for k in range(count):
        size = rng.uniform(0.02, 1.2, 3)
        geometry = (Box(tuple(size)), Cylinder(size[0], 2 * size[1]), Sphere(size[0]),
                    Box((9.0, size[1], size[2])))[k % 4]
        pose = (tuple(rng.uniform(-side, side, 2)) + (rng.uniform(-0.6, 0.6),),
                quaternion_from_rpy(*(rng.uniform(-tilt, tilt, 2)), rng.uniform(-math.pi, math.pi)))
        shapes.append((geometry, pose))
    return shapes


def build(shapes):
    """Return the scene of (geometry, pose) pairs, each its own owner."""
    scene = RayScene(2)
    for k, (geometry, pose) in enumerate(shapes):
        assert scene.add(geometry, pose, k) == k
    return scene


def assert_same_ranges(found, expected):
    np.testing.assert_array_equal(np.isinf(found), np.isinf(expected))
    seen = np.isfinite(expected)
    np.testing.assert_allclose(found[seen], expected[seen], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", sorted(FANS))
@pytest.mark.parametrize("tilt", [0.0, 1e-6, 0.05, 3.0])
def test_random_scenes_match_the_plain_twin(name, tilt):
    rng = np.random.default_rng([len(name), int(tilt * 1e7)])
    for trial in range(2):
        shapes = random_shapes(rng, 14, tilt, side=rng.choice([1.0, 6.0]))
        position = rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 0.4)
        orientation = quaternion_from_rpy(*(rng.uniform(-tilt, tilt, 2)), rng.uniform(-math.pi, math.pi))
        range_min = rng.choice([0.0, 0.1, 1.0])
        expected = plain_cast(shapes, position, orientation, FANS[name], range_min)
        for kernel in (kernels.cast_rays, cast_rays_numpy):
            found, _ = cast(build(shapes), position, orientation, FANS[name], range_min, kernel=kernel)
            assert_same_ranges(found, expected)


@pytest.mark.parametrize("name", sorted(FANS))
@pytest.mark.parametrize("tilt", [0.0, 0.03, 3.0])
def test_hidden_shapes_among_many_are_left_out(name, tilt):
    rng = np.random.default_rng(len(name))
    scene = build(random_shapes(rng, 4 * kernels.MANY, tilt))
    for _ in range(4):
        place = tuple(rng.uniform(-5.0, 5.0, 2)) + (rng.uniform(-0.4, 0.4),)
        turn = quaternion_from_rpy(*rng.uniform(-tilt, tilt, 2), rng.uniform(-math.pi, math.pi))
        found, hits = cast(scene, place, turn, FANS[name])
        expected, rows = cast(scene, place, turn, FANS[name], kernel=cast_rays_numpy)
        assert_same_ranges(found, expected)
        np.testing.assert_array_equal(hits, rows)


@pytest.mark.parametrize("name", sorted(FANS))
@pytest.mark.parametrize("tilt", [0.003, 0.03, 0.3])
def test_tilted_beams_meet_thin_layers(name, tilt):
    """Some are above or below all beams, some within their height, some are crossed."""
    rng = np.random.default_rng([len(name), int(tilt * 1e3)])
    for trial in range(2):
        shapes = []
        for k in range(16):
            wide, thin = rng.uniform(0.3, 4.0, 2), rng.choice([0.02, 0.1, 0.6])
            geometry = Box((wide[0], wide[1], thin)) if k % 2 else Cylinder(0.5 * wide[0], thin)
            at = tuple(rng.uniform(-7.0, 7.0, 2)) + (rng.uniform(-0.4, 0.4),)
            shapes.append((geometry, (at, quaternion_from_rpy(0.0, rng.choice([0.0, 0.01]), rng.uniform(-3.0, 3.0)))))
        turn = quaternion_from_rpy(*rng.uniform(-tilt, tilt, 2), rng.uniform(-math.pi, math.pi))
        found, hits = cast(build(shapes), (0.0, 0.0, 0.0), turn, FANS[name])
        assert_same_ranges(found, plain_cast(shapes, (0.0, 0.0, 0.0), turn, FANS[name], 0.1))
        _, rows = cast(build(shapes), (0.0, 0.0, 0.0), turn, FANS[name], kernel=cast_rays_numpy)
        np.testing.assert_array_equal(hits, rows)


@pytest.mark.parametrize("tilt", [0.0, 0.02, 3.0])
def test_rays_match_those_of_ode(tilt):
    ode = pytest.importorskip("ode")
    rng, fan, range_min, range_max = np.random.default_rng(5), FANS["rows"], 0.15, 8.0
    for trial in range(3):
        shapes = random_shapes(rng, 24, tilt)
        position = rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 0.4)
        orientation = quaternion_from_rpy(*(rng.uniform(-tilt, tilt, 2)), rng.uniform(-math.pi, math.pi))
        geoms = []
        for geometry, (place, turn) in shapes:
            if isinstance(geometry, Plane):
                normal = np.array(geometry.normal) / np.linalg.norm(geometry.normal)
                geoms.append(ode.GeomPlane(None, tuple(normal), normal @ place))
                continue
            geoms.append(ode.GeomBox(None, geometry.size) if isinstance(geometry, Box) else
                         ode.GeomSphere(None, geometry.radius) if isinstance(geometry, Sphere) else
                         ode.GeomCylinder(None, geometry.radius, geometry.length))
            geoms[-1].setPosition(place)
            geoms[-1].setQuaternion((turn[3],) + tuple(turn[:3]))
        ray, expected = ode.GeomRay(None, range_max - range_min), []
        for direction in directions(orientation, fan):
            ray.set(tuple(position + range_min * direction), tuple(direction))
            depths = [contact.getContactGeomParams()[2] for geom in geoms for contact in ode.collide(ray, geom)]
            expected.append(range_min + min(depths) if depths else np.inf)
        found, _ = cast(build(shapes), position, orientation, fan, range_min, range_max)
        assert 0.2 < np.isfinite(expected).mean()
        assert_same_ranges(found, np.array(expected))


@pytest.mark.parametrize("geometry", [Box((0.1, 0.1, 0.6)), Cylinder(0.05, 0.6)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_beams_just_clear_of_an_edge_pass(geometry, side):
    scene, fan = build([(geometry, ((8.0, 0, 0), UPRIGHT))]), (np.linspace(-0.5, 0.5, 11), [0.0])
    edge = math.atan(0.3 / 7.95)
    for pitch, seen in ((edge - 1e-6, True), (edge + 1e-6, False)):
        ranges, _ = cast(scene, (0, 0, 0), quaternion_from_rpy(0, side * pitch, 0), fan)
        assert np.isfinite(ranges).tolist() == 5 * [False] + [seen] + 5 * [False]


def test_order_of_shapes_does_not_matter():
    rng = np.random.default_rng(11)
    shapes = random_shapes(rng, 60, 0.3)
    first, hits = cast(build(shapes), (0, 0, 0.1), UPRIGHT, FANS["rows"])
    order = rng.permutation(len(shapes))
    second, shuffled_hits = cast(build([shapes[k] for k in order]), (0, 0, 0.1), UPRIGHT, FANS["rows"])
    assert_same_ranges(second, first)
    np.testing.assert_array_equal(np.where(shuffled_hits >= 0, order[shuffled_hits], -1), hits)


@pytest.mark.parametrize("kernel", [kernels.cast_rays, cast_rays_numpy], ids=["kernel", "numpy"])
def test_hits_name_the_shape_that_gives_the_range(kernel):
    shapes = random_shapes(np.random.default_rng(12), 20, 0.3)
    ranges, hits = cast(build(shapes), (0, 0, 0.1), UPRIGHT, FANS["rows"], kernel=kernel)
    np.testing.assert_array_equal(hits == -1, np.isinf(ranges))
    alone = [cast(build([shape]), (0, 0, 0.1), UPRIGHT, FANS["rows"], kernel=kernel)[0] for shape in shapes]
    for i in np.flatnonzero(hits >= 0):
        assert alone[hits[i]][i] == pytest.approx(ranges[i], abs=1e-12)
    assert len(set(hits)) > 5


@pytest.mark.parametrize("geometry", [Box((2.0, 4.0, 6.0)), Cylinder(1.0, 6.0), Sphere(1.0)])
def test_from_inside_the_far_surface_is_seen(geometry):
    scene, fan = build([(geometry, ((0, 0, 0), UPRIGHT))]), FANS["one"]
    assert cast(scene, (0.25, 0, 0), UPRIGHT, fan)[0][0] == pytest.approx(0.75)
    assert cast(scene, (-1.05, 0, 0), UPRIGHT, fan)[0][0] == pytest.approx(2.05)


def test_what_lies_within_the_shortest_range_is_looked_through():
    shapes = [(Sphere(0.02), ((0.05, 0, 0), UPRIGHT)), (Box((0.02, 1.0, 1.0)), ((0.08, 0, 0), UPRIGHT))]
    assert np.isinf(cast(build(shapes), (0, 0, 0), UPRIGHT, FANS["one"])[0][0])
    shapes.append((Sphere(1.0), ((3.0, 0, 0), UPRIGHT)))
    assert cast(build(shapes), (0, 0, 0), UPRIGHT, FANS["one"])[0][0] == pytest.approx(2.0)


def test_surfaces_at_start_and_end_of_a_ray_are_not_seen():
    box = Box((1.0, 1.0, 1.0))
    assert cast(build([(box, ((0.5, 0, 0), UPRIGHT))]), (0, 0, 0), UPRIGHT, FANS["one"], range_min=0.0)[0][0] == 1.0
    assert np.isinf(cast(build([(box, ((10.5, 0, 0), UPRIGHT))]), (0, 0, 0), UPRIGHT, FANS["one"])[0][0])
    assert cast(build([(box, ((10.4, 0, 0), UPRIGHT))]), (0, 0, 0), UPRIGHT, FANS["one"])[0][0] == pytest.approx(9.9)


@pytest.mark.parametrize("kernel", [kernels.cast_rays, cast_rays_numpy], ids=["kernel", "numpy"])
def test_rays_along_an_axis_pass_beside_what_is_beside(kernel):
    beside = [(Box((1.0, 1.0, 1.0)), ((3.0, 0.6, 0), UPRIGHT)), (Cylinder(0.5, 1.0), ((3.0, 0.6, 0), UPRIGHT)),
              (Cylinder(0.5, 1.0), ((3.0, 0.6, 0), quaternion_from_rpy(0, math.pi / 2, 0))),
              (Sphere(0.5), ((3.0, -0.6, 0), UPRIGHT)), (Plane(), ((0, 0, -0.2), UPRIGHT)),
              (Plane(), ((0, 0, 0), UPRIGHT))]
    assert np.isinf(cast(build(beside), (0, 0, 0), UPRIGHT, FANS["one"], kernel=kernel)[0][0])
    ahead = (Cylinder(0.5, 1.0), ((3.0, 0.2, 0), quaternion_from_rpy(0, math.pi / 2, 0)))
    assert cast(build(beside + [ahead]), (0, 0, 0), UPRIGHT, FANS["one"], kernel=kernel)[0][0] == pytest.approx(2.5)


def test_plane_is_seen_from_both_sides_at_its_slant_range():
    ground, down = build([(Plane((0, 0, 2.0)), ((5, 5, -1.0), UPRIGHT))]), (np.zeros(1), [-0.5])
    assert cast(ground, (0, 0, 0), UPRIGHT, down)[0][0] == pytest.approx(1.0 / math.sin(0.5))
    assert cast(ground, (0, 0, -2), UPRIGHT, (np.zeros(1), [0.5]))[0][0] == pytest.approx(1.0 / math.sin(0.5))
    assert np.isinf(cast(ground, (0, 0, -2), UPRIGHT, down)[0][0])


@pytest.mark.parametrize("geometry", [Box((0.0, 0.0, 0.0)), Box((0.0, 1.0, 1.0)), Cylinder(0.0, 1.0),
                                      Cylinder(0.5, 0.0), Sphere(0.0)])
def test_shapes_without_extent_do_no_harm(geometry):
    shapes = [(geometry, ((1.0, 0.01, 0), UPRIGHT)), (Sphere(1.0), ((4.0, 0, 0), UPRIGHT))]
    for place in ((0, 0, 0), (1.0, 0.01, 0)):
        ranges, _ = cast(build(shapes), place, UPRIGHT, FANS["full_circle"])
        assert not np.isnan(ranges).any() and (ranges > 0.1).all()
        assert ranges[0] <= 4.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("where", range(7))
@pytest.mark.parametrize("kernel", [kernels.cast_rays, cast_rays_numpy], ids=["kernel", "numpy"])
def test_poses_that_are_not_finite_hit_nothing(bad, where, kernel):
    shapes = random_shapes(np.random.default_rng(3), 12, 0.3, side=2.0)
    good = cast(build(shapes), (0, 0, 0.1), UPRIGHT, FANS["rows"], kernel=kernel)[0]
    pose = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]
    pose[where] = bad
    for geometry in (Box((1.0, 2.0, 3.0)), Cylinder(0.3, 1.0)):
        scene = build(shapes + [(geometry, (tuple(pose[:3]), tuple(pose[3:])))])
        assert_same_ranges(cast(scene, (0, 0, 0.1), UPRIGHT, FANS["rows"], kernel=kernel)[0], good)
    for longest in (10.0, math.inf):
        ranges, hits = cast(build(shapes), pose[:3], pose[3:], FANS["rows"], range_max=longest, kernel=kernel)
        assert np.isinf(ranges).all() and (hits == -1).all()


def test_endless_range_sees_far_things():
    scene = build([(Box((1.0, 1.0, 1.0)), ((1e6, 0, 0), UPRIGHT))])
    assert cast(scene, (0, 0, 0), UPRIGHT, FANS["one"], range_max=math.inf)[0][0] == pytest.approx(1e6 - 0.5)


@pytest.mark.parametrize("kernel", [kernels.cast_rays, cast_rays_numpy], ids=["kernel", "numpy"])
def test_ignored_owner_is_looked_through(kernel):
    scene = build([(Sphere(0.5), ((2.0, 0, 0), UPRIGHT)), (Sphere(0.5), ((4.0, 0, 0), UPRIGHT))])
    args = (scene, (0, 0, 0), UPRIGHT, FANS["one"])
    assert cast(*args, kernel=kernel)[0][0] == pytest.approx(1.5)
    assert cast(*args, kernel=kernel, ignored=scene.owner_id(0))[0][0] == pytest.approx(3.5)


@pytest.mark.parametrize("samples", [2, 181, 640, 720, 1081])
def test_half_a_turn_of_beams_looks_at_nothing_behind(samples):
    least, most = -0.5 * math.pi, 0.5 * math.pi
    step = (most - least) / (samples - 1)           # of which so many make half a turn only nearly
    beams = np.array([np.cos(least + step * np.arange(samples)), np.sin(least + step * np.arange(samples))])
    at = [(2.0, 0.0), (-2.0, 0.0), (-0.51, 3.0), (-0.49, -3.0), (1.0, 8.0), (-1.0, -8.0)]
    scene = build([(Sphere(0.5), ((x, y, 0.0), UPRIGHT)) for x, y in at])
    frame = np.zeros(kernels.FRAME_SIZE)
    frame[6], frame[7:13] = 1.0, (0.1, 10.0, least, step, scene.count, -1)
    order = np.empty((2, scene.capacity), np.int32)
    found = kernels.cast_rays(np.empty(samples), np.empty(0, np.int64), beams, np.array([[1.0, 0.0]]), frame,
                              scene.spheres, scene.shapes, order, np.empty(0, np.int32))
    assert sorted(order[0, :found]) == [0, 3, 4]


def test_azimuth_is_nearer_than_its_margin():
    angles = np.linspace(-math.pi, math.pi, 20011)[1:-1]
    errors = [abs(kernels.azimuth(math.sin(a), math.cos(a)) - a) for a in angles]
    assert kernels.azimuth(0.0, 0.0) == 0.0 and math.isnan(kernels.azimuth(math.nan, math.nan))
    slopes = [abs(kernels.atan(math.tan(a / 2)) - a / 2) for a in angles]
    assert max(errors) + max(slopes) < 0.5 * kernels.AZIMUTH_MARGIN


def test_long_walls_close_by_lose_no_beam():
    rng, fan = np.random.default_rng(8), (np.linspace(-math.pi, math.pi, 720), [0.0])
    for _ in range(10):
        yaw = rng.uniform(-math.pi, math.pi)
        pose = (rotate((0, 0, math.sin(yaw / 2), math.cos(yaw / 2)), (rng.uniform(-5, 5), rng.uniform(0.11, 0.3), 0.0)),
                quaternion_from_rpy(0.0, 0.0, yaw))
        shapes = [(Box((12.0, 0.2, 1.0)), pose)]
        assert_same_ranges(cast(build(shapes), (0, 0, 0), UPRIGHT, fan)[0], plain_cast(shapes, (0, 0, 0), UPRIGHT, fan))


@pytest.mark.parametrize("hide", ["sys.modules['numba'] = None", "os.environ['NUMBA_DISABLE_JIT'] = '1'"],
                         ids=["no_numba", "jit_disabled"])
def test_works_without_compiling(hide):
    program = ("import os, sys\n%s\nimport numpy as np\n"
               "from m2wr_sim.model.types import Box, Noise, RayScan\n"
               "from m2wr_sim.sensors.laser import LaserSensor\nfrom m2wr_sim.sensors.ray_scene import RayScene\n"
               "scene = RayScene(1)\nscene.add(Box((1.0, 1.0, 1.0)), ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), 'box')\n"
               "ray = RayScan(samples=21, min_angle=-1.0, max_angle=1.0, range_max=9.0)\n"
               "laser = LaserSensor(ray, np.random.default_rng(0))\n"
               "print(laser.cast(scene, ((0, 0, 0), (0, 0, 0, 1)))[0][10])\n" % hide)
    done = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=120, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "0.5"), done.stderr
