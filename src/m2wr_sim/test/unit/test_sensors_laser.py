# SPDX-License-Identifier: BSD-3-Clause
"""The laser sensor: ranges and intensities in known worlds, by Gazebo's rules."""
import math

import numpy as np
import pytest

from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Box, Cylinder, Noise, Plane, RayScan, Sphere
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.sensors import laser as laser_module
from m2wr_sim.sensors import packed_kernels
from m2wr_sim.sensors.laser import LaserSensor, warm_up
from m2wr_sim.sensors.ray_scene import RayScene

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
ORIGIN = ((0.0, 0.0, 0.0), UPRIGHT)
M2WR = dict(samples=720, min_angle=-1.570796, max_angle=1.570796, range_min=0.1, range_max=10.0)


def laser(seed=1, **changes):
    return LaserSensor(RayScan(**dict(M2WR, **changes)), np.random.default_rng(seed))


def world(*shapes):
    """Return a scene of (geometry, (x, y, z)) or (geometry, (x, y, z), retro)."""
    scene = RayScene(4)
    for k, (geometry, position, *retro) in enumerate(shapes):
        scene.add(geometry, (position, UPRIGHT), k, *retro)
    return scene


WALL = (Box((0.2, 100.0, 10.0)), (2.1, 0.0, 0.0))
UNIT_BOX = (Box((1.0, 1.0, 1.0)), (1.0, 0.0, 0.0))


def test_empty_world_reads_infinity_everywhere():
    ranges, intensities = laser().cast(RayScene(1), ORIGIN)
    assert ranges.dtype == intensities.dtype == np.float32 and ranges.shape == intensities.shape == (720,)
    assert (ranges == np.inf).all() and (intensities == 0.0).all()


def test_unit_box_one_metre_ahead_reads_half_a_metre():
    ranges, _ = laser(samples=641, min_angle=-2.0, max_angle=2.0).cast(world(UNIT_BOX), ORIGIN)
    assert ranges[320] == 0.5 and ranges[0] == ranges[-1] == np.inf


def test_removed_box_reads_infinity():
    scene, sensor = world(UNIT_BOX), laser()
    assert np.isfinite(sensor.cast(scene, ORIGIN)[0]).any()
    scene.remove_owner(0)
    assert (sensor.cast(scene, ORIGIN)[0] == np.inf).all()


def test_wall_reads_its_distance_over_the_cosine():
    sensor = laser()
    ranges, _ = sensor.cast(world(WALL), ORIGIN)
    expected = 2.0 / np.cos(sensor.angles)
    np.testing.assert_allclose(ranges[expected < 9.99], expected[expected < 9.99], rtol=1e-6)
    assert (ranges[expected > 10.01] == np.inf).all()


def test_turned_sensor_sees_the_wall_at_the_turned_beam():
    sensor = laser(samples=721)
    ranges, _ = sensor.cast(world(WALL), ((0.0, 0.0, 0.0), quaternion_from_rpy(0.0, 0.0, 0.5)))
    assert abs(sensor.angles[np.argmin(ranges)] + 0.5) <= sensor.angle_increment
    assert ranges.min() == pytest.approx(2.0, abs=1e-4)


def test_mirrored_world_gives_the_mirrored_scan():
    rng, left, right = np.random.default_rng(2), RayScene(64), RayScene(64)
    for k in range(40):
        x, y, yaw = rng.uniform(-8, 8), rng.uniform(-8, 8), rng.uniform(-3, 3)
        size = rng.uniform(0.1, 1.0, 3)
        shape = (Box(tuple(2.0 * size)), Cylinder(size[0], 1.0), Sphere(size[0]))[k % 3]
        left.add(shape, ((x, y, 0.0), quaternion_from_rpy(0, 0, yaw)), k)
        right.add(shape, ((x, -y, 0.0), quaternion_from_rpy(0, 0, -yaw)), k)
    ahead = laser().cast(left, ORIGIN)[0]
    np.testing.assert_allclose(laser().cast(right, ORIGIN)[0][::-1], ahead, rtol=1e-6)
    assert 0.2 < np.isfinite(ahead).mean()


def test_fields_of_the_reports_sensor():
    sensor = laser()
    assert (sensor.angle_min, sensor.angle_max, sensor.range_min, sensor.range_max) == (-1.570796, 1.570796, 0.1, 10.0)
    assert sensor.angle_increment == pytest.approx(3.141592 / 719, rel=1e-12) and sensor.count == 720
    assert sensor.angles[0] == -1.570796 and sensor.angles[-1] == pytest.approx(1.570796, rel=1e-15)


def test_single_sample_looks_straight_ahead_whatever_its_limits():
    sensor = laser(samples=1, min_angle=0.5, max_angle=1.0)
    assert sensor.cast(world(UNIT_BOX), ORIGIN)[0].tolist() == [0.5]
    assert sensor.angle_increment == math.inf
    assert math.isnan(laser(samples=1, min_angle=0.0, max_angle=0.0).angle_increment)


def test_vertical_rays_run_from_low_to_high_row_after_row():
    sensor = laser(samples=3, min_angle=-0.1, max_angle=0.1, vertical_samples=3, vertical_min_angle=-0.4,
                   vertical_max_angle=0.2)
    grid = sensor.cast(world((Plane(), (0.0, 0.0, -1.0))), ORIGIN)[0].reshape(3, 3)
    np.testing.assert_allclose(grid[0], 1.0 / math.sin(0.4), rtol=1e-6)
    assert (grid[1] == np.inf).all()            # 0.1 rad down meets the ground beyond 10 m
    assert (grid[2] == np.inf).all()
    assert np.isfinite(sensor.cast(world((Plane(), (0.0, 0.0, -0.5))), ORIGIN)[0]).tolist() == 6 * [True] + 3 * [False]


def test_single_vertical_sample_looks_level():
    sensor = laser(samples=5, vertical_min_angle=-0.5, vertical_max_angle=-0.5)
    assert (sensor.cast(world((Plane(), (0.0, 0.0, -1.0))), ORIGIN)[0] == np.inf).all()


def test_pitched_sensor_hits_the_ground_ahead():
    ranges, _ = laser(samples=721).cast(world((Plane(), (0.0, 0.0, 0.0))),
                                        ((0.0, 0.0, 0.3), quaternion_from_rpy(0.0, 0.1, 0.0)))
    assert ranges[360] == pytest.approx(0.3 / math.sin(0.1), rel=1e-6) and ranges[0] == np.inf


def test_own_housing_is_seen_only_beyond_the_minimum_range():
    scene = world((Cylinder(0.05, 0.1), (0.0, 0.0, 0.0)))
    np.testing.assert_allclose(laser(range_min=0.01).cast(scene, ORIGIN)[0], 0.05, rtol=1e-6)
    assert (laser().cast(scene, ORIGIN)[0] == np.inf).all()


def test_intensity_is_the_retro_of_what_is_hit_and_goes_with_it():
    scene = world((Sphere(0.5), (2.0, 0.0, 0.0), 7.5), (Box((1.0, 1.0, 1.0)), (0.0, 2.0, 0.0), 3.0),
                  (Sphere(0.5), (0.0, -2.0, 0.0)))
    sensor = laser(samples=3)
    assert sensor.cast(scene, ORIGIN)[1].tolist() == [0.0, 7.5, 3.0]
    scene.remove_owner(0)
    assert sensor.cast(scene, ORIGIN)[1].tolist() == [0.0, 0.0, 3.0]
    scene.remove_owner(1)
    assert sensor.cast(scene, ORIGIN)[1].tolist() == [0.0, 0.0, 0.0]


def test_resolution_blends_rays_and_makes_a_phantom_at_an_edge():
    near = (Box((0.2, 10.0, 1.0)), (2.1, -5.0, 0.0), 8.0)           # ends at y = 0; left of it nothing
    sensor = laser(samples=2, resolution=1.5, min_angle=-0.5, max_angle=0.5)
    ranges, intensities = sensor.cast(world(near), ORIGIN)
    hit = 2.0 / math.cos(0.5)
    assert sensor.count == 3 and sensor.angle_increment == 0.5 and sensor.angles.tolist() == [-0.5, 0.0, 0.5]
    assert ranges[0] == pytest.approx(hit, rel=1e-6) and ranges[2] == np.inf
    assert ranges[1] == pytest.approx(0.5 * (hit + 10.0), rel=1e-6)
    assert intensities.tolist() == [4.0, 4.0, 0.0]


def test_resolution_blends_rows_as_well():
    near = (Box((0.2, 10.0, 10.0)), (2.1, -5.0, 0.0))
    sensor = laser(samples=2, resolution=1.5, min_angle=-0.5, max_angle=0.5, vertical_samples=2,
                   vertical_resolution=2.5, vertical_min_angle=0.0, vertical_max_angle=0.4)
    low, high = 2.0 / math.cos(0.5), 2.0 / math.cos(0.5) / math.cos(0.4)
    grid = sensor.cast(world(near), ORIGIN)[0].reshape(5, 3)
    for j, row in enumerate(grid):
        hit = low + 0.25 * j * (high - low)
        np.testing.assert_allclose(row, (hit, 0.5 * (hit + 10.0), np.inf), rtol=1e-6)


@pytest.mark.parametrize("name, value", [("max_angle", 1e308), ("min_angle", -2e4), ("vertical_max_angle", math.inf),
                                         ("vertical_min_angle", math.nan)])
def test_an_angle_that_a_message_cannot_hold_is_refused(name, value):
    with pytest.raises(ValueError, match="%s .*: expected a number of at most 10000 rad" % name):
        laser(samples=30, **{name: value})


def test_resolution_below_one_gives_fewer_readings():
    sensor = laser(samples=720, resolution=0.5, vertical_samples=4, vertical_resolution=2.0, vertical_min_angle=-0.1,
                   vertical_max_angle=0.1)
    ranges, _ = sensor.cast(world(UNIT_BOX), ORIGIN)
    assert (sensor.count, sensor.vertical_count) == (360, 8) and ranges.shape == (2880,)
    assert (ranges.reshape(8, 360)[:, :80] == np.inf).all() and np.isfinite(ranges).any()


def test_noise_has_the_given_mean_and_deviation():
    sensor, scene = laser(noise=Noise("gaussian", 0.03, 0.02)), world(WALL)
    clean, _ = laser().cast(scene, ORIGIN)
    clean = clean.astype(float)
    middle = (clean < 5.0)
    errors = np.concatenate([sensor.cast(scene, ORIGIN)[0][middle] - clean[middle] for _ in range(200)])
    assert errors.mean() == pytest.approx(0.03, abs=5e-4) and errors.std() == pytest.approx(0.02, rel=0.02)
    assert (sensor.cast(scene, ORIGIN)[0][np.isinf(clean)] == np.inf).all()


def test_noisy_values_stay_within_the_limits():
    shapes = [(Box((0.2, 0.5, 1.0)), (x, y, 0.0)) for x, y in ((0.25, 0.0), (10.05, 0.0), (0.0, 9.9), (0.2, 0.6))]
    sensor, seen = laser(noise=Noise("gaussian", 0.0, 1.0)), []
    for _ in range(50):
        ranges = sensor.cast(world(*shapes), ORIGIN)[0].copy()
        assert not np.isnan(ranges).any() and (ranges >= np.float32(0.1)).all()
        finite = ranges[np.isfinite(ranges)]
        assert (finite <= np.float32(10.0)).all()
        seen.append(finite)
    seen = np.concatenate(seen)
    assert (seen == np.float32(0.1)).any() and (seen == np.float32(10.0)).any()


def test_bias_shifts_every_hit_alike():
    sensor, scene = laser(noise=Noise("gaussian", 0.0, 0.0, 0.2, 0.0)), world(WALL)
    clean = laser().cast(scene, ORIGIN)[0]
    near = clean < 9.0
    errors = sensor.cast(scene, ORIGIN)[0][near] - clean[near]
    assert np.ptp(errors) < 1e-5 and abs(errors.mean()) == pytest.approx(0.2, rel=1e-5)


@pytest.mark.parametrize("kind", ["gaussian", "gaussian_quantized"])
def test_precision_rounds_to_its_multiples(kind):
    ranges, _ = laser(noise=Noise(kind, 0.0, 0.02, precision=0.25)).cast(world(WALL), ORIGIN)
    finite = ranges[np.isfinite(ranges)].astype(float)
    np.testing.assert_array_equal(finite, np.round(finite / 0.25) * 0.25)
    assert len(set(finite)) > 5


def test_same_seed_same_bytes_and_reset_starts_again():
    noise, scene = Noise("gaussian", 0.0, 0.01), world(WALL)

    def scans(sensor):
        return [sensor.cast(scene, ORIGIN)[0].tobytes() for _ in range(5)]
    sensor = laser(3, noise=noise)
    first = scans(sensor)
    assert len(set(first)) == 5 and scans(laser(3, noise=noise)) == first
    assert not set(first) & set(scans(laser(4, noise=noise)))
    sensor.reset(np.random.default_rng(3))
    assert scans(sensor) == first


def test_pose_that_is_not_finite_reads_infinity():
    for bad in (((math.nan, 0, 0), UPRIGHT), ((0, 0, 0), (math.nan, 0, 0, 1)), ((math.inf, 0, 0), UPRIGHT)):
        assert (laser().cast(world(WALL, UNIT_BOX), bad)[0] == np.inf).all()


def test_range_limits_of_nothing_read_infinity():
    assert (laser(range_min=0.0, range_max=0.0).cast(world(UNIT_BOX), ORIGIN)[0] == np.inf).all()
    assert (laser(range_min=5.0, range_max=1.0).cast(world(UNIT_BOX), ORIGIN)[0] == np.inf).all()


def test_large_scans_work():
    sensor = laser(samples=2000, vertical_samples=100, vertical_min_angle=-0.5, vertical_max_angle=0.5,
                   noise=Noise("gaussian", 0.0, 0.01))
    assert np.isfinite(sensor.cast(world(UNIT_BOX), ORIGIN)[0]).sum() > 1000


def test_scene_may_grow_between_scans():
    sensor, scene = laser(samples=1), RayScene(1)
    for k in range(10):
        scene.add(Sphere(0.5), ((9.0 - 0.5 * k, 0.0, 0.0), UPRIGHT), k)
        assert sensor.cast(scene, ORIGIN)[0][0] == pytest.approx(8.5 - 0.5 * k)


@pytest.mark.parametrize("changes, message", [
    (dict(samples=0), "horizontal samples 0"), (dict(resolution=0.0), "resolution 0.0"),
    (dict(vertical_samples=-1), "vertical samples -1"), (dict(min_angle=math.nan), "min_angle nan"),
    (dict(vertical_max_angle=math.inf), "vertical_max_angle inf"), (dict(range_min=-1.0), "range_min -1.0"),
    (dict(range_max=math.nan), "range_max nan"), (dict(noise=Noise("gaussian", 0.0, -1.0)), "stddev -1.0")])
def test_unusable_settings_are_named(changes, message):
    with pytest.raises(ValueError, match=message):
        laser(**changes)


def test_warm_up_compiles_everything_a_scan_needs():
    warm_up(np.random.default_rng(0))
    from m2wr_sim.sensors import mesh_kernels, ray_kernels, reading_kernels
    if not hasattr(ray_kernels.cast_rays, "signatures"):
        pytest.skip("nothing is compiled here")
    kernels = (ray_kernels.cast_rays, mesh_kernels.cast_meshes, reading_kernels.finish_ranges, ray_kernels.write_poses)
    before = [len(kernel.signatures) for kernel in kernels]
    scene = world((Sphere(0.5), (2.0, 0.0, 0.0), 7.5))
    laser(noise=Noise("gaussian", 0.0, 0.01), resolution=0.5, vertical_samples=2).cast(scene, ORIGIN)
    scene.set_poses(np.array([0]), np.ones((1, 7)))
    assert [len(kernel.signatures) for kernel in kernels] == before == [1, 1, 1, 1]


@pytest.mark.skipif(not packed_kernels.COMPILED, reason="nothing is compiled here")
@pytest.mark.parametrize("changes", [{}, dict(vertical_samples=3, vertical_min_angle=-0.2, vertical_max_angle=0.3),
                                     dict(noise=Noise("gaussian", 0.02, 0.05)), dict(samples=1)])
def test_one_call_scans_as_two_kernels_do_to_the_bit(changes):
    at_once, apart, scene, draw = laser(**changes), laser(**changes), RayScene(2), np.random.default_rng(4)
    apart._block = None
    for turn in range(12):                              # the scene grows meanwhile
        for _ in range(turn % 3):
            shape = (Sphere(0.4), Box((0.5, 1.0, 2.0)))[int(draw.integers(2))]
            scene.add(shape, (tuple(draw.uniform(-6.0, 6.0, 3) * (1, 1, 0.1)), ORIGIN[1]), "many")
        pose = (tuple(draw.uniform(-1.0, 1.0, 3)), tuple(draw.normal(size=4)))
        readings = [one.cast(scene, pose)[0].tobytes() for one in (at_once, apart)]
        assert readings[0] == readings[1]
    assert np.isfinite(at_once.cast(scene, ORIGIN)[0]).any()


def test_a_scanner_moves_from_scene_to_scene():
    sensor, worlds = laser(samples=1), [world((Sphere(0.5), (distance, 0.0, 0.0))) for distance in (2.0, 3.0)]
    worlds.append(world((Sphere(0.5), (4.0, 0.0, 0.0), 1.0)))           # one that reflects, which goes another way
    assert [float(sensor.cast(scene, ORIGIN)[0][0]) for scene in worlds + worlds[::-1]] == pytest.approx(
        [1.5, 2.5, 3.5, 3.5, 2.5, 1.5], abs=1e-6)


@pytest.mark.parametrize("samples, resolution", [(2000000, 1.0), (90, 65536.0), (90, 1e12)])
def test_more_readings_than_a_sensor_may_have_are_named(samples, resolution):
    text = ("<robot name='r'><link name='l'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' "
            "iyz='0' izz='1'/></inertial></link><gazebo reference='l'><sensor type='ray' name='s'><ray><scan>"
            "<horizontal><samples>%d</samples><resolution>%r</resolution></horizontal></scan></ray></sensor>"
            "</gazebo></robot>")
    model = load_urdf(text % (samples, resolution), "a.urdf")
    ray, = [sensor.ray for link in model.links for sensor in link.sensors]
    assert LaserSensor(ray, np.random.default_rng(0)).count == RayScan().samples
    assert any("at most 1000000 readings" in str(note) for note in model.notes + model.remarks)


def test_a_list_of_near_shapes_changes_no_reading(monkeypatch):
    rng = np.random.default_rng(4)
    scene = RayScene(4)
    scene.add(Plane((0.0, 0.0, 1.0)), ORIGIN, "ground")
    for k, (x, y, size) in enumerate(rng.uniform((-60.0, -60.0, 0.1), (60.0, 60.0, 1.0), (700, 3)).tolist()):
        scene.add(Box((size, size, 1.0)) if k % 2 else Cylinder(size, 1.0), ((x, y, 0.5), UPRIGHT), k)
    mover = scene.add(Sphere(0.4), ((1.5, 0.0, 0.5), UPRIGHT), "mover")
    scene.mark_moving([mover])
    listing, plain = laser(), laser()
    lists = []
    list_near = laser_module.listing_kernels.list_near
    monkeypatch.setattr(laser_module.listing_kernels, "list_near", lambda *given: lists.append(1) or list_near(*given))
    for k in range(60):
        place = ((0.5 * k - 15.0, 0.1 * k, 0.3), quaternion_from_rpy(0.0, 0.0, 0.3 * k))
        ahead = np.array([[place[0][0] + 2.0, place[0][1], 0.5, 0.0, 0.0, 0.0, 1.0]])
        scene.mover(np.array([mover]), ahead)()
        if k == 30:
            scene.remove_owner(11)
            scene.add(Box((2.0, 2.0, 2.0)), ((place[0][0], place[0][1] + 3.0, 1.0), UPRIGHT), "new")
        if k == 40:
            scene.set_pose(scene.rows_of("new")[0], (place[0][0], place[0][1] - 3.0, 1.0), UPRIGHT)
        with monkeypatch.context() as all_shapes:
            all_shapes.setattr(laser_module, "_FEW_SHAPES", 10 ** 6)
            expected = plain.cast(scene, place)[0].copy()
        assert listing.cast(scene, place)[0].tobytes() == expected.tobytes()
    assert 10 < len(lists) < 25         # after each 2 m, and after what changed
