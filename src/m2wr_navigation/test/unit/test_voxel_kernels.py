# SPDX-License-Identifier: BSD-3-Clause
"""Points mark voxels, rays free those that they go through, counts make the cost of a column."""
import numpy as np
import pytest

from m2wr_navigation.costmap.layer import Window, no_bounds
from m2wr_navigation.costmap.voxel_kernels import UNKNOWN_COLUMN, clear, mark, restate

BOX = np.array([-1.0, -1.0, 0.0, 0.1, 0.2])         # 20 x 20 cells of 0.1 m, voxels of 0.2 m from the floor
SENSOR = (0.05, 0.05, 0.3)


def rules(voxels=10, mark_threshold=0, unknown_threshold=15):
    return np.array([voxels, mark_threshold, unknown_threshold], np.int64)


class Grid:
    def __init__(self, fill=UNKNOWN_COLUMN, cost=255, **given):
        self.columns, self.costs = np.full((20, 20), fill, np.uint32), np.full((20, 20), cost, np.uint8)
        self.rules, self.bounds, self.ends = rules(**given), no_bounds(), np.zeros((0, 3))

    def mark(self, points, reach=10.0, lowest=0.0, highest=2.0, sensor=SENSOR):
        return mark(self.columns, self.costs, BOX, self.rules, np.array(points, float).reshape(-1, 3),
                    np.array(sensor), reach, lowest, highest, self.bounds)

    def clear(self, points, reach=10.0, gap=0.2, sensor=SENSOR):
        points = np.array(points, float).reshape(-1, 3)
        ends = np.empty((len(points), 3))
        count = clear(self.columns, self.costs, BOX, self.rules, points, np.array(sensor, float), reach, gap, ends,
                      self.bounds)
        self.ends = ends[:count]
        return count

    def free(self):
        """Free voxels as a set of (height, row, column)."""
        return {(z, row, column) for z in range(self.rules[0])
                for row, column in zip(*np.nonzero((self.columns >> np.uint32(z)) & 1 == 0))}


def test_a_point_marks_its_voxel_and_its_column_is_lethal():
    grid = Grid()
    assert grid.mark([[0.25, -0.75, 0.7]]) == 1
    assert grid.columns[2, 12] == UNKNOWN_COLUMN | 1 << 19 and (grid.columns != UNKNOWN_COLUMN).sum() == 1
    assert grid.costs[2, 12] == 254 and (grid.costs == 254).sum() == 1
    assert Window.of(grid.bounds) == Window(2, 3, 12, 13)


@pytest.mark.parametrize("point", [
    [0.5, 0.5, 2.1], [0.5, 0.5, -0.1], [5.0, 0.0, 1.0], [-1.01, 0.0, 1.0], [np.nan, 0.0, 1.0], [0.0, 0.0, np.nan],
    [np.inf, 0.0, 1.0], [0.0, 0.0, np.inf]])
def test_points_of_other_heights_or_places_mark_nothing(point):
    grid = Grid()
    assert grid.mark([point]) == 0
    assert (grid.columns == UNKNOWN_COLUMN).all() and (grid.costs == 255).all() and Window.of(grid.bounds).is_empty


def test_points_below_the_grid_mark_the_floor_above_nothing():
    grid = Grid(voxels=3)
    assert grid.mark([[0.05, 0.05, -0.3], [0.15, 0.05, 0.65]], lowest=-1.0) == 1
    assert grid.columns[10, 10] == UNKNOWN_COLUMN | 1 << 16 and grid.columns[10, 11] == UNKNOWN_COLUMN


def test_the_distance_to_the_sensor_is_three_dimensional():
    assert Grid().mark([[0.35, 0.05, 0.3]], reach=0.4) == 1
    assert Grid().mark([[0.35, 0.05, 0.8]], reach=0.4) == 0


@pytest.mark.parametrize("threshold, heights, cost", [
    (0, [0.7], 254), (2, [0.7], 0), (2, [0.5, 0.7], 0), (2, [0.5, 0.7, 0.9], 254), (2, [0.7, 0.7, 0.7], 0)])
def test_more_marks_than_the_threshold_are_an_obstacle(threshold, heights, cost):
    """A table top at 0.7 m; a scan at 0.3 m sees the wall behind it."""
    grid = Grid(mark_threshold=threshold)
    grid.clear([[0.85, 0.05, 0.3]])
    grid.mark([[0.45, 0.05, height] for height in heights])
    assert grid.costs[10, 14] == cost and grid.costs[10, 12] == 0


def test_a_ray_under_a_table_leaves_the_table():
    grid = Grid()
    grid.mark([[0.45, 0.05, 0.7]])
    assert grid.clear([[0.85, 0.05, 0.3]]) == 1
    assert grid.costs[10, 14] == 254 and grid.columns[10, 14] == (UNKNOWN_COLUMN | 1 << 19) & ~0b10


def test_a_ray_above_an_obstacle_does_not_clear_it():
    grid = Grid()
    grid.mark([[0.45, 0.05, 0.1]])
    grid.clear([[0.85, 0.05, 0.3], [0.85, 0.05, 0.9]])
    assert grid.costs[10, 14] == 254
    # from 0.58 m down to 0.22 m: halfway, at 0.4 m, it is above an obstacle of 0.39 m
    grid = Grid(fill=0, cost=0)
    grid.mark([[0.45, 0.05, 0.39]])
    grid.clear([[0.85, 0.05, 0.22]], sensor=(0.05, 0.05, 0.598), gap=0.0)
    assert grid.costs[10, 14] == 254 and grid.free() == {(z, row, column) for z in range(10) for row in range(20)
                                                         for column in range(20)} - {(1, 10, 14)}


def test_a_ray_through_the_mark_clears_it():
    grid = Grid()
    grid.mark([[0.45, 0.05, 0.3]])
    grid.clear([[0.85, 0.05, 0.3]])
    assert grid.costs[10, 14] == 0


def test_a_ray_ends_two_cells_before_its_point():
    grid = Grid()
    assert grid.clear([[0.55, 0.05, 0.3]]) == 1
    assert grid.free() == {(1, 10, column) for column in range(10, 14)}
    assert grid.ends[0] == pytest.approx([0.35, 0.05, 0.3])
    assert Window.of(grid.bounds) == Window(10, 11, 10, 14)
    free = Grid()
    free.clear([[0.55, 0.05, 0.3]], gap=0.0)        # nothing was seen there
    assert free.free() == {(1, 10, column) for column in range(10, 16)}


def test_the_voxel_of_a_point_is_never_cleared_by_its_ray():
    """Voxels are higher than two cells: a steep ray ends in that of its point."""
    grid = Grid()
    grid.mark([[0.05, 0.05, 0.65]])
    grid.clear([[0.05, 0.05, 0.61]], sensor=(0.05, 0.05, 1.9), gap=0.1)
    assert grid.costs[10, 10] == 254 and {z for z, _, _ in grid.free()} == {4, 5, 6, 7, 8, 9}


@pytest.mark.parametrize("gap", [0.2, 5.0])
def test_a_point_nearer_than_the_gap_gives_no_ray(gap):
    grid = Grid()
    assert grid.clear([[0.05 + 0.9 * gap, 0.05, 0.3]], gap=gap) == 0 and not grid.free()


def test_a_ray_ends_at_the_range_and_at_the_faces_of_the_grid():
    grid = Grid()
    grid.clear([[0.95, 0.05, 0.3]], reach=0.3)
    assert grid.ends[0] == pytest.approx([0.35, 0.05, 0.3])
    for point, end in (([9.05, 0.05, 0.3], [1.0, 0.05, 0.3]), ([0.05, -9.0, 0.3], [0.05, -1.0, 0.3]),
                       ([0.05, 0.05, 9.0], [0.05, 0.05, 2.0]), ([0.35, 0.05, -0.3], [0.2, 0.05, 0.0])):
        grid = Grid()
        assert grid.clear([point]) == 1 and grid.ends[0] == pytest.approx(end, abs=1e-6)


def test_a_sensor_outside_clears_from_where_its_rays_enter():
    grid = Grid()
    assert grid.clear([[0.05, 0.05, 0.05]], sensor=(0.05, 0.05, 3.0)) == 1
    assert grid.free() == {(z, 10, 10) for z in range(1, 10)}
    grid = Grid()
    assert grid.clear([[-0.55, 0.05, 0.3]], sensor=(-2.0, 0.05, 0.3)) == 1
    assert grid.free() == {(1, 10, column) for column in range(3)}
    assert Grid().clear([[-0.5, 2.0, 0.3], [0.0, 0.0, 2.5]], sensor=(-2.0, 2.0, 2.5)) == 0


@pytest.mark.parametrize("point", [[np.nan, 0.0, 0.0], [0.0, np.inf, 0.0], [0.0, 0.0, np.nan], list(SENSOR)])
def test_a_point_that_gives_no_direction_clears_nothing(point):
    grid = Grid()
    assert grid.clear([point]) == 0 and not grid.free()
    assert grid.clear([[0.5, 0.5, 0.5]], sensor=(np.nan, 0.0, 0.0)) == 0 and not grid.free()


def test_a_column_is_free_when_few_voxels_are_unknown():
    grid = Grid(unknown_threshold=2)
    for height in range(8):
        assert grid.costs[10, 12] == 255
        z = 0.2 * height + 0.1
        grid.clear([[0.85, 0.05, z]], sensor=(0.05, 0.05, z))
    assert grid.costs[10, 12] == 0


def test_voxels_above_the_column_do_not_count_as_unknown():
    grid = Grid(voxels=2, unknown_threshold=1)
    grid.clear([[0.85, 0.05, 0.3]])
    assert grid.costs[10, 12] == 0


def plain_free(point, sensor, share):
    """Voxels of many places along a ray, and how many lie along its longest axis."""
    start, step = (np.array(sensor) - BOX[:3]) / BOX[[3, 3, 4]], (np.array(point) - sensor) / BOX[[3, 3, 4]]
    places = start + np.linspace(0.0, share, 40001)[:, None] * step
    inside = ((places >= 0.0) & (places < [20.0, 20.0, 10.0])).all(1)
    cells = np.floor(places[inside]).astype(int)
    longest = int(np.argmax(np.abs(step)))
    return {(z, y, x) for x, y, z in cells.tolist()}, len(set(cells[:, longest].tolist()))


@pytest.mark.parametrize("seed", range(60))
def test_a_ray_frees_one_voxel_for_each_step_and_only_its_own(seed):
    random = np.random.default_rng(seed)
    sensor, point = random.uniform([-1.3, -1.3, -0.3], [1.3, 1.3, 2.3], (2, 3))
    grid, gap = Grid(), 0.2 if seed % 2 else 0.0
    grid.clear([point], gap=gap, sensor=sensor)
    along, steps = plain_free(point, sensor, max(0.0, 1.0 - gap / np.linalg.norm(point - sensor)))
    found = grid.free()
    assert found <= along and abs(len(found) - steps) <= 1
    assert ((grid.costs == 0) == (grid.columns != UNKNOWN_COLUMN)).all()


def test_bounds_hold_the_cells_whose_costs_change():
    random, grid = np.random.default_rng(4), Grid(mark_threshold=1, unknown_threshold=8)
    for _ in range(50):
        before, grid.bounds = grid.costs.copy(), no_bounds()
        points = random.uniform([-1.2, -1.2, -0.2], [1.2, 1.2, 2.2], (20, 3))
        grid.clear(points)
        grid.mark(points)
        rows, columns = np.nonzero(before != grid.costs)
        expected = Window(rows.min(), rows.max() + 1, columns.min(), columns.max() + 1) if len(rows) else None
        found = Window.of(grid.bounds)
        assert expected is None or expected.union(found) == found


def test_costs_follow_when_the_thresholds_change():
    grid = Grid()
    grid.mark([[0.45, 0.05, 0.3], [0.45, 0.05, 0.7], [0.65, 0.05, 0.3]])
    grid.rules = rules(mark_threshold=1)
    restate(grid.columns, grid.costs, grid.rules, grid.bounds)
    assert grid.costs[10, 14] == 254 and grid.costs[10, 16] == 0 and grid.costs[10, 15] == 255
    grid.rules = rules(mark_threshold=1, unknown_threshold=5)
    restate(grid.columns, grid.costs, grid.rules, grid.bounds)
    assert grid.costs[10, 16] == 255
