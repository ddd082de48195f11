# SPDX-License-Identifier: BSD-3-Clause
"""Rays against heightmaps: the walk over blocks of cells against the tree of the same triangles."""
import math
import random

import numpy as np
import pytest

from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Heightmap, Mesh, RayScan
from m2wr_sim.sensors.height_blocks import build_blocks
from m2wr_sim.sensors.laser import LaserSensor
from m2wr_sim.sensors.mesh_tree import corners_of
from m2wr_sim.sensors.ray_scene import RayScene

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
DOWN = quaternion_from_rpy(0.0, 0.5 * math.pi, 0.0)
ALL_ROUND = RayScan(samples=360, min_angle=-math.pi, max_angle=math.pi, vertical_samples=12, vertical_min_angle=-1.5,
                    vertical_max_angle=1.5, range_min=0.05, range_max=30.0)


def hills(rows, columns, seed, noise=0.02, position=(0.5, -1.0, 0.2)):
    draw = np.random.RandomState(seed)
    y, x = np.mgrid[0:rows, 0:columns] * 1.0
    heights = 0.5 * np.sin(17.0 * x / columns) * np.cos(11.0 * y / rows) + draw.normal(0.0, noise, (rows, columns))
    return Heightmap(heights, (9.0, 7.0), position, "hills %d" % seed)


def as_mesh(field):
    corners = corners_of(field)
    return Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3), field.source)


def seen(shape, place, scan, pose):
    """Return the distances of all rays, and how many hit."""
    scene = RayScene()
    scene.add(shape, place, "ground")
    sensor = LaserSensor(scan, np.random.default_rng(0))
    sensor.cast(scene, pose)
    return sensor._distances.copy(), int(np.sum(sensor._distances < scan.range_max))


@pytest.mark.parametrize("rows, columns", [(2, 2), (2, 70), (5, 6), (65, 65), (66, 130), (257, 40)])
@pytest.mark.parametrize("seed", range(4))
def test_rays_end_where_they_end_on_the_same_triangles(rows, columns, seed):
    draw, field = random.Random(seed), hills(rows, columns, seed)
    place = (tuple(draw.uniform(-1.0, 1.0) for _ in range(3)),
             UPRIGHT if seed % 2 else quaternion_from_rpy(*(draw.gauss(0.0, width) for width in (0.3, 0.3, 2.0))))
    hits = 0
    for height in (-0.4, 0.3, 0.8, 4.0):            # from below, among and above the hills
        pose = ((draw.uniform(-5.0, 5.0), draw.uniform(-5.0, 5.0), height),
                quaternion_from_rpy(draw.gauss(0.0, 0.1), draw.gauss(0.0, 0.1), draw.uniform(-3.0, 3.0)))
        found, count = seen(field, place, ALL_ROUND, pose)
        expected, _ = seen(as_mesh(field), place, ALL_ROUND, pose)
        # a ray in a triangle's plane, or through the very rim, may be a hit for one and none for the other
        assert np.sum(np.abs(found - expected) > 1e-8) <= 1
        hits += count
    assert hits > 1000


@pytest.mark.parametrize("rows, columns", [(9, 9), (33, 65)])
def test_rays_along_edges_and_at_corners_do_not_slip_through(rows, columns):
    """Samples are looked at from straight above, and along the columns, rows and diagonals on which they lie."""
    field = hills(rows, columns, 3, position=(0.0, 0.0, 0.0))
    corners, scan = corners_of(field).reshape(-1, 3), RayScan(samples=1, range_min=0.1, range_max=20.0)
    scene = RayScene()
    scene.add(field, ((0.0, 0.0, 0.0), UPRIGHT), "ground")
    sensor = LaserSensor(scan, np.random.default_rng(0))
    inner = corners[(np.abs(corners[:, 0]) < 2.0) & (np.abs(corners[:, 1]) < 1.0)]      # the rays begin over the ground
    for corner in inner[:: max(1, len(inner) // 300)]:
        sensor.cast(scene, ((corner[0], corner[1], 5.0), DOWN))
        assert sensor._distances[0] == pytest.approx(5.0 - corner[2], abs=1e-9)
    for yaw in (0.0, 0.5 * math.pi, math.atan2(7.0 / (rows - 1), 9.0 / (columns - 1))):
        down = quaternion_from_rpy(0.0, 0.6, yaw)
        for corner in inner[:: max(1, len(inner) // 100)]:
            along = np.array((math.cos(0.6) * math.cos(yaw), math.cos(0.6) * math.sin(yaw), -math.sin(0.6)))
            start = corner - (0.0, 0.0, 1e-7) - 3.0 * along        # the ray ends below the ground
            sensor.cast(scene, (tuple(start), down))
            assert sensor._distances[0] <= 3.0


def test_a_nearer_hit_is_kept_and_a_ray_ends_at_its_range():
    field = Heightmap(np.zeros((50, 50)), (10.0, 10.0))
    scene = RayScene()
    row = scene.add(field, ((0.0, 0.0, 0.0), UPRIGHT), "ground", retro=3.0)
    other = scene.add(Heightmap(np.zeros((2, 2)), (1.0, 1.0)), ((0.0, 0.0, 1.0), UPRIGHT), "table", retro=5.0)
    for x, distance, hit in ((0.0, 2.0, other), (0.6, 3.0, row), (5.1, 9.0, -1)):
        sensor = LaserSensor(RayScan(samples=1, range_min=0.1, range_max=9.0), np.random.default_rng(0))
        sensor.cast(scene, ((x, 0.0, 3.0), DOWN))
        assert (sensor._distances[0], sensor._hits[0]) == (pytest.approx(distance), hit)
    scene.remove_owner("table")
    assert list(scene.grounds) == [row]
    sensor = LaserSensor(RayScan(samples=1, range_min=0.1, range_max=2.9), np.random.default_rng(0))
    assert sensor.cast(scene, ((0.0, 0.0, 3.0), DOWN))[0] == [math.inf]
    assert sensor.cast(scene, ((0.0, 0.0, 1.0), DOWN), ignore_owner="ground")[0] == [math.inf]


@pytest.mark.parametrize("rows, columns", [(2, 2), (4, 5), (5, 6), (65, 17), (70, 131)])
def test_blocks_hold_the_heights_of_their_cells(rows, columns):
    made = build_blocks(hills(rows, columns, 1))
    assert tuple(made.levels[-1, 1:]) == (1, 1)
    for level, (first, down, across) in enumerate(made.levels):
        side = 4 ** (level + 1)
        assert (down, across) == (-(-(rows - 1) // side), -(-(columns - 1) // side))
        for i in range(down):
            for j in range(across):
                part = made.heights[i * side:(i + 1) * side + 1, j * side:(j + 1) * side + 1]
                assert tuple(made.blocks[first + i * across + j]) == (part.min(), part.max())


@pytest.mark.parametrize("heights", [np.zeros((1, 5)), np.array([[0.0, math.nan], [1.0, 1.0]]), np.zeros(4)])
def test_heights_without_a_surface_are_refused(heights):
    with pytest.raises(ValueError, match="at least 2 x 2 finite heights"):
        build_blocks(Heightmap(heights))


@pytest.mark.parametrize("pose", [((math.nan, 0.0, 1.0), UPRIGHT), ((0.0, 0.0, 1.0), (math.nan,) * 4),
                                  ((0.0, math.inf, 1.0), UPRIGHT)])
def test_a_pose_that_is_not_finite_hits_nothing(pose):
    field = Heightmap(np.zeros((9, 9)), (10.0, 10.0))
    assert seen(field, ((0.0, 0.0, 0.0), UPRIGHT), ALL_ROUND, pose)[1] == 0
    assert seen(field, pose, ALL_ROUND, ((0.0, 0.0, 1.0), UPRIGHT))[1] == 0
    assert seen(field, ((0.0, 0.0, 0.0), UPRIGHT), ALL_ROUND, ((0.0, 0.0, 1.0), UPRIGHT))[1] > 0
