# SPDX-License-Identifier: BSD-3-Clause
"""Points mark cells, rays clear the cells before them."""
import numpy as np
import pytest

from m2wr_navigation.costmap.layer import Window, no_bounds
from m2wr_navigation.costmap.obstacle_kernels import clear, mark, surface_cells

ORIGIN = np.array([-1.0, -1.0])


def marked(points, grid=None, reach=10.0, lowest=0.0, highest=2.0, sensor=(0.0, 0.0, 0.5)):
    grid, bounds = np.zeros((20, 20), np.uint8) if grid is None else grid, no_bounds()
    count = mark(grid, 0.1, ORIGIN, np.array(points, float).reshape(-1, 3), np.array(sensor), reach, lowest, highest,
                 bounds)
    return grid, bounds, count


def cleared(ends, fill=254, reach=10.0, sensor=(0.05, 0.05, 0.0)):
    grid, bounds = np.full((20, 20), fill, np.uint8), no_bounds()
    count = clear(grid, 0.1, ORIGIN, np.array(ends, float).reshape(-1, 3), np.array(sensor), reach, bounds)
    return grid, bounds, count


def test_a_point_makes_its_cell_lethal_and_extends_the_bounds():
    grid, bounds, count = marked([[0.25, -0.75, 1.0]])
    assert count == 1 and grid[2, 12] == 254 and grid.sum() == 254
    assert Window.of(bounds) == Window(2, 3, 12, 13)


@pytest.mark.parametrize("point", [
    [0.5, 0.5, 2.1], [0.5, 0.5, -0.1], [5.0, 0.0, 1.0], [-1.01, 0.0, 1.0], [np.nan, 0.0, 1.0], [0.0, 0.0, np.nan]])
def test_points_of_other_heights_or_places_mark_nothing(point):
    grid, bounds, count = marked([point])
    assert count == 0 and not grid.any() and Window.of(bounds).is_empty


def test_the_distance_to_the_sensor_is_three_dimensional():
    assert marked([[0.3, 0.0, 0.5]], reach=0.4)[2] == 1
    assert marked([[0.3, 0.0, 1.0]], reach=0.4)[2] == 0


def test_a_ray_clears_up_to_the_cell_before_its_end():
    grid, bounds, count = cleared([[0.55, 0.05, 0.0]])
    assert count == 1 and (grid[10, 10:15] == 0).all() and grid[10, 15] == 254
    assert (grid != 254).sum() == 5 and Window.of(bounds) == Window(10, 11, 10, 16)


@pytest.mark.parametrize("angle", np.linspace(0.0, 2.0 * np.pi, 17))
def test_a_ray_to_any_side_is_connected_and_near_the_line(angle):
    end = 0.05 + 0.8 * np.array([np.cos(angle), np.sin(angle)])
    grid = cleared([[end[0], end[1], 0.0]])[0]
    rows, columns = np.nonzero(grid == 0)
    points = np.stack([columns, rows], -1) * 0.1 + ORIGIN + 0.05
    across = np.abs((points - 0.05) @ np.array([-np.sin(angle), np.cos(angle)]))
    assert across.max() <= 0.0751 and len(rows) >= 5


def test_a_ray_ends_at_the_raytrace_range_and_at_the_edge():
    assert (cleared([[0.95, 0.05, 0.0]], reach=0.3)[0][10] == 0).sum() == 3
    assert (cleared([[9.0, 0.05, 0.0]])[0][10] == 0).sum() == 9
    assert (cleared([[-9.0, -9.0, 0.0]])[0] == 0).sum() == 10


@pytest.mark.parametrize("end", [[np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]])
def test_an_end_that_is_not_finite_clears_nothing(end):
    grid, _, count = cleared([end])
    assert count == 0 and (grid == 254).all()


def test_a_sensor_outside_of_the_grid_clears_nothing():
    grid, bounds, count = cleared([[0.0, 0.0, 0.0]], sensor=(3.0, 0.0, 0.0))
    assert count == 0 and (grid == 254).all() and Window.of(bounds).is_empty


def walls(grid, ends, reach=5.0, increment=0.2, sensor=(-0.9, 0.05, 0.0)):
    return {tuple(cell) for cell in surface_cells(grid, 0.1, ORIGIN, np.array(ends, float), np.array(sensor), reach,
                                                  increment).tolist()}


def test_a_wall_that_a_scan_looks_along_is_kept():
    grid = np.zeros((20, 20), np.uint8)
    grid[11, 3:20] = 254                                # a wall from x = -0.7 to 1.0 at y = 0.1 to 0.2
    grid[15, 10] = 254                                  # something before nothing
    ends = [(0.9, 0.12, 0.0), (0.1, 0.12, 0.0), (-0.3, 0.12, 0.0), (-0.5, 0.12, 0.0)]
    found = walls(grid, ends)
    assert {(11, column) for column in range(5, 19)} <= found and (15, 10) not in found
    clear(grid, 0.1, ORIGIN, np.array(ends), np.array((-0.9, 0.05, 0.0)), 10.0, no_bounds())
    assert np.count_nonzero(grid[11] == 254) < 17       # what would be lost


@pytest.mark.parametrize("ends, options", [
    ([(0.9, 0.12, 0.0), (-0.3, 0.12, 0.0)], {}),                                # two points alone make no surface
    ([(0.9, 0.12, 0.0), (0.1, 0.12, 0.0), (-0.3, 0.12, 0.0)], {"increment": 0.01}),     # beams between them are missing
    ([(0.9, 0.12, 0.0), (0.1, 0.12, 0.0), (-0.3, 0.12, 0.0)], {"reach": 0.5}),
    ([(0.9, 0.12, 0.0), (-0.3, 0.12, 0.0), (0.5, 0.12, 0.0)], {}),              # to and fro
    ([(0.9, 0.12, 0.0), (np.nan, 0.12, 0.0), (-0.3, 0.12, 0.0)], {}), (np.zeros((0, 3)), {})])
def test_what_is_no_surface_may_be_freed(ends, options):
    grid = np.zeros((20, 20), np.uint8)
    grid[11, 3:20] = 254
    assert not walls(grid, ends, **options)


def test_a_scan_keeps_a_bounded_number_of_cells(monkeypatch):
    grid = np.full((20, 20), 254, np.uint8)
    ends = np.tile([(0.9, 0.12, 0.0), (0.1, 0.12, 0.0), (-0.3, 0.12, 0.0)], (20000, 1))
    assert len(surface_cells(grid, 0.1, ORIGIN, ends, np.array((-0.9, 0.05, 0.0)), 5.0, 3.0)) <= 200_000
