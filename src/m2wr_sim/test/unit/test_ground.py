# SPDX-License-Identifier: BSD-3-Clause
"""Ground for viewers: which shapes are ground, and that few triangles keep its form."""
import numpy as np
import pytest

from m2wr_sim.model.ground import clustered, ground_of, is_ground, tinted
from m2wr_sim.model.types import Box, Heightmap, Mesh
from m2wr_sim.sensors.mesh_tree import corners_of

HERE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
OVER = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))         # upside down


def hills(rows=65, columns=33):
    y, x = np.mgrid[0:rows, 0:columns] / 8.0
    return Heightmap(0.3 * np.sin(x) * np.cos(y), (4.0, 8.0), (1.0, 2.0, 0.5))


def mesh_of(corners):
    return Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))


def test_a_heightmap_and_a_mesh_that_faces_up_are_ground():
    assert is_ground(hills(), HERE)
    surface = mesh_of(corners_of(hills()))
    assert is_ground(surface, HERE) and not is_ground(surface, OVER)


def test_a_solid_is_no_ground():
    low = corners_of(hills())
    closed = mesh_of(np.concatenate((low, low[:, ::-1] - (0.0, 0.0, 1.0))))
    assert not is_ground(closed, HERE) and not is_ground(Box((1.0, 1.0, 1.0)), HERE)


def test_all_triangles_are_kept_where_they_are_few():
    ground, = ground_of([(hills(), HERE)], 10000)
    kept = {tuple(np.round(corner.ravel(), 9)) for corner in ground.points[ground.triangles]}
    assert kept == {tuple(np.round(corner.ravel(), 9)) for corner in corners_of(hills())}


@pytest.mark.parametrize("form", ["heightmap", "mesh"])
def test_few_triangles_keep_the_form(form):
    field = hills(129, 129)
    shape = field if form == "heightmap" else mesh_of(corners_of(field))
    ground, = ground_of([(shape, HERE)], 2000)
    assert 500 < len(ground.triangles) <= 2000
    x, y = ground.points[:, 0] - 1.0, ground.points[:, 1] - 2.0
    columns, rows = (x / 4.0 + 0.5) * 128 / 8.0, (0.5 - y / 8.0) * 128 / 8.0
    assert np.abs(ground.points[:, 2] - 0.5 - 0.3 * np.sin(columns) * np.cos(rows)).max() < 0.06
    assert np.ptp(ground.points[:, 0]) > 3.8 and np.ptp(ground.points[:, 1]) > 7.6


def test_simplified_meshes_still_meet():
    corners = corners_of(hills(129, 129))
    left = corners[..., 0].max(axis=1) <= 1.0 + 1e-9
    one, two = clustered([(part.reshape(-1, 3), np.arange(3 * len(part)).reshape(-1, 3))
                          for part in (corners[left], corners[~left])], 1000)
    shared = {tuple(point) for point in one[0][one[1].ravel()]} & {tuple(point) for point in two[0][two[1].ravel()]}
    assert len(shared) > 5


def test_a_slope_to_the_light_is_brighter():
    y, x = np.mgrid[0:9, 0:9] * 1.0
    shades = {}
    for name, heights in (("to", x), ("away", -x)):
        ground, = ground_of([(Heightmap(heights, (8.0, 8.0)), HERE)], 1000)
        shades[name] = tinted(ground.shades, (0.4, 0.4, 0.4))[len(ground.shades) // 2, 0]
    assert shades["to"] > 1.5 * shades["away"]
