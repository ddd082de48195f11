# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of meshes: against those of the boxes that the meshes are made of."""
import math

import numpy as np
import pytest

from m2wr_view.mesh_outlines import hull_outline, mesh_outlines
from m2wr_view.outlines import box_outline, least_clearance

CUBE = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
FACES = np.array([(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4),
                  (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)])


def turn_z(yaw):
    """Return the rotation matrix (3, 3) about z."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([(cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)])


def box_mesh(size, centre, rotation):
    """Return the corners and triangles of a box."""
    return (CUBE * size).dot(rotation.T) + centre, FACES


def grid_mesh(height, count=21, side=4.0):
    """Return the corners and triangles of a surface z = height(x, y) over a square around the origin."""
    x, y = np.meshgrid(np.linspace(-side / 2, side / 2, count), np.linspace(-side / 2, side / 2, count))
    first = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).reshape(-1)
    triangles = np.concatenate([np.stack((first, first + 1, first + count + 1), 1),
                                np.stack((first, first + count + 1, first + count), 1)])
    return np.stack((x, y, height(x, y)), -1).reshape(-1, 3), triangles


def joined(meshes):
    """Return one mesh of many, as a file of a whole building has it."""
    firsts = np.cumsum([0] + [len(points) for points, _ in meshes])
    return np.concatenate([points for points, _ in meshes]), np.concatenate(
        [triangles + first for (_, triangles), first in zip(meshes, firsts)])


@pytest.mark.parametrize("winding", [1, -1])
def test_a_building_of_boxes_has_their_outlines(winding):
    random = np.random.default_rng(3)
    places = [((1.0 + index % 3, 0.2, 1.0), (3.0 * (index % 4), 3.0 * (index // 4), 0.45), turn_z(yaw))
              for index, yaw in enumerate(random.uniform(0, 6, 12))]
    points, triangles = joined([box_mesh(*place) for place in places])
    found = mesh_outlines(points, triangles[:, ::winding], name="house")
    assert winding < 0 or len(found) == 12
    assert {outline.name for outline in found} == {"house"}
    expected = [box_outline(*place) for place in places]
    for poses in random.uniform((-1, -1, -3), (10, 10, 3), (40, 1, 3)):
        distance = least_clearance(poses, expected).distance
        assert least_clearance(poses, found).distance == pytest.approx(distance, abs=1e-4)


def test_corners_of_triangles_are_joined_as_in_an_stl_file():
    points, triangles = box_mesh((1.0, 2.0, 1.0), (3.0, 0.0, 0.5), np.eye(3))
    separate = points[triangles].reshape(-1, 3) + np.random.default_rng(1).uniform(-2e-7, 2e-7, (36, 3))
    outline, = mesh_outlines(separate, np.arange(36).reshape(-1, 3))
    assert outline.vertices == pytest.approx(box_outline((1, 2, 1), (3, 0, 0.5), np.eye(3)).vertices, abs=3e-5)


def test_walls_around_a_robot_are_lines():
    """Four tessellated walls that face inwards are one part; each gives one line, and the middle is free."""
    points, triangles = grid_mesh(lambda x, y: 0.0 * x, count=9)
    upright = np.column_stack((points[:, 0], np.full(len(points), 2.0), points[:, 1] + 2.0))
    room = joined([(upright.dot(turn_z(yaw).T), triangles) for yaw in 0.5 * math.pi * np.arange(4)])
    found = mesh_outlines(*room)
    assert [np.ptp(line.vertices, axis=0).max() for line in found] == pytest.approx([4.0] * 4, abs=1e-4)
    assert least_clearance(np.array([(0.0, 0.0, 0.0)]), found).distance == pytest.approx(2.0 - 0.40, abs=1e-4)
    outside, = mesh_outlines(room[0], room[1][:, ::-1])         # the walls of a pillar
    assert len(outside.vertices) == 4


def test_ground_is_no_obstacle_and_a_steep_step_in_it_is_one():
    assert mesh_outlines(*grid_mesh(lambda x, y: 0.05 * np.sin(x) + 0.05)) == []
    found = mesh_outlines(*grid_mesh(lambda x, y: np.where(x > 0.95, 0.5, 0.0) + 0.001 * y))
    assert found
    reach = np.concatenate([outline.vertices for outline in found])
    assert reach[:, 0].min() > 0.79 and reach[:, 0].max() < 1.01       # between two samples
    assert np.ptp(reach[:, 1]) == pytest.approx(4.0)


def test_only_what_is_between_the_heights_counts():
    table = joined([box_mesh((1.0, 1.0, 0.1), (0.0, 0.0, 0.8), np.eye(3)),
                    box_mesh((0.1, 0.1, 0.75), (0.4, 0.4, 0.375), np.eye(3))])
    leg, = mesh_outlines(*table)
    assert leg.vertices.mean(axis=0) == pytest.approx((0.4, 0.4))
    assert len(mesh_outlines(*table, high=1.0)) == 2


def test_triangles_without_area_and_meshes_without_triangles():
    points, triangles = box_mesh((1.0, 1.0, 1.0), (0.0, 0.0, 0.5), np.eye(3))
    more = np.concatenate((triangles, [(0, 0, 1), (2, 2, 2)]))
    assert len(mesh_outlines(points, more)) == 1
    assert mesh_outlines(points, triangles[:0]) == [] and hull_outline(points, triangles[:0]) is None
    assert mesh_outlines(points, more[-2:]) == []


def test_hull_of_a_mesh_between_two_heights():
    points, triangles = joined([box_mesh((1.0, 1.0, 0.1), (0.0, 0.0, 0.8), np.eye(3)),
                                box_mesh((0.1, 0.1, 0.75), (0.4, 0.4, 0.375), np.eye(3)),
                                box_mesh((0.1, 0.1, 0.75), (-0.4, 0.4, 0.375), np.eye(3))])
    hull = hull_outline(points, triangles, name="table")
    assert hull.vertices.min(axis=0) == pytest.approx((-0.45, 0.35)) and hull.name == "table"
    assert hull.vertices.max(axis=0) == pytest.approx((0.45, 0.45))
    assert hull_outline(points, triangles, 2.0, 3.0) is None
